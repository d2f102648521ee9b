"""Estimated times and speed profiles; the only user of ruckig."""

from postproc.timing.bounded import JointPath
from postproc.timing.profile import (
    ORIENTATION_SPEED,
    PATH_ACCELERATION,
    RAMP,
    SPEED_UP_TIME,
    axis_speed_cap,
    chain_profile,
    joint_move_time,
    line_time,
    path_times,
)

__all__ = [
    "ORIENTATION_SPEED",
    "PATH_ACCELERATION",
    "RAMP",
    "SPEED_UP_TIME",
    "JointPath",
    "axis_speed_cap",
    "chain_profile",
    "joint_move_time",
    "line_time",
    "path_times",
]
