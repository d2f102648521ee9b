"""The independent eye: runs program text on the robot model and compares programs."""
