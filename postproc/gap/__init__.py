"""The gap between simulation and the real robot: effects, fit, selection, verdict."""
