"""Which side of its gear each joint is on at the points of a program, as compensation takes it.

Where a joint turns back while the tool cuts, its gear needs the other command at once: a step in
the path. The command swings over instead, as fast as the path may bend. While a gear crosses its
gap the link stands still, whatever the motor does. So the tool misses what comes of the swing
before the turn, and behind it the way of the joint until the gear has crossed. The swing begins
where the larger of both is least: at the turn where the joint turns gently, half of it before where
it turns sharply. The tool is never farther off than without compensation.

At the start of a cut the tool stands: there the gear crosses at once, and the cut begins on the
side that it goes on (``starts``).
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, forward_filled
from postproc.paths import Paths, directions
from postproc.records import dataclass

_FAR = 1e3
_EARLY = np.linspace(0.0, 1.0, 33)


@dataclass(frozen=True, slots=True)
class Sides:
    """At r places of a run the side (r, 6), -1 to 1, as a motion arrives and as the next leaves.

    They differ where a cut starts. 0 before the first motion.
    """

    arriving: FloatArray
    leaving: FloatArray


def sides_of(
    paths: Paths,
    cuts: AnyIntArray,
    starts: AnyIntArray,
    row: AnyIntArray,
    share: FloatArray,
    reach: FloatArray,
    lost: FloatArray,
) -> Sides:
    """Return the sides at places (motion, share) of a run.

    Cuts that follow each other are one stretch, but for those at whose ends it ``starts`` anew.
    ``reach`` (r,): way [m] in which a command goes from the middle of a gear to its side; ``lost``
    (6,): way [rad] of each joint from one side of its gear to the other.
    """
    samples = paths.in_order()
    q = forward_filled(samples.q)
    is_cut = np.isin(samples.row, cuts)
    side = _last_sign(np.sign(directions(q)))
    least = _last_sign(np.sign(directions(q, np.zeros(6))))
    step = np.linalg.norm(np.diff(samples.point, axis=0, prepend=samples.point[:1]), axis=1)
    along = np.cumsum(np.nan_to_num(step))
    place, asked = samples.row + samples.share, row + share
    order = np.argsort(asked, kind="stable")
    R = np.interp(place, asked[order], np.maximum(reach, 1e-9)[order])
    # a hole is drilled at rest: there a joint is on the side of its least motion
    arriving = np.where(is_cut[:, None], side, least)
    leaving = arriving.copy()
    border = ~is_cut | (np.isin(samples.row, starts) & (samples.share == 1.0))
    for start, end in _stretches(is_cut, border):
        own, inner = slice(start, end + 1), slice(start + 1, end + 1)
        for joint in range(6):
            turns = _turns(q[own, joint], side[own, joint])
            if turns:
                now = _swung(along[own], q[own, joint], turns, R[own], float(lost[joint]))
                leaving[start, joint] = now[0]
                arriving[inner, joint] = leaving[inner, joint] = now[1:]
        leaving[end] = side[end] if border[end] else leaving[end]
    at = np.minimum(np.searchsorted(place, asked), len(place) - 1)
    return Sides(arriving[at], leaving[at])


def _last_sign(sign: FloatArray) -> FloatArray:
    """Return signs (k, 6) with the one before in place of a 0."""
    rows = np.arange(len(sign))[:, None]
    last = np.maximum.accumulate(np.where(sign != 0.0, rows, 0), axis=0)
    return np.take_along_axis(sign, last, axis=0)


def _stretches(is_cut: BoolArray, border: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last samples of stretches; the first is where the tool stands before."""
    found = []
    for start in np.flatnonzero(border[:-1] & is_cut[1:]).tolist():
        behind = np.flatnonzero(border[start + 1 :])
        last = start + 1 + int(behind[0]) if len(behind) else len(border) - 1
        found.append((start, last if is_cut[last] else last - 1))
    return found


def _turns(q: FloatArray, side: FloatArray) -> list[tuple[int, float]]:
    """Return where a joint (k,) turns back, at its farthest point, and its side from there."""
    found, before = [], 0
    for shown in (np.flatnonzero(side[1:] != side[:-1]) + 1).tolist():
        begun = before + int(np.argmax(side[shown - 1] * q[before : shown + 1]))
        found.append((begun if side[shown - 1] else 0, float(side[shown])))
        before = shown
    return found


def _swung(
    along: FloatArray, q: FloatArray, turns: list[tuple[int, float]], reach: FloatArray, lost: float
) -> FloatArray:
    """Return the side (k,) that swings over at turns, along a stretch (k,) [m] of a joint (k,)."""
    value, to, R, x = -turns[0][1], -turns[0][1], 1.0, -np.inf
    knots = [(along[0] - _FAR, value)]
    for begun, side in turns:
        if begun == 0:
            value = to = side
            knots = [(along[0] - _FAR, value)]
            continue
        # begun by w of the reach before the turn, w of half the gap is missed there; behind it, as
        # much is if the joint has moved by that when the gear has crossed
        crossed = along[begun] + 2.0 * (1.0 - _EARLY) * reach[begun]
        moved = np.abs(np.interp(crossed, along, q) - q[begun])
        early = _EARLY[np.argmax(_EARLY * 0.5 * lost >= moved)]
        start = max(along[begun] - early * reach[begun], x)
        if x > -np.inf:
            done = x + R * abs(to - value)
            value = to if done <= start else value + np.sign(to - value) * (start - x) / R
            knots += [(done, to)] if done <= start else []
        knots.append((start, value))
        to, R, x = side, float(reach[begun]), start
    if x > -np.inf:
        knots.append((x + R * abs(to - value), to))
    places, values = np.array(knots).T
    return np.asarray(np.interp(along, places, values))
