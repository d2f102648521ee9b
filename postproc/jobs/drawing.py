"""A cell made ready to be drawn on a page."""

from __future__ import annotations

import numpy as np

from postproc.cell import Cell
from postproc.collision import Scene
from postproc.kinematics import build
from postproc.report.parts import Drawing, Solid

MAX_FACES = 60_000
"""Faces of all solids together on a page; finer meshes are thinned."""
_FEWEST_FACES = 500


def drawing_of(cell: Cell, scene: Scene | None = None) -> Drawing:
    """Return the drawing of a cell, with the solids of ``scene`` where that is known."""
    kinematics, zero = build(cell.robot), np.zeros(6)
    scene = scene or Scene.shared(cell, kinematics)
    most = max(_FEWEST_FACES, MAX_FACES // max(len(scene.bodies), 1))
    return Drawing(
        cell,
        kinematics.link_frames(zero),
        kinematics.jacobian(zero)[3:, :].T,
        tuple(
            Solid(body.name, body.kind, body.link, body.vertices, body.faces)
            for body in scene.display_bodies(most)
        ),
    )
