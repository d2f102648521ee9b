"""Which effects are adopted, and the verdict."""

from postproc.gap.choice.residual import Dependence
from postproc.gap.choice.selection import prepare, select, without_waves
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.choice.verdict import Assessment, assess, fitted, verdict

__all__ = [
    "Assessment",
    "Choice",
    "Dependence",
    "Standing",
    "assess",
    "fitted",
    "prepare",
    "select",
    "verdict",
    "without_waves",
]
