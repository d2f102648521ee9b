"""Whether motions keep to what the CAM file says of their ends and of the speeds of axes.

The file may be kept to at the first or at the last motion that may be meant by a tag.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.controller import Blend
from postproc.errors import RunKind
from postproc.units import MM, PERCENT
from postproc.verification.cam.match import Match
from postproc.verification.report import Remark, Said, listed
from postproc.verification.run import Run

_SAME = 1e-3
"""Shares may differ by this share of them."""
_DIGITS = 1e-4 * MM
"""By so much [m] the digits of a text may lengthen an approximation."""


def check_approximation(run: Run, match: Match) -> Iterator[Said]:
    """Yield approximations that are longer than the file allows, or are none of its stops."""
    trace, tags = run.paths.trace, match.every
    reach = np.where(trace.blend == Blend.DISTANCE, trace.column("cdis"), np.inf)
    reach = np.where(trace.blend == Blend.THROUGH, _DIGITS, reach)
    reach = np.where(trace.blend == Blend.EXACT, 0.0, reach)
    allowed = np.asarray(tags.toolpath.largest_blend)
    rows = np.flatnonzero(np.isfinite(allowed) & (tags.first >= 0))
    least = np.minimum(reach[tags.first[rows]], reach[tags.last[rows]])
    most = np.where(allowed[rows] > 0.0, allowed[rows] * (1.0 + _SAME) + _DIGITS, 0.0)
    for place, more in listed(np.flatnonzero(least > most), "tags"):
        row, way = int(rows[place]), float(least[place])
        limit = f"{allowed[row] / MM:g} mm at most" if allowed[row] else "an exact stop"
        text = f"{tags.name(row)}: {_way(way)}, the CAM file asks for {limit}{more}"
        yield Remark(RunKind.APPROXIMATION, int(tags.first[row]), text)


def _way(reach: float) -> str:
    if np.isinf(reach):
        return "approximated by nobody knows how much"
    return "passed without a stop" if reach == _DIGITS else f"approximated by {reach / MM:g} mm"


def check_joint_speeds(run: Run, match: Match) -> Iterator[Said]:
    """Yield joint motions that are faster than the file allows."""
    trace, tags = run.paths.trace, match.every
    moves = ~trace.is_cp & ~run.paths.stands
    share = np.array([max(item.ptp) for item in trace.settings] or [0.0])[trace.setting]
    asked = np.asarray(tags.toolpath.joint_fraction)
    rows = np.flatnonzero(np.isfinite(asked) & (tags.first >= 0))
    before = np.append(-1, np.maximum.accumulate(tags.last))[rows].tolist()
    fastest = np.array(
        [
            _fastest(share, moves, last + 1, int(tags.first[row]))
            for row, last in zip(rows.tolist(), before, strict=True)
        ],
        dtype=np.int64,
    )
    bad = (fastest >= 0) & (share[fastest] > asked[rows] * (1.0 + _SAME))
    for place, more in listed(np.flatnonzero(bad), "tags"):
        row, motion = int(rows[place]), int(fastest[place])
        text = f"a joint motion at {share[motion] / PERCENT:g} %, the CAM file asks for "
        text += f"{asked[row] / PERCENT:g} % at most{more}"
        yield Remark(RunKind.SPEED, motion, f"{tags.name(row)}: {text}")


def _fastest(share: FloatArray, moves: BoolArray, first: int, last: int) -> int:
    """Return the fastest of the joint motions ``first`` to ``last``, -1 if there is none."""
    own = first + np.flatnonzero(moves[first : last + 1])
    return int(own[share[own].argmax()]) if len(own) else -1
