"""From executed motions to joint paths, moments and times."""

from postproc.paths.moments import Clock, Displacement, Moments, directions, moments_of
from postproc.paths.motion import Paths, Shift, joint_paths, joints_at_end
from postproc.paths.times import SLOWEST, cycle_time, durations, motion_times

__all__ = [
    "SLOWEST",
    "Clock",
    "Displacement",
    "Moments",
    "Paths",
    "Shift",
    "cycle_time",
    "directions",
    "durations",
    "joint_paths",
    "joints_at_end",
    "moments_of",
    "motion_times",
]
