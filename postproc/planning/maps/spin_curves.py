"""How stiff the tool is over the rotation about its axis, tag by tag.

The curves of Figures 19 to 24 of Jiao et al. 2022, with the true stiffness beside their indices.

For every tag and spin all inverse kinematic branches are looked at; a curve follows the branch
that serves most spins of its tag, so that it does not jump between postures. Spins that the arm
cannot take (reach, limits, straight wrist) are gaps. The best spin is one of those that can be run:
free of collision, with the whole stroke of a hole.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import CellError, SourceRef
from postproc.kinematics import is_coaxial_with_axis_6
from postproc.model import ToolPath
from postproc.planning.checks import Checker
from postproc.planning.job import checker_of
from postproc.planning.search import key_tags
from postproc.planning.states import (
    Postures,
    StateContext,
    context_of,
    cross_axes,
    place,
    postures,
    settle,
    spin_values,
    stiffness_of,
)
from postproc.process import Assignment, as_served, assign
from postproc.records import dataclass
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

    tags (t,) indices of the toolpath; names (t,); tools (t,): TOOL numbers; spins (s,) [rad];
    values: index name to (t, s) [N/m], NaN where the arm cannot take the spin; blocked (t, s):
    something collides there, or the stroke cannot be run; branch (t,); q (t, s, 6);
    coaxial (t,): the axis of the tag's tool lies on axis 6, where the spin changes nothing.
    """

    tags: IndexArray
    names: tuple[str, ...]
    tools: tuple[int, ...]
    spins: FloatArray
    values: Mapping[str, FloatArray]
    blocked: BoolArray
    branch: IndexArray
    q: FloatArray
    coaxial: BoolArray

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
        CellError: PLN208 if neither the cell nor a model gives joint stiffness; WRD002, WRD020 if
            no tag has a tool and a base in the cell.
    """
    if stiffness_of(cell) is None:
        raise CellError(
            "PLN208",
            "no joint stiffness: the cell has no [stiffness] and no --model is given",
            SourceRef(cell.path),
        )
    cell, settings = settle(cell)
    assigned = assign(as_served(toolpath, cell), cell)
    toolpath, stretches = assigned.toolpath, [s for s in assigned.stretches() if s.is_assigned]
    if tags is None:
        keys = [
            key_tags(toolpath.rows(np.arange(s.low, s.high)), cell.optimize).nonzero()[0] + s.low
            for s in stretches
        ]
        tags = _some(np.concatenate(keys), most)
    tags = _with_frames(np.asarray(tags, dtype=np.int64), assigned)
    spins = spin_values(step or cell.optimize.step, *cell.optimize.range)
    pieces = []
    for stretch in stretches:
        own = tags[(tags >= stretch.low) & (tags < stretch.high)]
        if len(own):
            part = toolpath.rows(np.arange(stretch.low, stretch.high))
            here = cell.with_tool(stretch.tool, stretch.base)
            place(part, here)  # refuses tags without a pose: there are no curves for stand-ins
            checker = checker_of(part, here, settings)
            pieces.append(_curves(checker, own - stretch.low, spins))
    shape = (-1, len(spins))
    order = np.argsort(np.argsort(tags, kind="stable"), kind="stable")
    columns = [np.concatenate(column)[order] for column in zip(*pieces, strict=True)]
    q, branch, blocked, coaxial, *values = columns
    return SpinCurves(
        tags=tags,
        names=tuple(toolpath.tag_name(int(tag)) for tag in tags),
        tools=tuple(cell.tools[index].number for index in assigned.tool[tags]),
        spins=spins,
        values=dict(zip(INDICES, (value.reshape(shape) for value in values), strict=True)),
        blocked=blocked.reshape(shape),
        branch=branch,
        q=q,
        coaxial=coaxial,
    )


def _with_frames(tags: IndexArray, assigned: Assignment) -> IndexArray:
    """Return the tags that have a tool and a base."""
    kept = tags[(assigned.tool[tags] >= 0) & (assigned.base[tags] >= 0)]
    if len(tags) and not len(kept):
        worst = next(finding for finding in assigned.findings if finding.is_error)
        raise CellError(worst.code, worst.message, worst.source, worst.hint)
    return kept


def _curves(checker: Checker, tags: IndexArray, spins: FloatArray) -> tuple[FloatArray, ...]:
    """Return q (t, s, 6), branch (t,), blocked (t, s), coaxial (t,) and the indices (t, s)."""
    problem, width = checker.problem, len(spins)
    which, spin = np.repeat(tags, width), np.tile(spins, len(tags))
    T = problem.placement.tcp(which, spin)
    q, branch = _followed(postures(problem, which, T, np.zeros(6)), len(tags))
    can = np.flatnonzero(np.isfinite(q[:, 0]))
    values = {name: np.full(len(q), np.nan) for name in INDICES}
    if len(can):
        context = context_of(problem, which[can], spin[can], T[can], q[can])
        for name, value in _indices(context).items():
            values[name][can] = value
    blocked = np.zeros(len(q), dtype=np.bool_)
    own = np.repeat(branch, width)
    blocked[can] = ~checker.states(which[can], q[can], spin[can], own[can]).good
    tool = problem.cell.tool
    coaxial = is_coaxial_with_axis_6(problem.kinematics, tool.T_flange_tcp, tool.axis)
    shape = (len(tags), width)
    return (
        q.reshape(*shape, 6),
        branch,
        blocked.reshape(shape),
        np.full(len(tags), coaxial),
        *(value.reshape(shape) for value in values.values()),
    )


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
