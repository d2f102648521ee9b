"""How good a place of the part is: reach of all tags first, then free of collision, then stiffness.

A place is a cell whose setups, or whose robot, stand elsewhere. Reach is asked of the inverse
kinematics alone, of every spin that the cell lets a tag have; solids are asked of the few best.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.kinematics import wrist_distance
from postproc.model import ToolPath
from postproc.paths import Externals
from postproc.planning.checks import NEAR, Checker, near_solids
from postproc.planning.job import checker_of, problem_of
from postproc.planning.states import Problem, States, postures, sample, settle
from postproc.process import as_served, assign, driven, holes_served
from postproc.records import dataclass

COMPARED = 24
"""So many tags of a tool and base tell reach while places are compared, spread over the part."""
_SPINS = 12
_POSITIONS = 5
"""External axes are tried at so many positions each while places are compared."""
_TOGETHER = 512
"""So many poses are asked for collision at once where every one may have to be."""
_TRIES = 12
"""Poses of a tag that are asked for collision, the stiffest of each spin and branch first."""


@dataclass(frozen=True, slots=True)
class Rank:
    """How good a place is; the greater the better.

    ``free``: share of the tags that some pose serves; ``margin`` [rad]: least of all tags to limits
    and the straight wrist beyond the cell's, no more than ``NEAR`` counts; ``stiffness`` [N/m]:
    mean over the tags, 0 without; ``clearance`` [m], as far as ``near_solids``.
    """

    free: float
    margin: float
    stiffness: float
    clearance: float

    @property
    def key(self) -> tuple[float, ...]:
        """What places are ordered by: margins, then stiffness to a hundredth, then clearance."""
        stiff = 0.0 if self.stiffness <= 0.0 else round(float(np.log(self.stiffness)), 2)
        return (self.free, round(min(self.margin, NEAR), 3), stiff, self.clearance, self.margin)


@dataclass(frozen=True, slots=True)
class Reach:
    """Tags of one job in one cell, to be asked for at other places.

    ``pieces``: problem of each tool in each base, with its tags to compare places by.
    """

    cell: Cell
    pieces: tuple[tuple[Problem, IndexArray], ...]

    @classmethod
    def of(cls, toolpath: ToolPath, cell: Cell) -> Reach:
        """Return the tags of what was read, as ``plan`` takes them; errors as ``plan``."""
        cell, settings = settle(cell)
        assigned = assign(driven(as_served(toolpath, cell), cell), cell)
        served = holes_served(assigned.toolpath, cell)
        pieces = []
        for stretch in (one for one in assigned.stretches() if one.is_assigned):
            part = served.rows(np.arange(stretch.low, stretch.high))
            here = cell.with_tool(stretch.tool, stretch.base)
            external = np.zeros((len(part), len(cell.external_axes)))
            problem = problem_of(part, here, settings, external if cell.external_axes else None)
            pieces.append((problem, _spread(problem)))
        return cls(cell, tuple(pieces))

    @classmethod
    def of_one(cls, toolpath: ToolPath, cell: Cell) -> Reach:
        """Return all tags as for the tool in work in its base, whatever the file calls."""
        cell, settings = settle(cell)
        problem = problem_of(as_served(toolpath, cell), cell, settings)
        return cls(cell, ((problem, _spread(problem)),))

    @property
    def tags(self) -> int:
        """How many tags there are."""
        return sum(len(problem) for problem, _ in self.pieces)

    def points(self) -> FloatArray:
        """Return all points (n, 3) of the job in robroot [m]."""
        return np.concatenate(
            [
                p.placement.p_base_tcp @ p.placement.T_robroot_base[:3, :3].T
                + p.placement.T_robroot_base[:3, 3]
                for p, _ in self.pieces
            ]
        )

    def axes(self) -> FloatArray:
        """Return the ways (n, 3) from the tips up into the holders, in robroot."""
        ways = []
        for problem, _ in self.pieces:
            place = problem.placement
            into = place.axis_base(np.arange(len(problem)))
            ways.append(-into @ place.T_robroot_base[:3, :3].T)
        return np.concatenate(ways)

    def served(self, tags: IndexArray) -> BoolArray:
        """Return which of tags (t,), in growing order, some pose serves, solids and all.

        Every pose of the cell's spins is asked where need be, reach first, which costs least.
        """
        first, found = 0, []
        for problem, _ in self.pieces:
            own = tags[(tags >= first) & (tags < first + len(problem))] - first
            first += len(problem)
            good = np.isfinite(self._margins(problem, own, every=1))
            for _ in self._stood(self.cell, problem, own, good, most=None):
                pass
            found.append(good)
        return np.concatenate(found)

    def spread(self) -> IndexArray:
        """Return the tags that places are compared by."""
        firsts = np.cumsum([0, *(len(problem) for problem, _ in self.pieces)])
        return np.concatenate([k + tags for k, (_, tags) in zip(firsts, self.pieces, strict=False)])

    def margins(self, cell: Cell, *, whole: bool = False) -> FloatArray:
        """Return the largest margin (t,) [rad] of tags over spins and branches, -inf out of reach.

        Args:
            cell: the one that ``of`` got, with its setups or its robot elsewhere.
            whole: of all tags that have a pose, not only of those that places are compared by.
        """
        return np.concatenate(
            [
                self._margins(
                    _in(cell, p),
                    np.flatnonzero(p.placement.given) if whole else tags,
                    max(1, len(p.settings.spins) // _SPINS),
                )
                for p, tags in self.pieces
            ]
        )

    def _margins(self, problem: Problem, tags: IndexArray, every: int) -> FloatArray:
        spins = problem.settings.spins[::every]
        pins = problem.pins[tags]
        spin = np.where(np.isnan(pins)[:, None], spins, pins[:, None]).ravel()
        which = np.repeat(tags, len(spins))
        strokes = problem.strokes
        low = np.where(strokes.is_stroke, -strokes.depth, 0.0)[which]
        top = np.where(strokes.is_stroke, strokes.top, problem.ways_out)[which]
        best = np.full(len(which), -np.inf)
        for external in positions(self.cell, _POSITIONS):
            rows = np.tile(external, (len(problem), 1))
            here = replace(problem, placement=replace(problem.placement, external=rows))
            least = np.full((len(which), 8), np.inf)
            for height in (low, top):
                T = here.placement.tcp(which, spin, height)
                least = np.minimum(least, _spare(here, which, T))
            best = np.maximum(best, least.max(axis=1))
        return np.asarray(best.reshape(len(tags), len(spins)).max(axis=1))

    def rank(self, cell: Cell) -> Rank:
        """Return how good a place is, solids and all, by the tags that places are compared by."""
        free: list[BoolArray] = []
        margins, stiff, clear = [np.inf], np.zeros(0).tolist(), [near_solids(cell)]
        for problem, tags in self.pieces:
            good = np.ones(len(tags), dtype=np.bool_)
            for here, served, q, index in self._stood(cell, problem, tags, good, _TRIES):
                margins.append(float(_margin(here.problem, q).min()))
                stiff += index[np.isfinite(index)].tolist()
                clear.append(_clear(here, tags[served], q))
            free.append(good)
        done = np.concatenate(free)
        return Rank(
            float(done.mean()), min(margins), float(np.mean(stiff)) if stiff else 0.0, min(clear)
        )

    def _stood(
        self, cell: Cell, problem: Problem, tags: IndexArray, good: BoolArray, most: int | None
    ) -> Iterator[tuple[Checker, IndexArray, FloatArray, FloatArray]]:
        """Yield checker, rows of ``tags`` (k,), joints (k, 6) and stiffness (k,) of free poses.

        Asked are the tags that are ``good``; in place, those are left so that some pose serves.
        """
        left = np.flatnonzero(good)
        good[:] = False
        if not len(left):
            return
        checker = checker_of(
            problem.toolpath,
            cell.with_tool(problem.cell.tool_index, problem.cell.base_index),
            problem.settings,
            problem.placement.external if cell.external_axes else None,
        )
        for position in positions(self.cell, _POSITIONS):
            here = checker
            if cell.external_axes:
                here = replace(checker, problem=checker.problem.standing(position))
            q, index, own = _standing(here, tags[left], most)
            good[left[own]] = True
            if len(q):
                yield here, left[own], q, index
            left = np.flatnonzero(~good)
            if not len(left):
                return


def positions(cell: Cell, each: int) -> Iterator[FloatArray]:
    """Yield where external axes stand (k,): every combination of so many positions of each."""
    for values in product(*(np.linspace(a.q_min, a.q_max, each) for a in cell.external_axes)):
        yield np.array(values)


def _in(cell: Cell, problem: Problem) -> Problem:
    """Return the problem with its setup and the external axes where they stand in a cell."""
    place = problem.placement
    axes = None if place.axes is None else Externals.of(cell)
    T = np.asarray(cell.bases[problem.cell.base_index].T_robroot_base)
    return replace(problem, placement=replace(place, T_robroot_base=T, axes=axes))


def _spare(problem: Problem, tags: IndexArray, T: FloatArray) -> FloatArray:
    """Return the margin (m, 8) [rad] of poses (m, 4, 4) by branch, -inf where it cannot stand."""
    found = postures(problem, tags, T)
    result = np.full(found.good.shape, -np.inf)
    result[found.good] = _margin(problem, found.q[found.good])
    return result


def _margin(problem: Problem, q: FloatArray) -> FloatArray:
    """Return how far joints (m, 6) [rad] are within limits and off the straight wrist."""
    kinematics, limits = problem.kinematics, problem.cell.limits
    joint = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min(axis=1)
    wrist = wrist_distance(kinematics, q) - limits.singularity
    return np.asarray(np.minimum(joint - limits.joint_margin, wrist))


def _standing(
    checker: Checker, tags: IndexArray, most: int | None
) -> tuple[FloatArray, FloatArray, IndexArray]:
    """Return for tags with a free pose the joints (k, 6), stiffness (k,) and their rows (k,).

    The stiffest poses with the full margin are asked first; a stroke has to be free, too. ``most``:
    so many poses of a tag are asked, spread over all of them; None: those first, then all.
    """
    problem = checker.problem
    states = sample(problem, tags, problem.settings.spins)
    count = np.diff(states.offsets)
    owner = np.repeat(np.arange(len(tags)), count)
    q = states.q.astype(np.float64)
    wide = np.minimum(_margin(problem, q), NEAR) if len(q) else np.zeros(0)
    order = np.lexsort((states.cost, -np.round(wide, 2), owner))
    turn = np.arange(len(order)) - states.offsets[owner[order]]
    picked = np.full(len(tags), -1)
    asked = np.zeros(len(order), dtype=np.bool_)
    for number in range(_TRIES if most is None else most):
        # spread over all poses of a tag, the best first
        share = count[owner[order]] * number // _TRIES
        _pick(checker, tags, states, order[(turn == share) & ~asked], picked)
        asked |= turn == share
    if most is None:
        for low in range(0, len(order), _TOGETHER):
            rows = order[low : low + _TOGETHER]
            _pick(checker, tags, states, rows[~asked[low : low + _TOGETHER]], picked)
    own = np.flatnonzero(picked >= 0)
    rows = picked[own]
    return q[rows], states.index[rows].astype(np.float64), own


def _pick(
    checker: Checker, tags: IndexArray, states: States, rows: IndexArray, picked: IndexArray
) -> None:
    """Note in ``picked`` (t,), in place, the first free of rows of states for tags without one."""
    owner = states.tag_of(rows)
    rows, at = rows[picked[owner] < 0], owner[picked[owner] < 0]
    if not len(rows):
        return
    good = checker.states(
        tags[at],
        states.q[rows].astype(np.float64),
        states.attitude_of(rows),
        states.branch[rows].astype(np.int64),
    ).good
    first, place = np.unique(at[good], return_index=True)
    picked[first] = rows[good][place]


def _clear(checker: Checker, tags: IndexArray, q: FloatArray) -> float:
    if checker.scene is None:
        return np.inf
    poses = np.hstack([q, checker.problem.placement.external[tags]])
    contact = checker.problem.is_contact[tags]
    return float(checker.scene.nearest(poses, contact, near_solids(checker.problem.cell))[0].min())


def _spread(problem: Problem) -> IndexArray:
    """Return tags at the ends of the part in points and axes, and some between."""
    given = np.flatnonzero(problem.placement.given)
    if len(given) <= COMPARED:
        return given
    ways = np.array([w for w in product((-1, 0, 1), repeat=3) if any(w)])
    ends = [
        np.argmax(at[given] @ ways.T, axis=0)
        for at in (
            problem.placement.p_base_tcp,
            problem.placement.axis_base(np.arange(len(problem))),
        )
    ]
    between = np.linspace(0, len(given) - 1, COMPARED // 2).round().astype(np.int64)
    return np.asarray(given[np.unique(np.concatenate([*ends, between]))])
