"""Which other steps to look at when steps between two tags fail.

A step that meets something mostly has neighbours that meet it as well. Were each of them left to
the search it would try one after the other, and between two tags there are hundreds of thousands.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import BoolArray, IndexArray
from postproc.planning.search.cuts import judge, probed
from postproc.planning.search.free_path import Steps
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.planning.search.pose_search import PoseSearch

_OFTEN, _MANY = 4, 5000
"""Every so often so many of all steps between two tags are checked."""
_SWEPT, _LEAST = 5.0, 32
"""They are no longer than this together [m], but never fewer."""
_PROBED = 100_000
"""So many of them at most are looked at half way."""
_TURN = 45.0 * DEG
"""Where steps between two tags fail again, all steps that turn the tool by less are checked."""


def fan(search: PoseSearch, steps: Steps) -> tuple[Steps, Steps]:
    """Return the steps worth a check along with failing ones, and steps known to fail.

    Those that leave or enter the same states; where steps into a tag failed before, all that
    turn the tool by less than ``_TURN``. Of long ones many fail half way, and few are checked.
    None along with a cut over tags between: it costs too much.
    """
    more: set[tuple[int, int]] = set()
    known: Steps = []
    for a, b in steps:
        rung = int(search.states.tag_of(np.array([b]))[0])
        tag = int(search.tags[rung])
        if tag - search.tags[rung - 1] > 1:
            continue
        search.fanned[tag] = search.fanned.get(tag, 0) + 1
        before = np.arange(search.states.offsets[rung - 1], search.states.offsets[rung])
        now = np.arange(search.states.offsets[rung], search.states.offsets[rung + 1])
        if search.fanned[tag] == 1:
            to, start = now[_open(search, now, b, a)], before[_open(search, before, a, b)]
            leave = np.column_stack([np.full(len(to), a), to])
            pairs = np.concatenate([leave, np.column_stack([start, np.full(len(start), b)])])
            few = _few(search, tag, pairs)
        elif search.fanned[tag] == 2 or search.fanned[tag] % _OFTEN == 0:
            pairs = _all_steps(search, before, now)
            few = _few(search, tag, pairs, _TURN * (search.fanned[tag] == 2))
        else:
            continue
        more.update(few[0])
        known += few[1]
    return sorted(more.difference(steps, known)), known


def _few(search: PoseSearch, tag: int, pairs: IndexArray, most: float = 0.0) -> tuple[Steps, Steps]:
    """Return the steps to a tag, of some (k, 2), worth a check, and those known to fail.

    Those that turn the tool least and were not looked at before: ``_MANY`` by the joints alone,
    fewer of long ones all along. ``most`` [rad]: only those that turn it no farther, 0: all.
    """
    turn = np.abs(search.states.spin_of(pairs[:, 1]) - search.states.spin_of(pairs[:, 0]))
    turn = np.minimum(turn, 2.0 * np.pi - turn)
    order = np.argsort(turn, kind="stable")
    if most:
        order = order[turn[order] <= most + 1e-9]
    pairs = pairs[order]
    pairs = pairs[~np.isin(_codes(search, pairs), search.looked_at.get(tag, ()))][:_PROBED]
    if not len(pairs):
        return [], []
    met = probed(search.checker, search.spans(pairs[:, 0], pairs[:, 1]))
    length = float(np.diff(search.between.way[[tag - 1, tag]])[0])
    count = int(min(_MANY, max(_LEAST, _SWEPT / max(length, 1e-6))))
    failing, rest = pairs[met], pairs[~met][:_MANY]
    if len(rest) > count:
        joints = replace(search.checker, scene=None)
        spans = search.spans(rest[:, 0], rest[:, 1])
        good = judge(joints, search.between, spans).good(len(rest))
        failing, rest = np.concatenate([failing, rest[~good]]), rest[good][:count]
    known = search.looked_at.get(tag, np.zeros(0, dtype=np.int64))
    fresh = _codes(search, np.concatenate([failing, rest]))
    search.looked_at[tag] = np.concatenate([known, fresh])
    return [(a, b) for a, b in rest.tolist()], [(a, b) for a, b in failing.tolist()]


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


def _all_steps(search: PoseSearch, before: IndexArray, now: IndexArray) -> IndexArray:
    """Return the steps (k, 2) that a chain may do from some states to others."""
    before = before[np.isfinite(search.ladder.cost[before])]
    now = now[np.isfinite(search.ladder.cost[now])]
    near = search.states.branch[now][:, None] == search.states.branch[before][None]
    for j in range(6):
        gap = np.subtract.outer(search.states.q[now, j], search.states.q[before, j])
        near &= np.abs(gap) <= np.pi
    to, start = np.nonzero(near)
    return np.column_stack([before[start], now[to]])
