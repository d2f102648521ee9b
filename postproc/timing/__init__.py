"""Estimated times and speed profiles; the only user of ruckig."""

from postproc.timing.bounded import JointPath, slopes
from postproc.timing.profile import (
    RAMP,
    SPEED_UP_TIME,
    Bends,
    axis_speed_cap,
    chain_profile,
    joint_move_time,
    path_times,
)
from postproc.timing.racing import Samples, resolved
from postproc.timing.torques import Torques
