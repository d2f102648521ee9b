"""Stiffness over the turn about the tool axis for every tag, in the posture of the plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from postproc.model import MotionKind
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.arrays import BoolArray, FloatArray, IndexArray
    from postproc.cell import Cell
    from postproc.collision import Scene
    from postproc.model import Plan

MOST_TAGS = 10_000
"""With more tags the map is left out."""
_STEP = 10.0 * DEG
_CHUNK = 1000
_MOST_CHECKS = 50_000
"""Poses that are checked for collision; with more, the map is of reach and stiffness alone."""


@dataclass(frozen=True, slots=True)
class SpinIndex:
    """Index (n, s) [N/m] of tags over spins (s,) [rad], NaN where the arm cannot take the spin.

    ``hit`` (n, s): something collides there; None where collisions were not looked at.
    """

    spins: FloatArray
    index: FloatArray
    hit: BoolArray | None = None


def spin_index(plan: Plan, cell: Cell, move_of_tag: IndexArray, scene: Scene) -> SpinIndex | None:
    """Return the map of a plan, None without stiffness or with too many tags.

    The posture is that of the plan: its branch, and the turns of the joints nearest to it.

    Args:
        plan: the plan.
        cell: its cell, with the objective of the call.
        move_of_tag: (n,) the move at which each tag's pose is taken, -1 for a tag without any.
        scene: the solids.
    """
    from postproc.planning.route import cell_at
    from postproc.planning.states import spin_values

    n = len(plan.toolpath)
    if not np.isfinite(plan.stiffness).any() or n > MOST_TAGS:
        return None
    spins = spin_values(_STEP, *cell.optimize.range)
    index = np.full((n, len(spins)), np.nan)
    q = np.full((n, len(spins), 6), np.nan)
    served = np.flatnonzero(move_of_tag >= 0)
    places = plan.external[move_of_tag[served]]
    for place in np.unique(places, axis=0):
        tags = served[(places == place).all(axis=1)]
        fixed = cell_at(cell, place) if len(place) else cell
        for low in range(0, len(tags), _CHUNK):
            some = tags[low : low + _CHUNK]
            index[some], q[some] = _values(plan, fixed, some, move_of_tag[some], spins)
    return SpinIndex(spins, index, _hits(plan, q, move_of_tag, scene))


def _values(
    plan: Plan, cell: Cell, tags: IndexArray, moves: IndexArray, spins: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the index (t, s) of tags (t,) and the joints (t, s, 6), NaN where the arm cannot."""
    from postproc.kinematics import build
    from postproc.planning.states import (
        PlanOptions,
        Problem,
        evaluate,
        path_normals,
        place_given,
        settle,
        stiffness_of,
    )

    cell, settings = settle(cell, PlanOptions())
    path, placement = place_given(plan.toolpath, cell)
    normals = path_normals(path, placement)
    problem = Problem(
        path, cell, build(cell.robot), placement, settings, normals, stiffness_of(cell)
    )
    which, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    T = placement.tcp(which, spin)
    near = np.repeat(plan.q[moves], len(spins), axis=0)
    q, reached = problem.solve(T, np.repeat(plan.branch[moves].astype(np.int64), len(spins)), near)
    q = np.where(reached[:, None], q, 0.0)
    q = np.where(problem.within(q)[:, None], q, problem.kinematics.nearest(q, near))
    good = reached & problem.within(q) & problem.regular(q)
    rows = np.flatnonzero(good)
    index = np.full(len(which), np.nan)
    index[rows] = evaluate(problem, which[rows], spin[rows], T[rows], q[rows])[1]
    shape = (len(tags), len(spins))
    return index.reshape(shape), np.where(good[:, None], q, np.nan).reshape(*shape, 6)


def _hits(plan: Plan, q: FloatArray, move_of_tag: IndexArray, scene: Scene) -> BoolArray | None:
    """Return where (n, s) the pose at the tag collides."""
    can = np.isfinite(q[..., 0])
    if can.sum() > _MOST_CHECKS:
        return None
    tag, spin = np.nonzero(can)
    hit = np.zeros(can.shape, dtype=np.bool_)
    if len(tag):
        poses = np.hstack([q[tag, spin], plan.external[move_of_tag[tag]]])
        contact = plan.toolpath.kind[tag] != MotionKind.RAPID
        hit[tag, spin] = scene.check(poses, contact).hit
    return hit
