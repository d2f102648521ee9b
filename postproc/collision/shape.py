"""What tests need to know of a solid: its box, its reach, its parts and convex pieces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from postproc.arrays import FloatArray
from postproc.collision.boxes import fit_box
from postproc.collision.inside import Parts, parts_of, probes_of
from postproc.collision.mesh import ByContent, Mesh
from postproc.collision.pieces import Pieces
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Shape:
    """A body in the frame of its link (or robroot).

    ``probes`` (k, 3) [m]: a vertex of each part; ``centre`` (3,), ``axes`` (3, 3) as columns and
    ``half`` (3,) are the box of the whole body; ``reach``: farthest vertex from ``centre`` [m].
    """

    mesh: Mesh
    parts: Parts
    pieces: Pieces
    probes: FloatArray
    centre: FloatArray
    axes: FloatArray
    half: FloatArray
    reach: float

    @staticmethod
    def of(mesh: Mesh) -> Shape:
        """Return the shape of a mesh, made once: when a part is moved, most solids stay."""
        return _shape(ByContent(mesh))


@lru_cache(maxsize=64)
def _shape(key: ByContent) -> Shape:
    mesh = key.mesh
    parts = parts_of(mesh)
    centre, axes, half = fit_box(mesh.vertices, mesh.corners)
    reach = float(np.linalg.norm(mesh.vertices - centre, axis=1).max())
    pieces, probes = Pieces.of(mesh, parts), probes_of(mesh, parts)
    return Shape(mesh, parts, pieces, probes, centre, axes, half, reach)
