"""The search for the best states of tags: its graph, its checks, and why states and steps fail."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.model import MotionKind
from postproc.planning.checks import Checker, Evidence, Lines, Reason, Verdict, poses_between
from postproc.planning.search.free_path import Found, free_path
from postproc.planning.states import (
    NONE,
    TRAVEL_UNIT,
    Chosen,
    Ladder,
    Problem,
    Rule,
    States,
    beside_in_grid,
    leaves_tilt_range,
    sample,
)

TIE_TRAVEL = 1e-7
"""Weight of travel that only breaks ties."""
_CHAIN_TRAVEL = 3e-3
"""Weight of travel inside a cut where every tag is optimised for itself: 0.3 % of stiffness for a
joint step of 10 degrees. Without it neighbours stand at opposite spins and no line joins them."""
_TIE_SPIN = 1e-5
_WIDEST = 8
"""How many spins and tags around a failing pose are checked, at most."""
_RIM = 2
"""How far beyond a colliding neighbour the check spreads."""
_NARROW = 3
"""How often steps into a tag may fail before those between other tilts are checked too."""
_TILT_SHARES = np.arange(1.0, 8.0) / 8.0
"""Where on a cut the tilt of the tool is checked."""


def step_rules(problem: Problem) -> IndexArray:
    """Return the ``Rule`` (n,) of the step into each tag: cuts keep branch and turns."""
    kind = np.asarray(problem.toolpath.kind)
    chain = np.isin(kind, (MotionKind.LINEAR, MotionKind.ARC))
    return np.where(chain, Rule.CHAIN, Rule.FREE).astype(np.int64)


def pinned_spins(problem: Problem, tags: IndexArray) -> tuple[FloatArray, BoolArray]:
    """Return the spins of tags, (S,) or (n, S) [rad], and which tags (n,) are pinned to one."""
    given, pins = problem.settings.spins, problem.cell.optimize.pins
    pinned = np.zeros(len(tags), dtype=np.bool_)
    if not pins:
        return given, pinned
    spins = np.tile(given, (len(tags), 1))
    for row, tag in enumerate(tags.tolist()):
        spin = pins.get(problem.toolpath.tag_name(tag))
        if spin is not None:
            spins[row], pinned[row] = spin, True
    return spins, pinned


@dataclass(slots=True)
class PoseSearch:
    """A search over tags: their states, the graph, and why states and steps failed."""

    checker: Checker
    tags: IndexArray
    states: States
    ladder: Ladder
    weight: FloatArray
    pinned: BoolArray
    reason: IndexArray
    pair: IndexArray
    seen: BoolArray
    failures: IndexArray
    stroked: BoolArray
    step_reason: dict[int, tuple[Reason, int]] = field(default_factory=dict)
    cells: IndexArray | None = None
    fanned: dict[int, int] = field(default_factory=dict)

    @classmethod
    def of(cls, checker: Checker, tags: IndexArray, *, each: bool) -> PoseSearch:
        """Return the search over tags (n,) in this order.

        Args:
            checker: of the problem.
            tags: (n,).
            each: every tag takes its own best state. Travel and spin only break ties, but inside a
                cut travel counts a little (``_CHAIN_TRAVEL``): a cut must still be a cut.
        """
        problem = checker.problem
        spins, pinned = pinned_spins(problem, tags)
        states = sample(problem, tags, spins, tilts=problem.tilts)
        cost = states.cost
        every = np.arange(len(cost))
        if pinned.any():
            cost[pinned[states.tag_of(every)] & (states.column % spins.shape[-1] > 0)] = np.inf
        if each:
            cost += _TIE_SPIN * (states.spin_of(every) / TRAVEL_UNIT) ** 2
        rule = step_rules(problem)[tags]
        weight = np.full(len(tags), problem.settings.weights.travel / TRAVEL_UNIT**2)
        if each:
            weight = np.where(rule == Rule.CHAIN, _CHAIN_TRAVEL, TIE_TRAVEL) / TRAVEL_UNIT**2
        ladder = Ladder(states.offsets, states.q, cost, states.branch, rule, weight)
        return cls(
            checker,
            tags,
            states,
            ladder,
            weight,
            pinned,
            np.zeros(len(cost), dtype=np.int64),
            np.full(len(cost), -1, dtype=np.int64),
            np.zeros(int(states.config[-1]) + 1 if len(cost) else 0, dtype=np.bool_),
            np.zeros(len(tags), dtype=np.int64),
            np.zeros(len(tags), dtype=np.bool_),
        )

    def run(self, *, steps: bool = True) -> Found:
        """Search; without ``steps`` only states are checked, not the motions between them."""
        check_steps = self.check_steps if steps else None
        return free_path(self.ladder, self.check_states, check_steps, self.beside, self.fan)

    def check_states(self, states: IndexArray) -> BoolArray:
        """Return whether states (m,) can be run, strokes and all; keeps the reasons."""
        fresh = states[self.reason[states] == Reason.NONE]
        branch = self.states.branch[fresh].astype(np.int64)
        q = self.states.q[fresh].astype(np.float64)
        rungs = self.states.tag_of(fresh)
        verdict = self.checker.states(self.tags[rungs], q, self.states.attitude_of(fresh), branch)
        self.reason[fresh], self.pair[fresh] = verdict.reason, verdict.pair
        self.seen[self.states.config[fresh]] = True
        return np.asarray(self.reason[states] == Reason.NONE)

    def check_steps(self, before: IndexArray, after: IndexArray) -> BoolArray:
        """Return whether steps (m,) can be run as CP motions; joint moves always can.

        Between tags that do not follow each other it is for others to say what lies between.
        """
        rungs = self.states.tag_of(after)
        follows = self.tags[rungs] == self.tags[np.maximum(rungs - 1, 0)] + 1
        is_cut = step_rules(self.checker.problem)[self.tags[rungs]] == Rule.CHAIN
        chain = np.nonzero(is_cut & (self.ladder.rule[rungs] == Rule.CHAIN) & follows)[0]
        good = np.ones(len(after), dtype=np.bool_)
        if not len(chain):
            return good
        a, b = before[chain], after[chain]
        verdict = check_chain(
            self.checker,
            (self.tags[rungs[chain] - 1], self.tags[rungs[chain]]),
            (self.states.attitude_of(a), self.states.attitude_of(b)),
            (self.states.q[a].astype(np.float64), self.states.q[b].astype(np.float64)),
            self.states.branch[b].astype(np.int64),
        )
        for row in np.nonzero(~verdict.good)[0].tolist():
            found = (Reason(int(verdict.reason[row])), int(verdict.pair[row]))
            self.step_reason[int(rungs[chain[row]])] = found
        good[chain] = verdict.good
        return good

    def beside(self, failing: IndexArray) -> IndexArray:
        """Return states that fail along with others: their turn copies, and colliding neighbours.

        From every failing pose the check spreads over the poses around it (spin and tag, same
        branch), without their strokes, until it has found the whole colliding region and its rim:
        the next best way would mostly run into the next pose of the same region.
        """
        rows = self.states.tag_of(failing)
        self.failures[rows] += 1
        found = [failing[self.reason[failing] == Reason.COLLISION]]
        reach = min(_WIDEST, int(self.failures[rows].max(initial=1)))
        front = failing
        while len(front):
            poses = self._around(front, reach)
            poses = poses[~self.seen[self.states.config[poses]]]
            self.seen[self.states.config[poses]] = True
            rows = self.states.tag_of(poses)
            verdict = self.checker.poses(self.tags[rows], self.states.q[poses].astype(np.float64))
            fails = ~verdict.good
            front, reach = poses[fails], _RIM
            self.reason[front], self.pair[front] = verdict.reason[fails], verdict.pair[fails]
            found.append(front)
        strokes = self._strokes_beside(failing)
        return np.concatenate([self._copies(np.concatenate(found)), strokes])

    def _strokes_beside(self, failing: IndexArray) -> IndexArray:
        """Return states whose stroke leaves reach or limits, on the tags around such failures."""
        reason = self.reason[failing]
        rungs = self.states.tag_of(failing[(reason != Reason.COLLISION) & (reason != Reason.NONE)])
        near = np.unique(rungs[:, None] + np.arange(-_WIDEST, _WIDEST + 1))
        near = near[(near >= 0) & (near < len(self.tags))]
        near = near[~self.stroked[near]]
        if not len(near):
            return np.zeros(0, dtype=np.int64)
        self.stroked[near] = True
        ends = self.states.offsets
        rows = np.concatenate([np.arange(ends[rung], ends[rung + 1]) for rung in near.tolist()])
        rows = rows[self.reason[rows] == Reason.NONE]
        verdict = self.checker.stroke_ends(
            self.tags[self.states.tag_of(rows)],
            self.states.q[rows].astype(np.float64),
            self.states.attitude_of(rows),
            self.states.branch[rows].astype(np.int64),
        )
        bad = rows[~verdict.good]
        self.reason[bad] = verdict.reason[~verdict.good]
        return np.asarray(bad)

    def _copies(self, states: IndexArray) -> IndexArray:
        """Return the turn copies of colliding states, with the reason noted for each."""
        of_config = np.searchsorted(self.states.config, self.states.config[states])
        ends = np.searchsorted(self.states.config, self.states.config[states], side="right")
        count = ends - of_config
        copies = np.repeat(of_config, count) + (
            np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        )
        self.reason[copies] = Reason.COLLISION
        self.pair[copies] = np.repeat(self.pair[states], count)
        return np.asarray(copies)

    def _around(self, states: IndexArray, reach: int) -> IndexArray:
        """Return one state of every configuration near to states, of the same branch.

        Those with the same tilt, of tags and spins near by, and those of the tilts next to it.
        """
        width, n = self.states.spins.shape[-1], len(self.tags)
        if self.cells is None:
            self.cells = self._cell(np.arange(len(self.states.q)))
        along, around = np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)
        rung = self.states.tag_of(states)[:, None, None] + along[None, :, None]
        tilt, spin = np.divmod(self.states.column[states].astype(np.int64)[:, None, None], width)
        inside = (rung >= 0) & (rung < n)
        branch = self.states.branch[states].astype(np.int64)[:, None, None]
        column = tilt * width + (spin + around[None, None, :]) % width
        places = self._place(np.clip(rung, 0, n - 1), column, branch)
        near = [places[np.broadcast_to(inside, places.shape)]]
        which, other = np.nonzero(beside_in_grid(self.states.tilts)[tilt[:, 0, 0]])
        rung, column = self.states.tag_of(states)[which], other * width + spin[which, 0, 0]
        near.append(self._place(rung, column, branch[which, 0, 0]))
        wanted = np.unique(np.concatenate(near))
        found = np.minimum(np.searchsorted(self.cells, wanted), len(self.cells) - 1)
        return np.asarray(found[self.cells[found] == wanted])

    def fan(self, steps: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the steps that leave or enter the same states as failing ones.

        In their branch; at first those with the tilt of the failing step, where that is not enough
        (``_NARROW``) those with any.
        """
        more: set[tuple[int, int]] = set()
        for a, b in steps:
            rung = int(self.states.tag_of(np.array([b]))[0])
            self.fanned[rung] = self.fanned.get(rung, 0) + 1
            before = np.arange(self.states.offsets[rung - 1], self.states.offsets[rung])
            now = np.arange(self.states.offsets[rung], self.states.offsets[rung + 1])
            branch = self.states.branch[a]
            narrow = self.fanned[rung] <= _NARROW
            for state in now[self._open(now, branch, a, b if narrow else None)].tolist():
                more.add((a, state))
            for state in before[self._open(before, branch, b, a if narrow else None)].tolist():
                more.add((state, b))
        return sorted(more - set(steps))

    def _open(self, states: IndexArray, branch: int, end: int, like: int | None) -> BoolArray:
        """Return which states a step with ``end`` may join, of the tilt of ``like`` if given."""
        near = np.abs(self.states.q[states] - self.states.q[end]).max(axis=1) <= np.pi
        near &= np.isfinite(self.ladder.cost[states])
        if like is not None:
            width = self.states.spins.shape[-1]
            near &= self.states.column[states] // width == self.states.column[like] // width
        return np.asarray(near & (self.states.branch[states] == branch))

    def _cell(self, states: IndexArray) -> IndexArray:
        column = self.states.column[states].astype(np.int64)
        branch = self.states.branch[states].astype(np.int64)
        return self._place(self.states.tag_of(states), column, branch)

    def _place(self, rung: IndexArray, column: IndexArray, branch: IndexArray) -> IndexArray:
        """Return numbers of configurations that rise with rung, then column, then branch."""
        width = self.states.spins.shape[-1] * len(self.states.tilts)
        return np.asarray((rung * width + column) * 8 + branch)

    def chosen(self, found: Found) -> Chosen:
        """Return the poses of all tags with exact joints."""
        problem = self.checker.problem
        n = len(self.tags)
        good = found.path != NONE
        rows = found.path[good]
        attitude, q = np.zeros((n, 3)), np.zeros((n, 6))
        branch = np.zeros(n, dtype=np.int64)
        attitude[good] = self.states.attitude_of(rows)
        branch[good] = self.states.branch[rows]
        T = problem.placement.tcp(self.tags[good], attitude[good])
        q[good], _ = problem.solve(T, branch[good], self.states.q[rows].astype(np.float64))
        return Chosen(attitude, branch, q, good, self.ladder.broken.copy())

    def record(self, found: Found, chosen: Chosen) -> dict[str, object]:
        """Return what the search did, for the record of the plan."""
        return {
            "strategy": self.checker.problem.cell.optimize.strategy,
            "states": len(self.states.q),
            "checked": found.checked,
            "rounds": found.rounds,
            "cost": self.ladder.total(found.path),
            "travel_rad2": travel(chosen),
        }

    def evidence(self, chosen: Chosen) -> Evidence:
        """Return why tags failed."""
        return Evidence(
            self.tags,
            self.states,
            self.ladder.rule,
            self.reason,
            self.pair,
            self.step_reason,
            chosen,
        )


