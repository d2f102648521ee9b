"""Where a search must look closer before it may say that something cannot be run.

A cut that fails between key tags and cannot be gone round gets key tags where it fails. Where no
way is left on the grid, all tags around the break become key tags, and their spins are searched in
the finest steps. What is still without a way is refuted then, in a cut that is no longer: every
spin of the finest grid, in every branch, at every tag. So is where the best sequence leads from tag
to tag as no free path was found to.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from postproc.arrays import IndexArray
from postproc.ladder import NONE
from postproc.planning.search.between import Interpolation
from postproc.planning.search.constants import MOST_REFINED, MOST_STATES
from postproc.planning.search.pose_search import PoseSearch
from postproc.records import dataclass

_AROUND = 300
"""So many tags to each side of a break are searched on the finest grid of spins."""


@dataclass(slots=True)
class Refinement:
    """Where the search looks closer, and the tags at which it ``gave_up``."""

    between: Interpolation
    gave_up: set[int] = field(default_factory=set)

    def next(self, search: PoseSearch) -> tuple[IndexArray, IndexArray]:
        """Return tags to take as key tags, and the stride of each; none if all is said."""
        n = len(self.between.way)
        stride = np.zeros(n, dtype=np.int64)
        stride[search.tags] = search.keys.stride
        asked = np.zeros(n, dtype=np.int64)
        base = search.checker.problem.fine
        wanted = search.failing.wanted
        for tag in wanted:
            asked[tag] = base
        if not wanted:
            self._around_empties(search, asked, base)
            self._around_breaks(search, asked)
            self._around_gaps(search, asked)
        more = (asked > 0) & ((stride == 0) | (asked < stride))
        tags = np.flatnonzero(more)
        if len(tags) and len(search.states.q) > MOST_STATES:
            self.gave_up |= set(self._open(search).tolist())
            tags = tags[:0]
        return tags, asked[tags]

    def _open(self, search: PoseSearch) -> IndexArray:
        """Return the tags at which something is not refuted but not found either."""
        rungs = np.flatnonzero(search.broken | (search.found.path == NONE))
        wanted = search.failing.wanted
        return np.concatenate([search.tags[rungs], np.array(sorted(wanted), dtype=np.int64)])

    def _around_empties(self, search: PoseSearch, asked: IndexArray, base: int) -> None:
        """Ask for the finest grid at tags without a pose, and for the tags beside them."""
        given = search.checker.problem.placement.given
        rows = np.flatnonzero((search.found.path == NONE) & given[search.tags] & ~search.pinned)
        asked[search.tags[rows[:MOST_REFINED]]] = 1
        last = len(search.tags) - 1
        for row in np.flatnonzero(search.found.path == NONE).tolist():
            low, high = search.tags[max(row - 1, 0)], search.tags[min(row + 1, last)]
            inside = np.arange(low + 1, high)
            asked[inside] = np.where(asked[inside] == 0, base, asked[inside])

    def _around_gaps(self, search: PoseSearch, asked: IndexArray) -> None:
        """Ask for the finest grid at tags that no free path joins, but none else is."""
        into = np.flatnonzero(search.ladder.tolls_on(search.found.path) > 0.0)
        both = np.union1d(into - 1, into)
        asked[search.tags[both[~search.pinned[both]]]] = 1

    def _around_breaks(self, search: PoseSearch, asked: IndexArray) -> None:
        """Ask for all tags around the breaks of cuts, and for the finest spins there."""
        chain = np.cumsum(~self.between.is_cut)
        for tag in search.tags[search.broken].tolist():
            low, high = np.searchsorted(chain, chain[tag] + np.arange(2)).tolist()
            window = np.arange(max(low, tag - _AROUND), min(high, tag + _AROUND + 1))
            asked[window] = 1
            at = np.searchsorted(search.tags, window)
            known = search.tags[np.minimum(at, len(search.tags) - 1)] == window
            if len(window) < high - low and known.all() and (search.keys.stride[at] == 1).all():
                self.gave_up.add(tag)
