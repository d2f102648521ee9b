"""Which states and motions are allowed, and why not."""

from postproc.planning.checks.explain import (
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
from postproc.planning.checks.grade import CLOSE, NEAR, NEAR_BY, Grade, grade_counts, grades
from postproc.planning.checks.remedy import LEAD_OUT
from postproc.planning.checks.working import moves_of_tags, near_solids, tag_clearances

__all__ = [
    "CLOSE",
    "LARGEST_TURN",
    "LEAD_OUT",
    "LOWER",
    "MORE_CLEARANCE",
    "NEAR",
    "NEAR_BY",
    "RESOLUTION",
    "Break",
    "Checker",
    "Evidence",
    "Grade",
    "Lines",
    "Reason",
    "Track",
    "Verdict",
    "explained",
    "failure",
    "gave_up",
    "given_up",
    "grade_counts",
    "grades",
    "moves_of_tags",
    "near_solids",
    "poses_between",
    "tag_clearances",
]
