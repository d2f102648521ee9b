"""CAM toolpaths to checked KUKA robot programs, and the gap between simulation and the real arm."""

__version__ = "0.1.0"
