"""Which effects are adopted, and the verdict."""

from postproc.gap.choice.choice import Choice
from postproc.gap.choice.residual import Dependence
from postproc.gap.choice.verdict import Settled, fitted, settle, verdict
from postproc.gap.choice.workbench import chosen, prepare, without_waves

__all__ = [
    "Choice",
    "Dependence",
    "Settled",
    "chosen",
    "fitted",
    "prepare",
    "settle",
    "verdict",
    "without_waves",
]
