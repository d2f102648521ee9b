"""How stiff the tool is over the rotation about its axis, tag by tag.

The curves of Figures 19 to 24 of Jiao et al. 2022, with the true stiffness beside their indices.

For every tag and spin all inverse kinematic branches are looked at; a curve follows the branch
that serves most spins of its tag, so that it does not jump between postures. Spins that the arm
cannot take (reach, limits, straight wrist) are gaps. The best spin is one of those that can be run:
free of collision, with the whole stroke of a hole.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.errors import CellError, SourceRef
from postproc.kinematics import is_coaxial_with_axis_6
from postproc.model import ToolPath
from postproc.planning.checks import MORE_CLEARANCE, Checker
from postproc.planning.planner import problem_of
from postproc.planning.search import key_tags
from postproc.planning.states import (
    PlanOptions,
    Postures,
    Problem,
    StateContext,
    context_of,
    cross_axes,
    place,
    postures,
    settle,
    spin_values,
    stiffness_of,
    strokes_of,
)
from postproc.stiffness import index
from postproc.units import DEG

INDICES = {
    "axial": "along the tool axis",
    "radial": "weakest direction across the tool axis",
    "normal": "across the path in the work plane",
    "first_cross": "along the first cross axis of the tool frame",
    "second_cross": "along the second cross axis of the tool frame",
    "ellipsoid_kx": "Jiao et al. 2022, along the tool axis, Eq. (23)",
    "ellipsoid_ky": "Jiao et al. 2022, along the first cross axis, Eq. (24)",
    "ellipsoid_kz": "Jiao et al. 2022, along the second cross axis, Eq. (25)",
    "ellipsoid_kv": "Jiao et al. 2022, normal stiffness, Eq. (43)",
}
"""Name of an index to what it is."""


@dataclass(frozen=True, slots=True)
class SpinCurves:
    """Indices over the spin.

    tags (t,) indices of the toolpath; names (t,); spins (s,) [rad]; values: index name to (t, s)
    [N/m], NaN where the arm cannot take the spin; blocked (t, s): something collides there,
    or the stroke cannot be run; branch (t,); q (t, s, 6); coaxial: the tool axis lies on axis 6,
    where the spin changes nothing.
    """

    tags: IndexArray
    names: tuple[str, ...]
    spins: FloatArray
    values: Mapping[str, FloatArray]
    blocked: BoolArray
    branch: IndexArray
    q: FloatArray
    coaxial: bool

    def best(self, name: str) -> IndexArray:
        """Return the best free spin (t,) of an index as a number in ``spins``, -1 without any."""
        values = np.where(self.blocked, np.nan, self.values[name])
        filled = np.where(np.isfinite(values), np.round(values, 3), -1.0)
        pick = np.argmax(filled, axis=1)
        return np.where(np.isfinite(values).any(axis=1), pick, -1).astype(np.int64)

    def gain(self, name: str) -> FloatArray:
        """Return (t,) the best value over the one at spin 0 (or nearest to it), minus 1."""
        values = self.values[name]
        start = int(np.argmin(np.abs(self.spins)))
        rows = np.arange(len(self.tags))
        best = values[rows, np.maximum(self.best(name), 0)]
        return np.asarray(best / values[rows, start] - 1.0)


def spin_curves(
    toolpath: ToolPath,
    cell: Cell,
    tags: IndexArray | None = None,
    step: float | None = None,
    most: int = 24,
) -> SpinCurves:
    """Return the indices of key tags over the spin.

    Args:
        toolpath: what was read.
        cell: robot with its joint stiffness (a constant, or what a model knows), tool, workpiece.
        tags: indices; None: key tags, at most ``most`` of them.
        step: of the spin [rad]; None: the cell's.
        most: how many key tags.

    Raises:
        CellError: PLN208 if neither the cell nor a model gives joint stiffness.
    """
    if stiffness_of(cell) is None:
        raise CellError(
            "PLN208",
            "no joint stiffness: the cell has no [stiffness] and no --model is given",
            SourceRef(cell.path),
        )
    cell, settings = settle(cell, PlanOptions())
    if tags is None:
        tags = _some(np.flatnonzero(key_tags(toolpath, cell.optimize)), most)
    spins = spin_values(step or cell.optimize.step, *cell.optimize.range)
    place(toolpath, cell)  # refuses tags without a pose: there are no curves for stand-ins
    problem = problem_of(toolpath, cell, settings)
    which, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    T = problem.placement.tcp(which, spin)
    q, branch = _followed(postures(problem, which, T, np.zeros(6)), len(tags))
    can = np.flatnonzero(np.isfinite(q[:, 0]))
    values = {name: np.full(len(q), np.nan) for name in INDICES}
    if len(can):
        context = context_of(problem, which[can], spin[can], T[can], q[can])
        for name, value in _indices(context).items():
            values[name][can] = value
    blocked = np.zeros(len(q), dtype=np.bool_)
    own = np.repeat(branch, len(spins))
    blocked[can] = _blocked(problem, which[can], q[can], spin[can], own[can])
    shape = (len(tags), len(spins))
    return SpinCurves(
        tags=np.asarray(tags, dtype=np.int64),
        names=tuple(toolpath.tag_name(int(tag)) for tag in tags),
        spins=spins,
        values={name: value.reshape(shape) for name, value in values.items()},
        blocked=blocked.reshape(shape),
        branch=branch,
        q=q.reshape(*shape, 6),
        coaxial=is_coaxial_with_axis_6(problem.kinematics, cell.tool.T_flange_tcp, cell.tool.axis),
    )


def _blocked(
    problem: Problem, tags: IndexArray, q: FloatArray, spin: FloatArray, branch: IndexArray
) -> BoolArray:
    """Return (m,) whether a state at a tag collides or has a stroke that cannot be run."""
    strokes = strokes_of(problem.toolpath, problem.cell.motion.approach)
    checker = Checker(
        problem, strokes, Scene.shared(problem.cell, problem.kinematics).kept(MORE_CLEARANCE)
    )
    return ~checker.states(tags, q, spin, branch).good


def _some(keys: IndexArray, most: int) -> IndexArray:
    if len(keys) <= most:
        return keys
    return np.asarray(keys[np.unique(np.linspace(0, len(keys) - 1, most).round().astype(int))])


def _followed(found: Postures, count: int) -> tuple[FloatArray, IndexArray]:
    """Return joints (t*s, 6), NaN where the branch of the tag cannot, and the branch (t,)."""
    good = found.good
    branch = np.argmax(good.reshape(count, -1, good.shape[1]).sum(axis=1), axis=1)
    own = np.arange(len(good)), np.repeat(branch, len(good) // count)
    return np.where(good[own][:, None], found.q[own], np.nan), branch.astype(np.int64)


def _indices(context: StateContext) -> dict[str, FloatArray]:
    """Return the indices (m,) [N/m] of states by name."""
    J, c, axis = context.jacobian, context.compliance, context.tool_axis
    across = cross_axes(np.asarray(context.cell.tool.axis))
    first, second = (context.R_robroot_tcp @ side for side in across)
    k_y, k_z = index.ellipsoid(J, c, first), index.ellipsoid(J, c, second)
    return {
        "axial": index.directional(J, c, axis),
        "radial": index.radial(J, c, axis),
        "normal": index.directional(J, c, context.normal),
        "first_cross": index.directional(J, c, first),
        "second_cross": index.directional(J, c, second),
        "ellipsoid_kx": index.ellipsoid(J, c, axis),
        "ellipsoid_ky": k_y,
        "ellipsoid_kz": k_z,
        "ellipsoid_kv": index.ellipsoid_normal(k_y, k_z, context.spin),
    }


def spin_degrees(curves: SpinCurves) -> FloatArray:
    """Return the spins (s,) in degrees, without rounding tails."""
    return np.asarray(np.round(curves.spins / DEG, 6))
