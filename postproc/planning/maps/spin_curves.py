"""How stiff the tool is over the rotation about its axis, tag by tag.

The curves of Figures 19 to 24 of Jiao et al. 2022, with the true stiffness beside their indices.

For every tag and spin all inverse kinematic branches are looked at; a curve follows the branch
that serves most spins of its tag, so that it does not jump between postures. Spins that the arm
cannot take (reach, limits, straight wrist) are gaps; collisions are the planner's business.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import CellError, SourceRef
from postproc.kinematics import Kinematics, build, is_coaxial_with_axis_6, wrist_distance
from postproc.model import ToolPath
from postproc.planning.search import key_tags
from postproc.planning.states import (
    Compliance,
    PlanOptions,
    cross_axes,
    path_normals,
    place,
    settle,
    spin_values,
    stiffness_of,
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
    [N/m], NaN where the arm cannot take the spin; branch (t,); q (t, s, 6); coaxial: the tool
    axis lies on axis 6, where the spin changes nothing.
    """

    tags: IndexArray
    names: tuple[str, ...]
    spins: FloatArray
    values: Mapping[str, FloatArray]
    branch: IndexArray
    q: FloatArray
    coaxial: bool

    def best(self, name: str) -> IndexArray:
        """Return the best spin (t,) of an index as a number in ``spins``, -1 without any."""
        values = self.values[name]
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
    c_joint = stiffness_of(cell)
    if c_joint is None:
        raise CellError(
            "PLN208",
            "no joint stiffness: the cell has no [stiffness] and no --model is given",
            SourceRef(cell.path),
        )
    cell, _ = settle(cell, PlanOptions())
    if tags is None:
        tags = _some(np.flatnonzero(key_tags(toolpath, cell.optimize)), most)
    spins = spin_values(step or cell.optimize.step, *cell.optimize.range)
    placement = place(toolpath, cell)
    pairs = np.repeat(tags, len(spins))
    T_base_tcp = placement.tcp(pairs, np.tile(spins, len(tags)))
    kinematics = build(cell.robot)
    q, branch = _postures(placement.flange(T_base_tcp), kinematics, cell, len(tags))
    R_robroot_tcp = placement.T_robroot_base[:3, :3] @ T_base_tcp[:, :3, :3]
    normal = np.repeat(path_normals(toolpath, placement)[tags], len(spins), axis=0)
    values = _indices(q, R_robroot_tcp, normal, np.tile(spins, len(tags)), cell, c_joint)
    shape = (len(tags), len(spins))
    return SpinCurves(
        tags=np.asarray(tags, dtype=np.int64),
        names=tuple(toolpath.tag_name(int(tag)) for tag in tags),
        spins=spins,
        values={name: value.reshape(shape) for name, value in values.items()},
        branch=branch,
        q=q.reshape(*shape, 6),
        coaxial=is_coaxial_with_axis_6(kinematics, cell.tool.T_flange_tcp, cell.tool.axis),
    )


def _some(keys: IndexArray, most: int) -> IndexArray:
    if len(keys) <= most:
        return keys
    return np.asarray(keys[np.unique(np.linspace(0, len(keys) - 1, most).round().astype(int))])


def _postures(
    T_robroot_flange: FloatArray, kinematics: Kinematics, cell: Cell, count: int
) -> tuple[FloatArray, IndexArray]:
    """Return joints (t*s, 6), NaN where the branch of the tag cannot, and the branch (t,)."""
    slots, valid = kinematics.ik(T_robroot_flange)
    turned = kinematics.nearest(slots, np.zeros(6))
    good: BoolArray = valid & kinematics.within_limits(turned, cell.limits.joint_margin)
    good &= wrist_distance(kinematics, turned) >= cell.limits.singularity
    served = good.reshape(count, -1, good.shape[1]).sum(axis=1)
    branch = np.argmax(served, axis=1)
    of_row = np.repeat(branch, len(good) // count)
    rows = np.arange(len(good))
    q = np.where(good[rows, of_row][:, None], turned[rows, of_row], np.nan)
    return q, branch.astype(np.int64)


def _indices(
    q: FloatArray,
    R_robroot_tcp: FloatArray,
    normal: FloatArray,
    spin: FloatArray,
    cell: Cell,
    c_joint: Compliance,
) -> dict[str, FloatArray]:
    can = np.flatnonzero(np.isfinite(q[:, 0]))
    values = {name: np.full(len(q), np.nan) for name in INDICES}
    if len(can) == 0:
        return values
    kinematics = build(cell.robot)
    tcp = cell.tool.T_flange_tcp[:3, 3]
    J = kinematics.jacobian(q[can], tcp)
    c = c_joint(q[can])
    R = R_robroot_tcp[can]
    axis = R @ np.asarray(cell.tool.axis)
    first, second = (R @ across for across in cross_axes(np.asarray(cell.tool.axis)))
    values["axial"][can] = index.directional(J, c, axis)
    values["radial"][can] = index.radial(J, c, axis)
    values["normal"][can] = index.directional(J, c, normal[can])
    values["first_cross"][can] = index.directional(J, c, first)
    values["second_cross"][can] = index.directional(J, c, second)
    values["ellipsoid_kx"][can] = index.ellipsoid(J, c, axis)
    k_y = index.ellipsoid(J, c, first)
    k_z = index.ellipsoid(J, c, second)
    values["ellipsoid_ky"][can], values["ellipsoid_kz"][can] = k_y, k_z
    values["ellipsoid_kv"][can] = index.ellipsoid_normal(k_y, k_z, spin[can])
    return values


def spin_degrees(curves: SpinCurves) -> FloatArray:
    """Return the spins (s,) in degrees, without rounding tails."""
    return np.asarray(np.round(curves.spins / DEG, 6))
