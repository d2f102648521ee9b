"""Whether holes are drilled as the cycle says: down the axis, to the depth, and out again.

The tool must come down the hole's axis from the clearance height in the pecks of its cycle, stop
exactly at the bottom, wait there as asked, and leave along the axis to the retract height. Only
what has been drilled may be entered faster than the feed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.controller import EventWord, Trace
from postproc.errors import RunKind
from postproc.geometry import angle_between
from postproc.units import DEG, MM
from postproc.verification.cam.drilled import NEAR, Hole
from postproc.verification.cam.elements import ON_TOP
from postproc.verification.cam.match import Match
from postproc.verification.report import Remark, Said, few_of_each, listed
from postproc.verification.run import Run

DWELL_SHARE = 0.01
DWELL_SLACK = 1e-3
"""A dwell may differ by this share, and by so many seconds."""


def check_holes(run: Run, match: Match) -> Iterator[Said]:
    """Judge how every hole is drilled."""
    yield from few_of_each(_of_all(run, match))


def _of_all(run: Run, match: Match) -> Iterator[Remark]:
    trace, wanted, near = run.paths.trace, match.tags.wanted, NEAR * match.tolerances.position
    is_exact, dwells = trace.is_exact, _dwells(trace)
    moves = trace.is_cp | run.paths.stands
    for row, hole in match.holes.items():
        depth, clear = float(wanted.depth[row]), float(wanted.clear[row])
        if not is_exact[hole.bottom]:
            text = "the bottom of the hole is blended: not reached"
            yield Remark(RunKind.BLENDED_PLUNGE, hole.bottom, text)
        low = clear + depth - max((height for _, height in hole.down), default=0.0)
        if low > near:
            text = f"the tool comes onto the hole's axis {low / MM:.3f} mm too low"
            yield Remark(RunKind.PLUNGE, hole.bottom, text)
        low = depth + float(wanted.retract[row] or clear)
        low -= max((height for _, height in hole.out), default=0.0)
        if low > near:
            text = f"the tool leaves the hole's axis {low / MM:.3f} mm too low"
            yield Remark(RunKind.RETRACT, min(hole.bottom + 1, len(trace) - 1), text)
        yield from _inside(hole, clear + depth, near, moves.tolist())
        for motion in hole.drilled:
            if not is_exact[motion - 1]:
                text = "the point before a plunge is blended"
                yield Remark(RunKind.BLENDED_PLUNGE, motion - 1, text)
        if np.isfinite(wanted.peck_first[row]):
            yield from _steps(match, row, hole, near)
        have, asked = dwells.get(hole.bottom, 0.0), float(wanted.dwell[row])
        if abs(have - asked) > max(DWELL_SHARE * asked, DWELL_SLACK) and asked > 0.0:
            text = f"{have:g} s at the bottom, the CAM file asks for {asked:g} s"
            yield Remark(RunKind.DWELL, hole.bottom, text)


def _dwells(trace: Trace) -> dict[int, float]:
    """Return the seconds waited behind each motion."""
    found: dict[int, float] = {}
    for event in trace.events:
        if event.word is EventWord.DWELL:
            found[event.motion - 1] = found.get(event.motion - 1, 0.0) + event.value
    return found


def _inside(hole: Hole, clear: float, near: float, moves: list[bool]) -> Iterator[Remark]:
    """Yield the first motion below the clearance height that is not along the axis."""
    for number, height in enumerate(hole.heights):
        motion = number + hole.offset
        if motion == hole.first or height is None:
            continue
        if height < -near:
            text = f"the tool goes {-height / MM:.3f} mm deeper than the hole"
            yield Remark(RunKind.DEPTH, motion, text)
            return
        if not height < clear - near:
            continue
        for way, other in ((motion, number - 1), (motion + 1, number + 1)):
            known = 0 <= other < len(hole.heights)
            if known and (hole.heights[other] is None or not moves[way]):
                text = f"the tool moves sideways {(clear - height) / MM:.3f} mm deep"
                yield Remark(RunKind.PLUNGE, way, text)
                return


def _steps(match: Match, row: int, hole: Hole, near: float) -> Iterator[Remark]:
    """Check that what is drilled at once is what the cycle orders, and chips get out."""
    wanted, heights = match.tags.wanted, dict(hole.down)
    depth, step = float(wanted.depth[row]), float(wanted.peck_first[row])
    before, last = 0.0, -1
    for motion in hole.drilled:
        now = depth - heights.get(motion, 0.0)
        if now <= near:
            continue
        asked = min(before + step, depth)
        is_less = now < asked - near and step > 2.0 * near
        if now > asked + near or is_less:
            order = f"the cycle orders {(asked - before) / MM:.3f}"
            yield Remark(RunKind.PECK, motion, f"{(now - before) / MM:.3f} mm at once, {order}")
        if last >= 0:
            up = max(heights.get(vertex, 0.0) for vertex in range(last, motion))
            high = depth + float(wanted.clear[row]) - near
            if up < (depth - before + near if wanted.break_chip[row] else high):
                text = "the tool does not come up before the next peck"
                yield Remark(RunKind.PECK, motion, text)
        before, step, last = now, float(wanted.peck[row]), motion


def check_strokes(run: Run, match: Match) -> Iterator[Said]:
    """Check both ends of every motion along the axis of a hole that is not all above it.

    A motion that only begins or ends in the hole turns the tool in it as well.
    """
    real, wanted = match.real, match.tags.wanted
    motion = np.flatnonzero(match.uses.on_axis >= 0)
    row = match.uses.on_axis[motion]
    ends = np.stack([motion - 1, motion])
    from_top = wanted.top[row] - real.end_point[real.case[row], ends]
    height = np.einsum("kij,ij->ki", from_top, wanted.axis[row])
    side = np.linalg.norm(from_top - height[..., None] * wanted.axis[row], axis=2)
    off = angle_between(run.paths.end_axis[ends], wanted.axis[row])
    inside = height.min(axis=0) < wanted.clear[row] - ON_TOP - match.shift
    for kind, values, most, unit, text in (
        (RunKind.AXIS, off, match.tolerances.axis, DEG, "tilted by {:.4f} deg in the hole"),
        (RunKind.PATH, side, match.path_tolerance, MM, "{:.4f} mm off the axis of the hole"),
    ):
        worst = values.max(axis=0)
        for place, more in listed(np.flatnonzero(inside & (worst > most)), "motions", worst):
            words = f"the tool is {text.format(worst[place] / unit)}{more}"
            yield Remark(kind, int(motion[place]), words)