def check_chain(
    checker: Checker,
    tags: tuple[IndexArray, IndexArray],
    attitudes: tuple[FloatArray, FloatArray],
    joints: tuple[FloatArray, FloatArray],
    branch: IndexArray,
) -> Verdict:
    """Check cuts (m,) from tags to tags, in attitudes (m, 3)."""
    problem, top = checker.problem, checker.strokes.top
    T_from = problem.placement.tcp(tags[0], attitudes[0], top[tags[0]])
    T_to = problem.placement.tcp(tags[1], attitudes[1])
    q_from, _ = problem.solve(T_from, branch, joints[0])
    q_to, _ = problem.solve(T_to, branch, joints[1])
    lines = Lines(T_from, T_to, q_from, q_to, branch, np.ones(len(branch), dtype=np.bool_))
    number = np.asarray(problem.toolpath.arc)[tags[1]]
    arcs = problem.toolpath.arcs
    if len(arcs):
        is_arc = np.asarray(problem.toolpath.kind)[tags[1]] == MotionKind.ARC
        lines.centre, lines.normal = arcs.centre[number], arcs.normal[number]
        lines.radius = arcs.radius[number]
        lines.sweep = np.where(is_arc, arcs.sweep[number], 0.0)
    leaves = _leaves_tilt_range(problem, tags, attitudes, lines)
    verdict = checker.lines(lines)[0]
    # As for a turn that could go either way round: the tool cannot turn so on this way.
    verdict.refuse(np.flatnonzero(leaves), Reason.SINGULAR)
    return verdict


