"""Cartesian stiffness and compliance, task indices, identification of joint stiffness."""
