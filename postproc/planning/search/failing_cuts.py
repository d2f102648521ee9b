"""What becomes of cuts between key tags that fail inside: gone round, or given more key tags.

The best way along an obstacle turns the tool no earlier than it must. Between two key tags that is
mostly too late for some of the tags inside; turned one key tag earlier it costs next to nothing. So
such a cut is taken out first. Only where the way found instead is dear, or where cuts fail over and
over, tags inside become key tags: there the way may be too narrow for turns between far key tags.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from postproc.arrays import BoolArray, IndexArray
from postproc.planning.checks import Reason
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import Judged, Spans
from postproc.records import dataclass

_ALL = 8
"""All tags inside a cut of no more become key tags."""
SHORT = 0.05
"""A longer cut [m] is not taken out: its key tags are to stay as they are."""
_TRIES, _NEAR = 8, 0.06
"""Where so many cuts were taken out within so much way [m], key tags are added."""


@dataclass(slots=True)
class FailingCuts:
    """Cuts between key tags that failed inside.

    ``longest`` [m]: no longer ones are taken out. ``wanted``: tags that would have to be key tags
    for a cut to be run; ``places`` [m]: where cuts were taken out.
    """

    between: Interpolation
    longest: float = SHORT
    wanted: set[int] = field(default_factory=set)
    places: list[float] = field(default_factory=list)

    def taken_out(self, spans: Spans, judged: Judged) -> BoolArray:
        """Return which of spans (m,) that fail are to be taken out; notes what others want."""
        result = ~judged.good(len(spans))
        way, bad = self.between.way, np.flatnonzero(judged.reason != Reason.NONE)
        places = np.array(self.places)
        for i in np.flatnonzero(result & (spans.last - spans.first > 1)).tolist():
            first, last = int(spans.first[i]), int(spans.last[i])
            near = np.abs(places - way[last]) < _NEAR
            is_short = way[last] - way[first] <= self.longest and self.between.is_cut[last]
            if is_short and near.sum() < _TRIES:
                self.places.append(float(way[last]))
            else:
                rows = bad[slice(*np.searchsorted(judged.rows.span[bad], [i, i + 1]))]
                self.wanted |= _inside(first, last, judged.rows.tag[rows])
                result[i] = False
        return result


def _inside(first: int, last: int, bad: IndexArray) -> set[int]:
    """Return some of the tags (k,) at which a span fails, or tags beside them."""
    if last - first <= _ALL:
        return set(range(first + 1, last))
    wish = {int(bad[0]) - 1, int(bad[0]), int(bad[len(bad) // 2]), int(bad[-1])}
    return {at for at in wish if first < at < last} or {(first + last) // 2}
