"""Which effects are adopted, and the verdict."""

from postproc.gap.choice.classes import Part as RestPart
from postproc.gap.choice.classes import beaten, unexplained
from postproc.gap.choice.residual import Dependence
from postproc.gap.choice.selection import Prepared, prepare, select, without_waves
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.choice.verdict import Assessment, assess, fitted, named, verdict

__all__ = [
    "Assessment",
    "Choice",
    "Dependence",
    "Prepared",
    "RestPart",
    "Standing",
    "assess",
    "beaten",
    "fitted",
    "named",
    "prepare",
    "select",
    "unexplained",
    "verdict",
    "without_waves",
]
