"""The cell with its external axes somewhere, and the pose in which the arm travels with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.kinematics import build
from postproc.paths import Externals
from postproc.planning.checks import MORE_CLEARANCE, RESOLUTION, Checker
from postproc.planning.route.connect import free_way
from postproc.records import dataclass
from postproc.units import DEG

MakeChecker = Callable[[Cell], Checker]
_STANDING = np.zeros(0)
FOLDED = np.array([-90.0, 90.0, 0.0, 30.0, 0.0]) * DEG
"""A2 to A6 of an arm that keeps close to itself [rad]."""


def cell_at(cell: Cell, values: FloatArray) -> Cell:
    """Return the cell with its external axes at values (k,) [m or rad], as one without them."""
    return replace(Externals.of(cell).at(cell, values), external_axes=())


@dataclass(frozen=True, slots=True)
class Travel:
    """A pose to travel in, and the joints on the way to it (k, 6) and from it (l, 6)."""

    leave: FloatArray
    pose: FloatArray
    arrive: FloatArray


def travel_between(
    cell: Cell,
    q_from: FloatArray,
    q_to: FloatArray,
    places: tuple[FloatArray, FloatArray],
    make_checker: MakeChecker,
) -> Travel | None:
    """Return a pose that is free while the external axes move, with free ways to and from it."""
    margin = cell.limits.joint_margin
    low, high = np.asarray(cell.robot.q_min) + margin, np.asarray(cell.robot.q_max) - margin
    folded = [np.clip([a1, *FOLDED], low, high) for a1 in (float(q_from[0]), 0.0)]
    home = [] if cell.motion.home is None else [np.asarray(cell.motion.home)]
    first, last = (make_checker(cell_at(cell, place)) for place in places)
    for pose in (*home, *folded, q_from, q_to):
        if not _slides_free(cell, pose, places, first):
            continue
        leave = free_way(first, q_from, pose, _STANDING)
        arrive = None if leave is None else free_way(last, pose, q_to, _STANDING)
        if leave is not None and arrive is not None:
            return Travel(leave, np.asarray(pose), arrive)
    return None


def _slides_free(
    cell: Cell, q: FloatArray, places: tuple[FloatArray, FloatArray], checker: Checker
) -> bool:
    """Return whether the arm is free in a pose all along while the external axes move."""
    if checker.scene is None:
        return True
    from postproc.collision import Scene

    scene = Scene.shared(cell, build(cell.robot)).kept(MORE_CLEARANCE)
    start, end = (np.concatenate([q, place])[None] for place in places)
    return not scene.check_paths(start, end, resolution=RESOLUTION).any
