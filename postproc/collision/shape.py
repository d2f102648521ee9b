"""What culling needs to know of a body: its box, its reach, its connected parts."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.collision.boxes import fit_box
from postproc.collision.inside import Parts, parts_of
from postproc.collision.mesh import Mesh
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Shape:
    """A body in the frame of its link (or robroot).

    ``centre`` (3,), ``axes`` (3, 3) as columns and ``half`` (3,) are the box of the whole body;
    ``reach``: farthest vertex from ``centre`` [m].
    """

    mesh: Mesh
    parts: Parts
    centre: FloatArray
    axes: FloatArray
    half: FloatArray
    reach: float

    @staticmethod
    def of(mesh: Mesh) -> Shape:
        """Return the shape of a mesh."""
        centre, axes, half = fit_box(mesh.vertices, mesh.corners)
        reach = float(np.linalg.norm(mesh.vertices - centre, axis=1).max())
        return Shape(mesh, parts_of(mesh), centre, axes, half, reach)
