"""Which effects are adopted, and the verdict."""

from postproc.gap.choice.classes import (
    SURE,
    Group,
    groups_of,
    unexplained,
    wandering,
)
from postproc.gap.choice.classes import Part as RestPart
from postproc.gap.choice.confounding import CONFOUNDED
from postproc.gap.choice.evidence import FOLDS_WON, smallest_of
from postproc.gap.choice.fitting import Named
from postproc.gap.choice.residual import Dependence
from postproc.gap.choice.rivals import beaten, displaced, doubted
from postproc.gap.choice.search import DECISIVE, TEMPERATURE, price_of
from postproc.gap.choice.selection import (
    Prepared,
    elusive,
    prepare,
    prepared_with,
    select,
    without_waves,
)
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.choice.uneven import uneven
from postproc.gap.choice.verdict import (
    Assessment,
    assess,
    is_overshadowed,
    is_undecided,
    unusual,
    verdict,
)

__all__ = [
    "CONFOUNDED",
    "DECISIVE",
    "FOLDS_WON",
    "SURE",
    "TEMPERATURE",
    "Assessment",
    "Choice",
    "Dependence",
    "Group",
    "Named",
    "Prepared",
    "RestPart",
    "Standing",
    "assess",
    "beaten",
    "displaced",
    "doubted",
    "elusive",
    "groups_of",
    "is_overshadowed",
    "is_undecided",
    "prepare",
    "prepared_with",
    "price_of",
    "select",
    "smallest_of",
    "uneven",
    "unexplained",
    "unusual",
    "verdict",
    "wandering",
    "without_waves",
]
