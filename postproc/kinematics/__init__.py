"""Forward and inverse kinematics, Jacobian, status and turn, distance to singularity."""
