"""Which states and motions are allowed, and why not."""

from postproc.planning.checks.explain import (
    LEAD_OUT,
    LOWER,
    Break,
    Evidence,
    explained,
    failure,
    gave_up,
    given_up,
)
from postproc.planning.checks.feasible import (
    LARGEST_TURN,
    MORE_CLEARANCE,
    RESOLUTION,
    Checker,
    Lines,
    Reason,
    Track,
    Verdict,
    poses_between,
)
from postproc.planning.checks.working import (
    CLOSE,
    NEAR,
    Grade,
    grade_counts,
    grades,
    moves_of_tags,
    near_solids,
    tag_clearances,
)
