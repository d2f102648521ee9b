"""Whether what cuts has the feed of the CAM file, and motions the ends and axis speeds it says.

Ends and axis speeds may be kept to at the first or at the last motion that may be meant by a tag.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.controller import Blend
from postproc.errors import RunKind, Severity
from postproc.paths import feed_shares
from postproc.process import FEED_OUT, LEAST_SHARE, LOWERED_FROM, LOWERED_TO, TAPS, feeds_of
from postproc.units import MM, MM_PER_MIN, PERCENT
from postproc.verification.cam.drilled import NEAR
from postproc.verification.cam.match import Match
from postproc.verification.report import Measure, Remark, Said, listed
from postproc.verification.run import Run

FEED_TOLERANCE = 1e-3
"""Share by which a feed may differ from the file's."""


def check_feeds(run: Run, match: Match) -> Iterator[Said]:
    """Measure the worst feed and yield the wrong ones; that of a tap is bound to its spindle."""
    toolpath = match.tags.toolpath
    rows, motions = _fed(run, match)
    wanted = feeds_of(toolpath, run.cell)[rows]
    known = np.isfinite(wanted) & (wanted > 0.0)
    rows, motions, wanted = rows[known], motions[known], wanted[known]
    if not len(motions):
        return
    have = run.paths.trace.column("speed")[motions]
    error = np.abs(have / wanted - 1.0)
    row = int(error.argmax())
    yield Measure("feed", float(error[row] * 100.0), "%", int(motions[row]))
    taps = np.array([*(cycle.kind in TAPS for cycle in toolpath.cycles), False])
    bad = np.flatnonzero(error > FEED_TOLERANCE)
    share = have[bad] / wanted[bad]
    may = ~taps[np.asarray(toolpath.cycle)[rows[bad]]]
    may &= share >= run.cell.process.least_feed * (1.0 - FEED_TOLERANCE)
    forced = may & _forced(run, motions[bad], share)
    slowed = may & ~forced & match.may_slow & (share < 1.0)
    slowed &= share >= LEAST_SHARE * (1.0 - FEED_TOLERANCE)
    for some, severity, why in (
        (bad[forced], Severity.WARNING, ": an axis could not follow"),
        (bad[slowed], Severity.WARNING, ": the real tool would leave its path"),
        (bad[~forced & ~slowed], Severity.ERROR, ""),
    ):
        for place, more in listed(some, "motions", error):
            text = f"{have[place] / MM_PER_MIN:.2f} mm/min, the CAM file asks for "
            text += f"{wanted[place] / MM_PER_MIN:.2f} mm/min{more}{why}"
            yield Remark(RunKind.FEED, int(motions[place]), text, severity)


def _fed(run: Run, match: Match) -> tuple[AnyIntArray, AnyIntArray]:
    """Return tags (k,), and the motions (k,) that must have the feed of each."""
    ways, toolpath = match.ways, match.tags.toolpath
    is_cp = run.paths.trace.is_cp
    behind = ways.behind[is_cp[match.tags.first[ways.behind]]]
    rows = np.concatenate([ways.open, behind, ways.direct])
    own = [(row, done.covered) for row, done in ways.followed.items()]
    near = NEAR * match.tolerances.position
    for row, hole in match.holes.items():
        is_fed_out = toolpath.cycles[int(toolpath.cycle[row])].kind in FEED_OUT
        high = float(match.tags.wanted.clear[row] + match.tags.wanted.depth[row]) - near
        out = hole.way_out(high) if is_fed_out else ()
        own.append((row, (*hole.drilled, *hole.again, *out)))
    others = np.array([row for row, motions in own for _ in motions], dtype=np.int64)
    covered = np.array([motion for _, motions in own for motion in motions], dtype=np.int64)
    return np.concatenate([rows, others]), np.concatenate([match.tags.first[rows], covered])


def _forced(run: Run, motions: AnyIntArray, share: FloatArray) -> BoolArray:
    """Return which motions (b,) are slow because an axis could not follow the asked feed."""
    paths = run.paths
    needed = np.zeros(len(paths))
    if len(motions) and len(paths.row):
        np.maximum.at(needed, paths.row, feed_shares(paths, run.cell).max(axis=1))
    now = needed[motions]
    return (share < 1.0) & (now > LOWERED_FROM * share) & (now > LOWERED_TO)


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
        return "approximated by an unknown amount"
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
