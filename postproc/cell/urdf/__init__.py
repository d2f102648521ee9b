"""Arms described by URDF."""
