"""Independent answers: coal for surfaces, the solid angle for what lies inside."""

from __future__ import annotations

import coal
import numpy as np

from postproc.collision.mesh import Mesh


class CoalMesh:
    """A mesh for coal."""

    def __init__(self, mesh: Mesh) -> None:
        vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for vertex in mesh.vertices:
            vertices.append(np.array(vertex))
        for face in mesh.faces:
            triangles.append(coal.Triangle(*(int(i) for i in face)))
        self.model = coal.BVHModelOBBRSS()
        self.model.beginModel(len(mesh.faces), len(mesh.vertices))
        self.model.addSubModel(vertices, triangles)
        self.model.endModel()


def _pose(T: np.ndarray) -> coal.Transform3s:
    return coal.Transform3s(np.ascontiguousarray(T[:3, :3]), np.array(T[:3, 3]))


def coal_collide(a: CoalMesh, T_a: np.ndarray, b: CoalMesh, T_b: np.ndarray) -> bool:
    """Whether the surfaces meet."""
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    return coal.collide(a.model, _pose(T_a), b.model, _pose(T_b), request, result) > 0


def coal_distance(a: CoalMesh, T_a: np.ndarray, b: CoalMesh, T_b: np.ndarray) -> float:
    """Distance of the surfaces [m]."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(a.model, _pose(T_a), b.model, _pose(T_b), request, result))


def winding_number(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Winding number (n,) by the sum of solid angles (van Oosterom and Strackee 1983)."""
    total = np.zeros(len(points))
    for corner in mesh.corners:
        a, b, c = (corner[k] - points for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        triple = np.einsum("ni,ni->n", a, np.cross(b, c))
        ab, bc, ca = ((u * v).sum(axis=1) for u, v in ((a, b), (b, c), (c, a)))
        total += 2.0 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
    return total / (4.0 * np.pi)
