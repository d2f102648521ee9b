"""Forward and inverse kinematics, Jacobian, status and turn, distance to singularity."""

from postproc.kinematics.branches import wrapped
from postproc.kinematics.build import build
from postproc.kinematics.corners import (
    IN_STEP,
    NEARER,
    Bound,
    Corners,
    Pieces,
    bound_of,
    joint_share,
)
from postproc.kinematics.dynamics import dynamics_of
from postproc.kinematics.model import Kinematics
from postproc.kinematics.rounding import corner_miss, within_tolerance
from postproc.kinematics.singular import (
    STRETCHED,
    elbow_distance,
    is_coaxial_with_axis_6,
    shoulder_distance,
    smallest_singular_value,
    status_turn,
    wrist_distance,
)
