"""Which states and motions are allowed, and why not."""

from postproc.planning.checks.explain import Evidence, explained, failure, gave_up
from postproc.planning.checks.feasible import Checker, Lines, Reason, Verdict, poses_between
from postproc.planning.checks.grade import CLOSE, NEAR, Grade, grade_counts, grades

__all__ = [
    "CLOSE",
    "NEAR",
    "Checker",
    "Evidence",
    "Grade",
    "Lines",
    "Reason",
    "Verdict",
    "explained",
    "failure",
    "gave_up",
    "grade_counts",
    "grades",
    "poses_between",
]
