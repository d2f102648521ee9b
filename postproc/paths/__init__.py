"""From executed motions to joint paths, moments and times."""

from postproc.paths.externals import Externals
from postproc.paths.moments import Displacement, Moments, Timeline, directions, moments_of
from postproc.paths.motion import STEP_ANGLE, Paths, Shift, Station, joint_paths, top_speeds
from postproc.paths.times import (
    SLOWEST,
    at_speed,
    bends_of,
    chains,
    cycle_time,
    durations,
    feed_shares,
    joint_path,
    joint_times,
    motion_times,
    speed_shares,
    torques_of,
)
from postproc.paths.world import run_in_cell
