"""Poses, steps and cuts that fail: which others to look at, what is taken out, why none leads on.

A pose that collides mostly has neighbours that collide as well, and so has a step. Were each of
them left to the search it would try one after the other, and between two tags there are hundreds of
thousands of steps.

The best way along an obstacle turns the tool no earlier than it must. Between two key tags that is
mostly too late for some of the tags inside; turned one key tag earlier it costs next to nothing. So
a cut that fails inside is taken out first. Only where the way found instead is dear, or where cuts
fail over and over, tags inside become key tags.

Where no cut leads on, the poses before it are carried on without a turn of the tool about its axis:
every turn was refuted, what stops the tool without one is what a person can change.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered
from postproc.ladder import Failing, Steps
from postproc.planning.checks import Break, Reason
from postproc.planning.search.between import Interpolation
from postproc.planning.search.constants import (
    ALIKE,
    ALL_INSIDE,
    ALONG,
    CARRIED_ON,
    LEAST_LOOKED_AT,
    MOST_LOOKED_AT,
    MOSTLY,
    OFTEN,
    SHORT,
    TAKEN_OUT,
    TAKEN_WITHIN,
)
from postproc.planning.search.cuts import Judged, Spans, judge
from postproc.planning.states import BRANCHES, States, beside_in_grid
from postproc.records import dataclass
from postproc.units import TURN

if TYPE_CHECKING:
    from postproc.planning.search.pose_search import PoseSearch


SEEN = 2
"""The bit of ``Known.asked`` for poses of which it is known whether they collide."""
_FLIP = 4
"""The bit of a branch that turns the wrist over: the arm before it and the tool stand alike."""


@dataclass(slots=True)
class FailingCuts:
    """Steps that failed, and cuts between key tags that failed inside.

    ``longest`` [m]: no longer ones are taken out. ``wanted``: tags that would have to be key tags
    for a cut to be run; ``places`` [m]: where cuts were taken out. ``times``: how often steps into
    a tag failed; ``looked_at``: numbers of those that were looked at along with them.
    """

    between: Interpolation
    longest: float = SHORT
    wanted: set[int] = field(default_factory=set)
    places: list[float] = field(default_factory=list)
    times: Counter[int] = field(default_factory=Counter)
    looked_at: dict[int, IndexArray] = field(default_factory=dict)

    def taken_out(self, spans: Spans, judged: Judged) -> BoolArray:
        """Return which of spans (m,) that fail are to be taken out; notes what others want."""
        result = ~judged.good(len(spans))
        way, bad = self.between.way, np.flatnonzero(judged.reason != Reason.NONE)
        places = np.array(self.places)
        for i in np.flatnonzero(result & (spans.last - spans.first > 1)).tolist():
            first, last = int(spans.first[i]), int(spans.last[i])
            near = np.abs(places - way[last]) < TAKEN_WITHIN
            is_short = way[last] - way[first] <= self.longest and self.between.is_cut[last]
            if is_short and near.sum() < TAKEN_OUT:
                self.places.append(float(way[last]))
            else:
                rows = bad[slice(*np.searchsorted(judged.rows.span[bad], [i, i + 1]))]
                self.wanted |= _inside(first, last, judged.rows.tag[rows])
                result[i] = False
        return result


Suspects = list[tuple[int, IndexArray]]
"""Tags, and the steps (k, 2) to each that are still to be looked at."""


def also_failing(search: PoseSearch, steps: Steps, failing_of: Failing) -> Steps:
    """Return further steps that fail where some do.

    Of those that leave or enter the same states; where steps into a tag failed before, of those
    from poses alike to poses alike, and now and then of the cheapest of all: those that the search
    would try next. More and more of them while most fail, by the joints alone first. None along
    with a cut over tags between: it costs too much.
    """
    known: Steps = []
    suspects: Suspects = []
    for a, b in steps:
        rung = int(search.states.tag_of(np.array([b]))[0])
        tag = int(search.tags[rung])
        if tag - search.tags[rung - 1] > 1:
            continue
        search.failing.times[tag] += 1
        times, looked_at = search.failing.times[tag], search.failing.looked_at.get(tag, ())
        if times == 1:
            pairs = _beside(search, rung, a, b)
        elif times == 2 or times % OFTEN == 0:
            pairs = search.ladder.cheapest(rung, MOST_LOOKED_AT + len(looked_at))
        else:
            pairs = _alike(search, rung, a, b)
        pairs = pairs[~np.isin(_codes(search, pairs), looked_at)]
        suspects.append((tag, pairs[:MOST_LOOKED_AT]))
    size = LEAST_LOOKED_AT
    while suspects := [(tag, pairs) for tag, pairs in suspects if len(pairs)]:
        found, suspects = _look(search, suspects, size, failing_of)
        known += found
        size *= 2
    return known


def _look(
    search: PoseSearch, suspects: Suspects, size: int, failing_of: Failing
) -> tuple[Steps, Suspects]:
    """Look at the first steps to each tag; return those that fail, and what is left to look at.

    What most of them pass is not looked at any more.
    """
    parts = [pairs[:size] for _, pairs in suspects]
    some = np.concatenate(parts)
    joints = replace(search.checker, scene=None)
    spans = search.spans(some[:, 0], some[:, 1])
    good = judge(joints, search.between, spans).good(len(some))
    failing = _as_steps(some[~good])
    bad = {*failing, *failing_of(sorted(set(_as_steps(some[good]))))}
    left: Suspects = []
    for (tag, pairs), part in zip(suspects, parts, strict=True):
        fails = np.array([step in bad for step in _as_steps(part)])
        _note(search, tag, part)
        left.append((tag, pairs[size:] if fails.mean() > MOSTLY else part[:0]))
    return sorted(bad), left


def _beside(search: PoseSearch, rung: int, a: int, b: int) -> IndexArray:
    """Return the steps (k, 2) that leave a state or enter another, the least turn first."""
    before = np.arange(search.states.offsets[rung - 1], search.states.offsets[rung])
    now = np.arange(search.states.offsets[rung], search.states.offsets[rung + 1])
    to, start = now[_open(search, now, b, a)], before[_open(search, before, a, b)]
    leave = np.column_stack([np.full(len(to), a), to])
    pairs = np.concatenate([leave, np.column_stack([start, np.full(len(start), b)])])
    turn = np.abs(search.states.spin_of(pairs[:, 1]) - search.states.spin_of(pairs[:, 0]))
    return pairs[np.argsort(np.minimum(turn, TURN - turn), kind="stable")]


def _alike(search: PoseSearch, rung: int, a: int, b: int) -> IndexArray:
    """Return the steps (k, 2) from poses like one to poses like another, the most alike first."""
    ends = []
    for first, end in ((rung - 1, a), (rung, b)):
        states = np.arange(*search.states.offsets[[first, first + 1]])
        states = states[np.isfinite(search.ladder.cost[states])]
        states = states[search.states.branch[states] == search.states.branch[end]]
        off = np.abs(search.states.q[states] - search.states.q[end]).max(axis=1)
        ends.append((states[off <= ALIKE], off[off <= ALIKE]))
    (before, from_), (now, to) = ends
    pairs = np.column_stack([np.repeat(before, len(now)), np.tile(now, len(before))])
    off = np.maximum(from_[:, None], to[None]).ravel()
    pairs = pairs[np.argsort(off, kind="stable")]
    return pairs[search.ladder.is_in_reach(rung, *pairs.T)]


def _note(search: PoseSearch, tag: int, steps: IndexArray) -> None:
    """Note that steps (k, 2) to a tag were looked at."""
    known = search.failing.looked_at.get(tag, np.zeros(0, dtype=np.int64))
    search.failing.looked_at[tag] = np.concatenate([known, _codes(search, steps)])


def _as_steps(pairs: IndexArray) -> Steps:
    return [(a, b) for a, b in pairs.tolist()]


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


def _inside(first: int, last: int, bad: IndexArray) -> set[int]:
    """Return some of the tags (k,) at which a span fails, or tags beside them."""
    if last - first <= ALL_INSIDE:
        return set(range(first + 1, last))
    some = {int(bad[0]) - 1, int(bad[0]), int(bad[len(bad) // 2]), int(bad[-1])}
    return {at for at in some if first < at < last} or {(first + last) // 2}


def break_at(search: PoseSearch, row: int) -> Break:
    """Return what stops the poses before a key tag into which no cut leads."""
    states, problem = search.states, search.checker.problem
    before = np.arange(states.offsets[row - 1], states.offsets[row])
    before = before[np.isfinite(search.ladder.value[before])]
    before = before[np.unique(np.linspace(0, len(before) - 1, CARRIED_ON).astype(np.int64))]
    m = len(before)
    if search.ladder.is_given_up(row):  # others may lead on: nothing is proven
        return Break(m, {}, -1, 0.0, 0, 0.0)
    on_the_way = np.arange(int(search.tags[row - 1]) + 1, int(search.tags[row]) + 1)
    why = Reason(int(search.between.infeasible[on_the_way].max()))
    if m and why is not Reason.NONE:  # such a way may be endless
        return Break(m, {why: m}, -1, 0.0, 0, 0.0)
    first, last = (np.full(m, int(search.tags[at])) for at in (row - 1, row))
    attitude = states.attitude_of(before)
    onward = attitude.copy()
    onward[:, 0] = search.between.spin_of(last, attitude[:, 0] + search.between.carried[first])
    onward[~search.between.may_tilt[last], 1:] = 0.0
    if search.pinned[row]:
        onward[:, 0] = states.spin_of(np.full(m, states.offsets[row]))
    q, branch = states.q[before].astype(np.float64), states.branch[before].astype(np.int64)
    T, external = problem.placement.tcp(last, onward), problem.placement.external[last]
    q_last, _ = problem.solve(T, external, branch, q)
    spans = Spans(first, last, attitude, onward, q, q_last, branch)
    return _break_of(search, judge(search.checker, search.between, spans), m)


def _break_of(search: PoseSearch, judged: Judged, count: int) -> Break:
    bad = np.flatnonzero(judged.reason != Reason.NONE)
    bad = bad[np.unique(judged.rows.span[bad], return_index=True)[1]]
    reason, pairs = judged.reason[bad], judged.pair[bad]
    counts = {why: int((reason == why).sum()) for why in Reason if (reason == why).any()}
    pairs, times = np.unique(pairs[pairs >= 0], return_counts=True)
    over, axis = _over(search, judged.q[bad[reason == Reason.JOINT_LIMIT]])
    bent = np.abs(judged.q[bad[reason == Reason.SINGULAR], 4])
    return Break(
        count,
        counts,
        int(pairs[np.argmax(times)]) if len(pairs) else -1,
        over,
        axis,
        float(bent.max(initial=0.0)),
    )


def _over(search: PoseSearch, q: FloatArray) -> tuple[float, int]:
    """Return by how much the least of joints (k, 6) is beyond its limits [rad], and which axis.

    0 where none of them is: those broke a limit on their way.
    """
    arm = search.checker.problem.kinematics
    margin = search.checker.problem.cell.limits.joint_margin
    beyond = np.maximum(np.asarray(arm.q_min) + margin - q, q - np.asarray(arm.q_max) + margin)
    beyond = beyond[beyond.max(axis=1) > 0.0]
    if not len(beyond):
        return 0.0, 0
    least = int(np.argmin(beyond.max(axis=1)))
    return float(beyond[least].max()), int(np.argmax(beyond[least]))


def also_colliding(search: PoseSearch, failing: IndexArray) -> IndexArray:
    """Return states that fail along with others: their turn copies, and colliding neighbours.

    From every failing pose the check spreads over the poses around it (spin and tag, wrist turned
    over), without their strokes, until it has found the whole colliding region and its rim: the
    next best way would mostly run into the next pose of the same region. Poses in a window stand on
    no grid, and a few rounds lead out of what is so near to a free one.
    """
    states, known = search.states, search.known
    found = [failing[known.reason[failing] == Reason.COLLISION]]
    front = failing if search.options.window is None else failing[:0]
    while len(front):
        poses, likely = _around(search, front)
        fresh = known.asked[poses] & SEEN == 0
        poses, likely = poses[fresh], likely[fresh]
        known.asked[poses] |= SEEN
        tags, q = search.tags[states.tag_of(poses)], states.q[poses].astype(np.float64)
        verdict = search.checker.poses(tags, q, likely)
        fails = ~verdict.good
        front = poses[fails]
        known.reason[front], known.pair[front] = verdict.reason[fails], verdict.pair[fails]
        found.append(front)
    return _copies(search, np.concatenate(found))


def first_copies(states: States, at: IndexArray) -> IndexArray:
    """Return the first (m,) of the turn copies of states (m,)."""
    return np.asarray(np.searchsorted(states.config, states.config[at]))


def _copies(search: PoseSearch, at: IndexArray) -> IndexArray:
    """Return the turn copies of colliding states, with the reason noted for each."""
    config, first = search.states.config, first_copies(search.states, at)
    row, step = numbered(np.searchsorted(config, config[at], side="right") - first)
    copies = first[row] + step
    search.known.reason[copies] = Reason.COLLISION
    search.known.pair[copies] = search.known.pair[at[row]]
    return np.asarray(copies)


def _around(search: PoseSearch, at: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return one state (k,) of every configuration near to states, and by what one collides.

    Those of the same branch and tilt one spin and tag away, and of the same spin some tags away;
    those of the tilts next to it, and that with the wrist turned over.
    """
    states, fine = search.states, search.checker.problem.fine
    width, n = states.spins.shape[-1], len(states)
    own, tag = states.column[at].astype(np.int64), states.tag_of(at)
    branch, pair = states.branch[at].astype(np.int64), search.known.pair[at] + np.int64(1)
    tilt, spin = np.divmod(own, width)
    row, rung = _within(own * BRANCHES + branch, tag, ALONG, n)
    near, by = [_place(states, rung, own[row], branch[row])], [pair[row]]
    along, around = np.tile([-1, 0, 1], 2), np.repeat([-1, 1], 3)
    rung = tag[:, None] + along
    column = tilt[:, None] * width + (spin[:, None] + fine * around) % width
    inside = (rung >= 0) & (rung < n)
    near.append(_place(states, rung, column, branch[:, None])[inside])
    by.append(np.broadcast_to(pair[:, None], inside.shape)[inside])
    near.append(_place(states, tag, own, branch ^ _FLIP))
    by.append(pair)
    which, other = np.nonzero(beside_in_grid(states.tilts)[tilt])
    near.append(_place(states, tag[which], other * width + spin[which], branch[which]))
    by.append(pair[which])
    kinds = int(pair.max(initial=0)) + 1
    both = np.sort(np.concatenate(near) * kinds + np.concatenate(by))
    wanted, likely = np.divmod(both, kinds)
    last = np.append(wanted[1:] != wanted[:-1], True)
    wanted, likely = wanted[last], likely[last] - 1
    found = np.minimum(np.searchsorted(search.places, wanted), len(search.places) - 1)
    known = search.places[found] == wanted
    return found[known], likely[known]


def places_of(states: States) -> IndexArray:
    """Return ``_place`` (N,) of all states, in place: there are millions."""
    places = np.repeat(np.arange(len(states)), np.diff(states.offsets))
    places *= states.spins.shape[-1] * len(states.tilts)
    places += states.column
    places *= BRANCHES
    places += states.branch
    return places


def _place(states: States, rung: IndexArray, column: IndexArray, branch: IndexArray) -> IndexArray:
    """Return numbers of configurations that rise with rung, then column, then branch."""
    width = states.spins.shape[-1] * len(states.tilts)
    return np.asarray((rung * width + column) * BRANCHES + branch)


def _within(line: IndexArray, at: IndexArray, far: int, n: int) -> tuple[IndexArray, IndexArray]:
    """Return what lies within ``far`` of places (m,) of n on lines (m,), each once.

    By which of the places (k,) it is near, and where on the line of that (k,).
    """
    order = np.lexsort((at, line))
    at, line = at[order], line[order]
    first, last = np.maximum(at - far, 0), np.minimum(at + far, n - 1)
    first[1:] = np.where(line[1:] == line[:-1], np.maximum(first[1:], last[:-1] + 1), first[1:])
    row, step = numbered(last - first + 1)
    return order[row], first[row] + step
