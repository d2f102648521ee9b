"""The graph that a search of key tags runs on: states, weights of tags and steps, runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import AT_ONCE, ROUNDING, BoolArray, FloatArray, IndexArray, Table
from postproc.geometry import angle_between
from postproc.kinematics import wrapped
from postproc.ladder import NONE, Ladder, Rule, Tolls
from postproc.planning.checks import Reason
from postproc.planning.route import ON_THE_SPOT
from postproc.planning.search.between import Interpolation
from postproc.planning.search.bridges import Bridges
from postproc.planning.search.constants import (
    BRIDGED,
    BRIDGED_TURN,
    CUT_TRAVEL,
    CUT_UNIT,
    DEAR,
    DEARER,
    FINER_PRICE,
    FINEST_SPIN,
    GAP_AROUND,
    HOME_SHARE,
    LEAST_STEP,
    MIRRORED_PRICE,
    PARTED,
    PARTED_BOUND,
    ROLL_PRICE,
    STEADY_BAND,
    STEADY_TURN,
    STUCK,
    TIE_TRAVEL,
)
from postproc.planning.search.edges import Edges, best_of, edges_of
from postproc.planning.search.keytags import arc_length
from postproc.planning.search.tilt_steps import TiltSteps
from postproc.planning.states import (
    TRAVEL_UNIT,
    Chosen,
    Problem,
    States,
    beside_in_grid,
    cut_into,
    rounded_spin,
    sample,
    sample_on,
)
from postproc.process import AXIS_SHARE
from postproc.records import dataclass
from postproc.units import DEG, TURN

WRIST = 4
"""The bit of a branch that says how the wrist stands."""
_ROUND = 1e-5
"""A spin is round that is nearer to it, in such steps: the grid of poses rounds as well."""
Joins = Bridges | TiltSteps
_LEVELS = (10, 5, 2, 1)
"""Every tenth of the round spins, every fifth, ...: each level must gain ``FINER_PRICE`` at holes.
The farther apart they stand, the rarer one turns where a base is measured anew by some mm; cuts
rather keep one spin all along."""
_PLAIN = 45.0 * DEG
"""The spin that needs no gain: the mirror images of a pose, at -s and 180 deg - s, are not alike
far from it."""


class Parted(NamedTuple):
    """Joints (a, k) and (b, k) [rad] between which no free path was found, first those of the gap.

    Of the arm, A1 to A3, or of all axes where that stands alike at the gap.
    """

    before: FloatArray
    behind: FloatArray

    @classmethod
    def by(cls, before: FloatArray, behind: FloatArray) -> Parted:
        """Return the gap between the first of joints (a, 6) and the first of (b, 6).

        From each to the others of its side free ways lead. Where the arm stands alike at the gap
        these are left out: what parts the tool there may not do so elsewhere.
        """
        if np.abs(before[0] - behind[0])[:3].max() <= GAP_AROUND:
            return cls(before[:1], behind[:1])
        return cls(_spread(before[:, :3]), _spread(behind[:, :3]))


@dataclass(frozen=True, slots=True)
class Window(Table):
    """Spins about a pose of each of N tags: spins (N, S), branch (N,), q (N, 6) [rad].

    The first spin of each is that of the pose itself, which is known to be free. ``tilt`` (N,):
    number of its tilt. ``best`` (N,) [N/m]: index that losses are priced against.
    """

    spins: FloatArray
    branch: IndexArray
    q: FloatArray
    tilt: IndexArray
    best: FloatArray

    @classmethod
    def around(
        cls, problem: Problem, chosen: Chosen, best: FloatArray, edge: FloatArray | None
    ) -> Window:
        """Return the round spins within a step of the grid about poses, and about edges of reach.

        ``edge`` (N,): spin of each edge, else that of the pose.
        """
        free = np.isnan(problem.pins)
        spins = [chosen.spin[:, None], _round_about(problem, chosen.spin, free)]
        spins += [] if edge is None else [_round_about(problem, edge, free)]
        tilt = np.abs(chosen.attitude[:, None, 1:] - problem.tilts).sum(axis=2).argmin(axis=1)
        return cls(np.hstack(spins), chosen.branch, chosen.q, tilt, best)

    def shut(self, tags: BoolArray) -> Window:
        """Return the window with nothing but the poses themselves at tags (N,)."""
        return replace(self, spins=np.where(tags[:, None], self.spins[:, :1], self.spins))


@dataclass(frozen=True, slots=True)
class SearchOptions:
    """What a search is for.

    ``each``: every tag takes its own best state. Travel only breaks ties, but inside a cut travel
    counts ``cut_travel``: a cut must still be a cut. ``least`` (n,) [N/m]: states of less
    stiffness cost ``DEAR``; None: no such bound. ``stretch`` (n,): tags of one number keep one arm
    configuration, cuts or not; None: cuts do. ``main`` (n,) [rad]: spin of which tags stand
    off by more than ``STEADY_BAND`` only where that earns ``ROLL_PRICE``, NaN where any will do;
    None: nowhere. ``parted``: where the tool is off the part, no step leads from near the one side
    to near the other if any other can be run. ``window``: the only poses there are; None: all.
    """

    each: bool = False
    cut_travel: float = CUT_TRAVEL
    least: FloatArray | None = None
    stretch: IndexArray | None = None
    main: FloatArray | None = None
    parted: tuple[Parted, ...] = ()
    window: Window | None = None


def _round_about(problem: Problem, spin: FloatArray, free: BoolArray) -> FloatArray:
    """Return the round spins (n, S) within a step of the grid about spins (n,), if ``free`` (n,).

    Where the cell does not allow one the spin itself stands for it.
    """
    wishes, low, high = problem.cell.optimize, *problem.cell.optimize.range
    step = wishes.spin_round or FINEST_SPIN
    count = int(np.ceil(wishes.step / step - ROUNDING)) if len(problem.settings.spins) > 1 else 0
    spins = (np.round(spin[:, None] / step) + np.arange(-count, count + 1)) * step
    inside = (spins >= low - ROUNDING) & (spins <= high + ROUNDING)
    inside |= high - low >= TURN - ROUNDING
    return rounded_spin(np.where(inside & free[:, None], spins, spin[:, None]))


def is_round(problem: Problem, spin: FloatArray, every: int = 1) -> BoolArray:
    """Return which spins (n,) are ``every``-th round ones, all where the cell rounds none."""
    step = every * problem.cell.optimize.spin_round
    off = np.abs(spin / step - np.round(spin / step)) if step else np.zeros(len(spin))
    return np.asarray(off < _ROUND)


def step_rules(problem: Problem) -> IndexArray:
    """Return the ``Rule`` (n,) of the step into each tag: cuts keep branch and turns."""
    return np.where(cut_into(problem.toolpath), Rule.CHAIN, Rule.FREE).astype(np.int64)


def pinned_spins(problem: Problem, tags: IndexArray) -> tuple[FloatArray, IndexArray]:
    """Return the finest grid of spins of tags, (S,) or (n, S) [rad], and the column of pins (n,).

    A pinned tag stands at its own spin in all columns; that nearest to it is the one to take, by
    which the tags beside it see where it stands. ``NONE`` where a tag is not pinned.
    """
    pins, given, fine = problem.pins[tags], problem.finest_spins, problem.fine
    column = np.full(len(tags), NONE, dtype=np.int64)
    if np.isnan(problem.pins).all():  # of all tags: the grids of any two sets of tags must join
        return given, column
    base = given[::fine]
    spins = np.tile(given, (len(tags), 1))
    for row in np.flatnonzero(~np.isnan(pins)).tolist():
        off = np.abs(np.mod(base - pins[row] + np.pi, TURN) - np.pi)
        spins[row], column[row] = pins[row], int(np.argmin(off)) * fine
    return spins, column


def states_on(
    problem: Problem, tags: IndexArray, stride: IndexArray, options: SearchOptions
) -> tuple[States, Edges]:
    """Return the states of tags (n,) on their grids of spins, and the stiffest."""
    spins, pin = pinned_spins(problem, tags)
    pinned, window = pin != NONE, options.window
    if window is None:
        states = sample_on(problem, tags, spins, stride)
        edges = edges_of(problem, tags, states, pinned, problem.fine)
        best = yardstick(problem, states, edges)
    else:
        states, best = _in_window(problem, tags, window.rows(tags))
        edges = Edges.none(best_of(states))
    price, cost = problem.settings.weights.price, states.cost
    is_bound = problem.cell.optimize.loss_bound is not None
    for low in range(0, len(tags), AT_ONCE):
        edge = states.offsets[low : low + AT_ONCE + 1]
        part = np.arange(int(edge[0]), int(edge[-1]))
        row, index = states.tag_of(part), states.index[part]
        lack = _irregularity(problem, tags, states, part, options)
        counted = 1.0 if is_bound else 1.0 - lack
        cost[part] += lack + price(1.0 - counted * index / best[row])
        if options.least is not None:
            wanted = price_of_lack(index, options.least[tags][row])
            cost[part] += np.where(pinned[row], 0.0, wanted)
        if window is None:
            off = states.column[part] % spins.shape[-1] != pin[row]
            cost[part[pinned[row] & off]] = np.inf
    cost[_stuck(problem, tags, states)] += STUCK
    return states, edges


def _irregularity(
    problem: Problem, tags: IndexArray, states: States, part: IndexArray, options: SearchOptions
) -> FloatArray:
    """Return the stiffness (m,) that states ``part`` of tags (n,) have to gain over regular ones.

    As a share, counted as if it was not there: then what it weighs is the same wherever stiffness
    is dear. Holes stand like each other, on one of the two sides of every mirror of the arm.
    """
    row, spin = states.tag_of(part), states.spin_of(part)
    is_hole, lack = problem.strokes.is_stroke[tags][row], np.zeros(len(part))
    if not options.each:
        turned = 1.0 - np.cos(spin - _PLAIN) + (states.branch[part] & WRIST != 0)
        lack[is_hole] = MIRRORED_PRICE * turned[is_hole]
    if options.window is not None:
        is_at = [is_round(problem, spin, every) for every in _LEVELS]
        level = np.argmax([*is_at, np.ones(len(part))], axis=0)
        lack += FINER_PRICE * np.where(is_hole, level, level == len(_LEVELS))
    return lack


def _in_window(problem: Problem, tags: IndexArray, own: Window) -> tuple[States, FloatArray]:
    """Return the states of tags (n,) in their window (n,), and the yardstick (n,)."""
    states = sample(problem, tags, own.spins, own.branch, own.q, tilts=problem.tilts)
    tilt, owner = states.column // states.spins.shape[-1], states.tag_of(np.arange(len(states.q)))
    near = beside_in_grid(problem.tilts) | np.eye(len(problem.tilts), dtype=np.bool_)
    states.cost[~near[own.tilt[owner], tilt]] = np.inf
    return states, own.best


def price_of_lack(index: NDArray[np.floating[Any]], least: FloatArray) -> FloatArray:
    """Return what poses (m,) cost whose index is below the least (m,) [N/m] that is asked for."""
    lacking = 1.0 - index / least
    return np.where(index < least, DEAR + DEARER * np.nan_to_num(lacking), 0.0)


def yardstick(problem: Problem, states: States, edges: Edges) -> FloatArray:
    """Return the index (n,) [N/m] that losses of tags are priced against.

    The best of the grid: what only the very edge of reach has, next to the stretched arm, draws
    nothing there. A bound that the cell sets is one of the best there is.
    """
    return best_of(states) if problem.cell.optimize.loss_bound is None else edges.index


def _stuck(problem: Problem, tags: IndexArray, states: States) -> IndexArray:
    """Return the states at the ends of cuts from which the tool cannot back off along its axis."""
    rows = np.flatnonzero(np.repeat(problem.ways_out[tags] > 0.0, np.diff(states.offsets)))
    at, q = tags[states.tag_of(rows)], states.q[rows].astype(np.float64)
    branch = states.branch[rows].astype(np.int64)
    return np.asarray(rows[~problem.way_out(at, states.attitude_of(rows), branch, q)[2]])


def ladder_of(
    problem: Problem,
    between: Interpolation,
    tags: IndexArray,
    states: States,
    options: SearchOptions,
) -> Ladder:
    """Return the graph of the states of tags (n,)."""
    rule = step_rules(problem)[tags]
    if options.stretch is not None:
        rule[1:] = np.where(np.diff(options.stretch[tags]) == 0, Rule.CHAIN, Rule.FREE)
    travel = np.full(len(tags), problem.settings.weights.travel)
    if options.each:
        travel = np.where(rule == Rule.CHAIN, options.cut_travel, TIE_TRAVEL)
    into, count = _cut_lengths(between, tags), np.diff(states.offsets)
    weight = travel / np.where(into > 0.0, into, 1.0) / TRAVEL_UNIT**2
    share = np.repeat(shares(between, tags), count)
    cost = states.cost * share
    if options.main is not None:
        off = states.spin_of(np.arange(len(states.q))) - np.repeat(options.main[tags], count)
        rolls = np.abs(wrapped(off)) > STEADY_BAND
        cost[rolls] += ROLL_PRICE * share[rolls]
    tolls = _tolls(options.parted, states.q, _price_of_gap(problem))
    _price_home(problem, states, options, cost, tolls)
    ladder = Ladder(states.offsets, states.q, cost, states.branch, rule, weight)
    if tolls is not None:
        tolls.enters[np.repeat(rule == Rule.CHAIN, count)] = 0.0
        ladder.tolls = tolls
    ladder.reach = _reach(problem, between, tags)
    return ladder


def _price_home(
    problem: Problem,
    states: States,
    options: SearchOptions,
    cost: FloatArray,
    tolls: Tolls | None,
) -> None:
    """Add to costs (N,), in place, what the ways from home and back cost."""
    home = problem.cell.motion.home
    if home is None or not len(states):
        return
    price = HOME_SHARE * problem.settings.weights.travel / TRAVEL_UNIT**2
    for rung in (0, len(states) - 1):
        at = slice(int(states.offsets[rung]), int(states.offsets[rung + 1]))
        if not options.each:
            cost[at] += price * ((states.q[at] - home) ** 2).sum(axis=1)
        if tolls is not None:
            cost[at] += tolls.enters[at] @ _sides(options.parted, home[None])[0]


def _price_of_gap(problem: Problem) -> float:
    return PARTED * (1.0 if problem.cell.optimize.loss_bound is None else PARTED_BOUND)


def _sides(parted: tuple[Parted, ...], q: NDArray[np.floating[Any]]) -> BoolArray:
    """Return near which sides (..., 2k) of k gaps joints (..., 6) stand."""
    return np.concatenate([beside(gap, q) for gap in parted], axis=-1)


def _tolls(parted: tuple[Parted, ...], q: NDArray[np.floating[Any]], price: float) -> Tolls | None:
    """Return what steps between joints (..., 6) cost that lead from side to side of a gap."""
    if not len(parted):
        return None
    leaves = _sides(parted, q).astype(np.float32)
    other = np.arange(leaves.shape[-1]) ^ 1
    return Tolls(leaves, np.float32(price) * leaves[..., other])


def _reach(problem: Problem, between: Interpolation, tags: IndexArray) -> FloatArray | None:
    """Return by how much (n, 6) the axes can move from tag to tag at the lowest feed [rad].

    None where any feed will do. What is turned on the spot takes the time that it takes. Where no
    pose can run a cut on the way there is no step at all.
    """
    least, is_shut = problem.least_feeds, between.infeasible != Reason.NONE
    if not least.any() and not is_shut.any():
        return None
    way = np.diff(arc_length(problem.toolpath), prepend=0.0)
    is_path = (least > 0.0) & (way > ON_THE_SPOT)
    seconds = np.where(is_path, way / np.maximum(least, 1e-12), np.inf)
    until = np.cumsum(np.where(is_path, seconds, 0.0))
    free = np.cumsum(~is_path)
    time = np.diff(until[tags], prepend=0.0)
    time[np.diff(free[tags], prepend=-1) > 0] = np.inf
    reach = 1.001 * AXIS_SHARE * time[:, None] * np.asarray(problem.cell.robot.qd_max)
    reach[np.diff(np.cumsum(is_shut)[tags], prepend=0) > 0] = -1.0
    return reach


def beside(parted: Parted, q: NDArray[np.floating[Any]]) -> BoolArray:
    """Return whether joints (..., 6) are near to the one and to the other side (..., 2).

    None is near to both: the nearer one counts.
    """
    off = np.full((*q.shape[:-1], 2), np.inf)
    for side, poses in enumerate(parted):
        for pose in poses:
            near = np.abs(q[..., : len(pose)] - pose).max(axis=-1)
            np.minimum(off[..., side], near, out=off[..., side])
    return np.asarray((off < GAP_AROUND) & (off < off[..., ::-1]))


def _spread(q: FloatArray) -> FloatArray:
    """Return some of joints (n, k), the first among them, that no other is far from."""
    kept = []
    while len(q):
        kept.append(q[0])
        q = q[np.abs(q - q[0]).max(axis=1) > 0.5 * GAP_AROUND]
    return np.array(kept)


def with_gaps(known: tuple[Parted, ...], gaps: list[Parted]) -> tuple[Parted, ...]:
    """Return the gaps known and those of some that say more."""
    for gap in gaps:
        ends = np.stack([gap.before[0], gap.behind[0]])
        near = [beside(other, ends) for other in known if other.before.shape[1] <= ends.shape[1]]
        if not any((n[0] & n[1, ::-1]).any() for n in near):
            known = (*known, gap)
    return known


def joins_of(
    problem: Problem,
    between: Interpolation,
    tags: IndexArray,
    states: States,
    stride: IndexArray,
    pinned: BoolArray,
    fast_turns: BoolArray,
) -> Joins:
    """Return what cuts may join: the runs of states; where the tool may tilt: how it leans.

    Between tags far apart runs say nothing of what lies between, nor where both are pinned. There
    the tool turns steadily, but into tags ``fast_turns`` (n,) it may turn as it will.
    """
    low, high = problem.cell.optimize.range
    is_cut, either = between.is_cut[tags], pinned | np.append(False, pinned[:-1])
    loose, axis = ~is_cut, problem.placement.axis_base(tags)
    loose[1:] |= pinned[1:] & pinned[:-1]
    loose[1:] |= np.diff(between.way[tags]) > BRIDGED
    loose[1:] |= angle_between(axis[1:], axis[:-1]) > BRIDGED_TURN
    has_tilts = len(states.tilts) > 1
    told = is_cut & ~either & (np.diff(tags, prepend=NONE) == 1) & has_tilts
    length = np.diff(between.way[tags], prepend=0.0)
    turn = STEADY_TURN * np.maximum(length / BRIDGED, 1.0)
    turn[fast_turns | ~is_cut | either | ~(loose | told)] = np.pi
    is_closed, carried = high - low >= TURN - ROUNDING, between.carried[tags]
    if has_tilts:
        return TiltSteps(problem, states, tags, told, stride, is_closed, carried, turn)
    return Bridges(states, stride, is_closed, loose, carried, turn)


def _cut_lengths(between: Interpolation, tags: IndexArray) -> FloatArray:
    """Return how much cut (n,), in ``CUT_UNIT``, leads to each of tags; 0 where none does."""
    length = np.maximum(np.diff(between.way[tags], prepend=np.nan), LEAST_STEP) / CUT_UNIT
    is_cut = between.is_cut[tags]
    is_cut[:1] = False
    return np.where(is_cut, length, 0.0)


def shares(between: Interpolation, tags: IndexArray) -> FloatArray:
    """Return the weight (n,) of each tag's own cost: that of the cut that it stands for."""
    into = _cut_lengths(between, tags)
    both = into + np.append(into[1:], 0.0)
    return np.where(both > 0.0, 0.5 * both, 1.0)
