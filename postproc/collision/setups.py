"""Which workpieces can stand in the cell together: two solids are never at one place.

A part that is clamped again in the same fixture is drawn twice, once in each setup. Where solids of
two setups overlap, the ones of the setup in work are there and those of the other are not. Setups
side by side stay: the tool can hit either.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, Workpiece
from postproc.collision.distance import Distances
from postproc.collision.inside import parts_of
from postproc.collision.mesh import Mesh, normals_of, solid
from postproc.collision.shape import Shape
from postproc.units import MM

TOUCHING = 0.1 * MM
"""By so much the surface of a solid is drawn in: solids that only touch do not overlap."""


def absent_bases(cell: Cell) -> tuple[int, ...]:
    """Return the setups whose workpieces cannot stand in the cell with the one in work.

    Raises:
        CellError: COL001 to COL005 naming the mesh file that cannot be used.
    """
    mine = cell.workpiece
    return tuple(
        index for index, base in enumerate(cell.bases) if base is not mine and _overlap(base, mine)
    )


@lru_cache(maxsize=64)
def _solids(base: _ById) -> tuple[Mesh, ...]:
    T = np.asarray(base.workpiece.T_robroot_base)
    return tuple(_inset(solid(placement).moved(T)) for placement in base.workpiece.meshes)


class _ById:
    """A workpiece as a cache key."""

    def __init__(self, workpiece: Workpiece) -> None:
        self.workpiece = workpiece

    def __hash__(self) -> int:
        return id(self.workpiece)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ById) and self.workpiece is other.workpiece


def _overlap(one: Workpiece, two: Workpiece) -> bool:
    return any(
        _share_space(mesh, other)
        for mesh in _solids(_ById(one))
        for other in _solids(_ById(two))
        if _boxes_meet(mesh, other)
    )


def _boxes_meet(one: Mesh, two: Mesh) -> bool:
    low = np.maximum(one.vertices.min(axis=0), two.vertices.min(axis=0))
    high = np.minimum(one.vertices.max(axis=0), two.vertices.max(axis=0))
    return bool((low <= high).all())


def _share_space(one: Mesh, two: Mesh) -> bool:
    """Return whether surfaces meet or one solid lies inside the other."""
    zero = np.zeros(1)
    pair, place = (np.array([0]), np.array([1])), (np.eye(3)[None], np.zeros((1, 3)))
    distances = Distances([Shape.of(mesh) for mesh in (one, two)])
    return bool(distances.distance(*pair, *place, zero, zero)[0] <= 0.0)


def _inset(mesh: Mesh) -> Mesh:
    """Return a closed solid with its surface drawn in by ``TOUCHING``; another mesh as it is."""
    parts = parts_of(mesh)
    if not parts.oriented.all():
        return mesh
    corners = mesh.corners
    normal = normals_of(corners)
    volume = np.einsum("fi,fi->f", corners[:, 0], normal)
    sign = np.sign(np.bincount(parts.label, volume))[parts.label]
    out: FloatArray = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(out, mesh.faces[:, k], sign[:, None] * normal)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    step = np.divide(out, length, out=np.zeros_like(out), where=length > 0.0)
    return Mesh(mesh.vertices - TOUCHING * step, mesh.faces)