def _leaves_tilt_range(
    problem: Problem,
    tags: tuple[IndexArray, IndexArray],
    attitudes: tuple[FloatArray, FloatArray],
    lines: Lines,
) -> BoolArray:
    """Return which cuts (m,) leave the allowed tilt on their way; tell arcs the tilt they carry."""
    place = problem.placement
    leaves = np.zeros(len(lines), dtype=np.bool_)
    tilts = tuple(place.tilts(*end) for end in zip(tags, attitudes, strict=True))
    tilted = (tilts[0] != 0.0).any(axis=1) | (tilts[1] != 0.0).any(axis=1)
    if not tilted.any():
        return leaves
    lines.tilts = tilts[0], tilts[1]
    rows, k = np.flatnonzero(tilted), len(_TILT_SHARES)
    T = poses_between(lines, np.repeat(rows, k), np.tile(_TILT_SHARES, len(rows)))
    axis = -(T[:, :3, :3] @ place.tool_axis).reshape(len(rows), k, 3)
    around = np.zeros((len(rows), 3))
    if lines.normal is not None and lines.sweep is not None:
        around = lines.normal[rows] * lines.sweep[rows, None]
    first, last = tags[0][rows], tags[1][rows]
    leaves[rows] = leaves_tilt_range(
        axis,
        _TILT_SHARES,
        (-place.axis_base(first), -place.axis_base(last)),
        (place.feed[first], place.feed[last]),
        around,
        problem.cell.optimize.tilt,
    )
    return leaves


def travel(chosen: Chosen) -> float:
    """Return the sum of squared joint steps [rad^2] along the unbroken way."""
    good = chosen.good
    joined = good[1:] & good[:-1] & ~chosen.entry[1:]
    return float((np.diff(chosen.q, axis=0)[joined] ** 2).sum())
