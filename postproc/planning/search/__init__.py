"""The best sequence of states."""

from postproc.planning.search.between import cubic, slopes
from postproc.planning.search.edges import best_of
from postproc.planning.search.keytags import arc_length, key_tags, spaced
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.search.rungs import Parted, step_rules
from postproc.planning.search.sequence import ordered, ordered_by_place
from postproc.planning.search.strategy import Choice, choose

__all__ = [
    "Choice",
    "Parted",
    "PoseSearch",
    "arc_length",
    "best_of",
    "choose",
    "cubic",
    "key_tags",
    "ordered",
    "ordered_by_place",
    "slopes",
    "spaced",
    "step_rules",
]
