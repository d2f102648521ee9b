"""Which other steps to look at when steps between two tags fail.

A step that meets something mostly has neighbours that meet it as well. Were each of them left to
the search it would try one after the other, and between two tags there are hundreds of thousands.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import BoolArray, IndexArray
from postproc.planning.checks import LONG_WAY
from postproc.planning.search.cuts import judge, probed
from postproc.planning.search.free_path import Steps

if TYPE_CHECKING:
    from postproc.planning.search.pose_search import PoseSearch

_OFTEN, _MANY = 4, 5000
"""Every so often so many of all steps between two tags are checked."""
_SWEPT, _LEAST = 5.0, 32
"""They are no longer than this together [m], but never fewer."""
_PROBED = 100_000
"""So many of them at most are looked at half way ..."""
_AT_FIRST = 5000
"""... so many of these at once, twice as many where too few of them pass."""


def fan(search: PoseSearch, steps: Steps) -> tuple[Steps, Steps]:
    """Return the steps worth a check along with failing ones, and steps known to fail.

    Those that leave or enter the same states; where steps into a tag failed before, the cheapest
    of all: those that the search would try next. Of long ones many fail half way, and few are
    checked. None along with a cut over tags between: it costs too much.
    """
    more: set[tuple[int, int]] = set()
    known: Steps = []
    for a, b in steps:
        rung = int(search.states.tag_of(np.array([b]))[0])
        tag = int(search.tags[rung])
        if tag - search.tags[rung - 1] > 1:
            continue
        search.fanned[tag] = search.fanned.get(tag, 0) + 1
        if search.fanned[tag] == 1:
            few = _few(search, tag, _beside(search, rung, a, b))
        elif search.fanned[tag] == 2 or search.fanned[tag] % _OFTEN == 0:
            few = _few(search, tag, search.ladder.cheapest(rung, _PROBED))
        else:
            continue
        more.update(few[0])
        known += few[1]
    return sorted(more.difference(steps, known)), known


def _beside(search: PoseSearch, rung: int, a: int, b: int) -> IndexArray:
    """Return the steps (k, 2) that leave a state or enter another, the least turn first."""
    before = np.arange(search.states.offsets[rung - 1], search.states.offsets[rung])
    now = np.arange(search.states.offsets[rung], search.states.offsets[rung + 1])
    to, start = now[_open(search, now, b, a)], before[_open(search, before, a, b)]
    leave = np.column_stack([np.full(len(to), a), to])
    pairs = np.concatenate([leave, np.column_stack([start, np.full(len(start), b)])])
    turn = np.abs(search.states.spin_of(pairs[:, 1]) - search.states.spin_of(pairs[:, 0]))
    return pairs[np.argsort(np.minimum(turn, 2.0 * np.pi - turn), kind="stable")]


def _few(search: PoseSearch, tag: int, pairs: IndexArray) -> tuple[Steps, Steps]:
    """Return the steps to a tag, of some (k, 2), worth a check, and those known to fail.

    The first ones that were not looked at before: ``_MANY`` by the joints alone, fewer of long ones
    all along.
    """
    pairs = pairs[~np.isin(_codes(search, pairs), search.looked_at.get(tag, ()))]
    if not len(pairs):
        return [], []
    length = float(np.diff(search.between.way[[tag - 1, tag]])[0])
    count = int(min(_MANY, max(_LEAST, _SWEPT / max(length, 1e-6))))
    failing, rest = pairs[:0], pairs[:_MANY]
    if length > LONG_WAY:
        failing, rest = _half_way(search, pairs, count)
    if len(rest) > count:
        joints = replace(search.checker, scene=None)
        spans = search.spans(rest[:, 0], rest[:, 1])
        good = judge(joints, search.between, spans).good(len(rest))
        failing, rest = np.concatenate([failing, rest[~good]]), rest[good][:count]
    known = search.looked_at.get(tag, np.zeros(0, dtype=np.int64))
    fresh = _codes(search, np.concatenate([failing, rest]))
    search.looked_at[tag] = np.concatenate([known, fresh])
    return [(a, b) for a, b in rest.tolist()], [(a, b) for a, b in failing.tolist()]


def _half_way(search: PoseSearch, pairs: IndexArray, count: int) -> tuple[IndexArray, IndexArray]:
    """Return the first steps of some (k, 2) that fail half way, and those that do not.

    So many that ``count`` of the latter are among them, as far as there are.
    """
    failing, rest, low, size = [pairs[:0]], [pairs[:0]], 0, _AT_FIRST
    while low < len(pairs) and sum(map(len, rest)) < count:
        some = pairs[low : low + size]
        met = probed(search.checker, search.spans(some[:, 0], some[:, 1]))
        failing.append(some[met])
        rest.append(some[~met])
        low, size = low + size, 2 * size
    return np.concatenate(failing), np.concatenate(rest)[:_MANY]


def _codes(search: PoseSearch, steps: IndexArray) -> IndexArray:
    """Return one number (k,) for each step (k, 2)."""
    return steps[:, 0] * int(search.states.offsets[-1]) + steps[:, 1]


def _open(search: PoseSearch, states: IndexArray, like: int, end: int) -> BoolArray:
    """Return which states a step with ``end`` may join, of the tilt of ``like``."""
    near = np.abs(search.states.q[states] - search.states.q[end]).max(axis=1) <= np.pi
    near &= np.isfinite(search.ladder.cost[states])
    width = search.states.spins.shape[-1]
    near &= search.states.column[states] // width == search.states.column[like] // width
    return np.asarray(near & (search.states.branch[states] == search.states.branch[like]))
