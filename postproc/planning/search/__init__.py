"""The best sequence of states."""

from postproc.planning.search.hunt import step_rules
from postproc.planning.search.keytags import arc_length, key_tags
from postproc.planning.search.sequence import ordered, ordered_by_place
from postproc.planning.search.station import plan_stations
from postproc.planning.search.strategy import choose

__all__ = [
    "arc_length",
    "choose",
    "key_tags",
    "ordered",
    "ordered_by_place",
    "plan_stations",
    "step_rules",
]
