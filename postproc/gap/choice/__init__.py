"""Which effects are adopted, and the verdict."""

from postproc.gap.choice.classes import SURE, Group, beaten, groups_of, unexplained
from postproc.gap.choice.classes import Part as RestPart
from postproc.gap.choice.confounding import CONFOUNDED
from postproc.gap.choice.residual import Dependence
from postproc.gap.choice.search import DECISIVE, PRIOR_LIBRARY
from postproc.gap.choice.selection import Prepared, prepare, select, without_waves
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.choice.verdict import Assessment, assess, fitted, named, verdict

__all__ = [
    "CONFOUNDED",
    "DECISIVE",
    "PRIOR_LIBRARY",
    "SURE",
    "Assessment",
    "Choice",
    "Dependence",
    "Group",
    "Prepared",
    "RestPart",
    "Standing",
    "assess",
    "beaten",
    "fitted",
    "groups_of",
    "named",
    "prepare",
    "select",
    "unexplained",
    "verdict",
    "without_waves",
]
