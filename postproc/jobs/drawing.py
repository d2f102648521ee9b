"""A cell made ready to be drawn on a page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.cell import Cell
from postproc.collision import Body, Scene
from postproc.kinematics import Kinematics, build
from postproc.report.parts import Drawing, Solid

MAX_FACES = 60_000
"""Faces of all solids together on a page; finer meshes are thinned."""
_FEWEST_FACES = 500


def drawing_of(cell: Cell, *, every: bool = False) -> Drawing:
    """Return the drawing of a cell with the tool and the setup in work, or with ``every`` one."""
    kinematics, zero = build(cell.robot), np.zeros(6)
    found = list(_all(cell, kinematics) if every else _at_work(cell, kinematics))
    most = max(_FEWEST_FACES, MAX_FACES // max(len(found), 1))
    thinned = ((body.coarse(most), tool, bases) for body, tool, bases in found)
    return Drawing(
        cell,
        kinematics.link_frames(zero),
        kinematics.jacobian(zero)[3:, :].T,
        kinematics.fk(zero),
        tuple(
            Solid(body.name, body.kind, body.link, body.vertices, body.faces, tool, bases)
            for body, tool, bases in thinned
        ),
    )


_Drawn = tuple[Body, int, tuple[int, ...]]
"""A solid, its tool and the setups in whose work it is there, as ``Solid`` has them."""


def _at_work(cell: Cell, kinematics: Kinematics) -> Iterator[_Drawn]:
    for body in Scene.shared(cell, kinematics).bodies:
        yield body, -1, ()


def _all(cell: Cell, kinematics: Kinematics) -> Iterator[_Drawn]:
    """Yield the solids of all tools and setups."""
    setups = [Scene.shared(cell.with_tool(0, k), kinematics).bodies for k in range(len(cell.bases))]
    there = [{body.base for body in bodies} for bodies in setups]
    for body in setups[0]:
        if body.kind in ("link", "obstacle"):
            yield body, -1, ()
    for tool in range(len(cell.tools)):
        for body in Scene.shared(cell.with_tool(tool), kinematics).bodies:
            if body.kind in ("tool", "cutting"):
                yield body, tool, ()
    for base, bodies in enumerate(setups):
        seen = tuple(k for k in range(len(setups)) if base in there[k])
        for body in bodies:
            if body.base == base:
                yield body, -1, seen
