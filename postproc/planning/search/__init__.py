"""The best sequence of states."""

from postproc.planning.search.between import Interpolation
from postproc.planning.search.constants import DEFAULT_BOUND, TIE_TRAVEL
from postproc.planning.search.edges import best_of
from postproc.planning.search.keytags import (
    arc_length,
    dense_key_tags,
    key_tags,
    spaced,
    stretches,
)
from postproc.planning.search.laps import searched
from postproc.planning.search.loss import (
    LOST,
    along,
    best_index,
    least_index,
    loss_of,
    loss_report,
    more_keys,
)
from postproc.planning.search.pose_search import PoseSearch, grown, travel, with_options
from postproc.planning.search.refinement import Refinement
from postproc.planning.search.roll import main_spins, without_roll
from postproc.planning.search.round_spins import between_round, on_round_spins
from postproc.planning.search.rungs import (
    Parted,
    SearchOptions,
    step_rules,
    with_gaps,
)
from postproc.planning.search.sequence import ordered, ordered_by_place
