"""The best sequence of states."""

from postproc.planning.search.external_axes import plan_with_external_axes, travel_moves
from postproc.planning.search.keytags import arc_length, key_tags
from postproc.planning.search.roll import without_roll
from postproc.planning.search.rungs import step_rules
from postproc.planning.search.sequence import ordered, ordered_by_place
from postproc.planning.search.strategy import choose

__all__ = [
    "arc_length",
    "choose",
    "key_tags",
    "ordered",
    "ordered_by_place",
    "plan_with_external_axes",
    "step_rules",
    "travel_moves",
    "without_roll",
]
