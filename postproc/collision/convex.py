"""Convex solids: vertices and faces in the frame of their box."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.collision.inside import Parts
from postproc.collision.mesh import Mesh, normals_of
from postproc.records import dataclass

MOST_FACES = 256
"""Triangles of a solid that is looked at."""
_FLAT = 1e-9
"""A vertex stands no farther out of a face of a convex solid than this [m]."""
_CORNERS = 8
"""Of a box: solids that share some of them are smaller."""
_SAME = 1e-10
"""Faces whose normals differ by less, and whose distances do [m], are one."""


@dataclass(frozen=True, slots=True)
class Convex:
    """A convex solid in the frame of its box: vertices (v, 3) [m], faces.

    ``normals`` (f, 3), outwards, and ``offsets`` (f,) [m]: inside is n x < offset for all.
    ``is_box``: it fills its box, whose half size says it all.
    """

    vertices: FloatArray
    normals: FloatArray
    offsets: FloatArray
    is_box: bool

    @staticmethod
    def of(
        mesh: Mesh, parts: Parts, centre: FloatArray, axes: FloatArray, half: FloatArray
    ) -> Convex | None:
        """Return the solid of a mesh if it is convex, in the frame of its box, else None."""
        if len(mesh.faces) > MOST_FACES or len(parts.oriented) != 1 or not parts.oriented[0]:
            return None
        vertices = (mesh.vertices[np.unique(mesh.faces)] - centre) @ axes
        corners = (mesh.corners - centre) @ axes
        normals = normals_of(corners)
        if np.einsum("ij,ij->", normals, corners[:, 0]) < 0.0:  # six times the volume
            normals = -normals
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        seen = size[:, 0] > 0.0
        normals = normals[seen] / size[seen]
        offsets = np.einsum("ij,ij->i", normals, corners[seen, 0])
        if not len(normals) or (normals @ vertices.T > offsets[:, None] + _FLAT).any():
            return None
        faces = np.column_stack([normals, offsets])
        faces = faces[np.unique(np.round(faces / _SAME), axis=0, return_index=True)[1]]
        is_box = bool((np.abs(np.abs(vertices) - half) <= _FLAT).all())
        is_box &= len(np.unique(np.sign(vertices), axis=0)) == _CORNERS
        return Convex(vertices, faces[:, :3].copy(), faces[:, 3].copy(), is_box)
