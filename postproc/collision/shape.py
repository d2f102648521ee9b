"""What culling needs to know of a body: its box, boxes of its pieces, and points to test."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.collision.boxes import Boxes, fit_box
from postproc.collision.convex import Convex
from postproc.collision.inside import InsideTest, Parts, parts_of, probes_of
from postproc.collision.mesh import Mesh
from postproc.records import dataclass

FEWEST_FACES = 64
"""Pieces are not split below this number of triangles."""
MOST_PIECES = 256


@dataclass(frozen=True, slots=True)
class Shape:
    """A body in the frame of its link (or robroot): box, pieces, probes, inside test.

    ``centre`` (3,), ``axes`` (3, 3) as columns and ``half`` (3,) are the box of the whole body;
    ``pieces`` are boxes of groups of its triangles, ``low`` and ``high`` (k, 3) bound the pieces
    along the axes of the body's box, from its centre. ``probes`` (p, 3): one vertex of each
    connected part. ``reach``: farthest vertex from ``centre`` [m]. ``solid``: None if not convex.
    """

    mesh: Mesh
    centre: FloatArray
    axes: FloatArray
    half: FloatArray
    reach: float
    pieces: Boxes
    low: FloatArray
    high: FloatArray
    probes: FloatArray
    inside: InsideTest
    is_closed: bool
    solid: Convex | None

    @staticmethod
    def of(mesh: Mesh) -> Shape:
        """Return the shape of a mesh."""
        corners = mesh.corners
        centre, axes, half = fit_box(mesh.vertices, corners)
        parts = parts_of(mesh)
        groups = _groups(corners, parts)
        fitted = [fit_box(corners[g].reshape(-1, 3), corners[g]) for g in groups]
        local = (corners - centre) @ axes
        return Shape(
            mesh=mesh,
            centre=centre,
            axes=axes,
            half=half,
            reach=float(np.linalg.norm(mesh.vertices - centre, axis=1).max()),
            pieces=Boxes(*(np.stack(column) for column in zip(*fitted, strict=True))),
            low=np.stack([local[g].min(axis=(0, 1)) for g in groups]),
            high=np.stack([local[g].max(axis=(0, 1)) for g in groups]),
            probes=probes_of(mesh, parts),
            inside=InsideTest(mesh, parts),
            is_closed=bool(parts.closed.all()),
            solid=Convex.of(mesh, parts, centre, axes, half),
        )


def _groups(corners: FloatArray, parts: Parts) -> list[IntArray]:
    """Return groups of triangles that lie together: connected parts, large ones halved."""
    order = np.argsort(parts.label, kind="stable").astype(np.int32)
    sizes = np.bincount(parts.label)
    by_part = len(sizes) <= FEWEST_FACES
    groups = np.split(order, np.cumsum(sizes)[:-1]) if by_part else [order]
    largest = max(FEWEST_FACES, -(-2 * len(corners) // MOST_PIECES))
    # a part that needs no more than two pieces is often one convex solid: its box serves better
    pending = [(group, 2 * largest if by_part else largest) for group in groups]
    done: list[IntArray] = []
    middle = corners.mean(axis=1)
    while pending:
        group, allowed = pending.pop()
        if len(group) <= allowed:
            done.append(group)
            continue
        spread = np.ptp(middle[group], axis=0)
        along = np.argsort(middle[group, int(np.argmax(spread))], kind="stable")
        half = len(group) // 2
        pending += [(group[along[:half]], largest), (group[along[half:]], largest)]
    return done
