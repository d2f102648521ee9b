"""A cell made ready to be drawn on a page."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from postproc.cell import Cell, ExternalAxis
from postproc.collision import Body, Scene
from postproc.kinematics import Kinematics, build
from postproc.report.parts import Drawing, Solid

MAX_FACES = 60_000
"""Faces of all solids together on a page; finer meshes are thinned."""
_FEWEST_FACES = 500
_FOOT, _GAUGE, _BEAM = 0.6, 0.4, 0.12
"""Of a rail as it is drawn [m]: half the robot's foot, half of what lies between the beams, and how
wide these are. It is a picture: a rail that can be hit stands in the cell as an obstacle."""
_ALONG = 0.1
"""Sine below which a rail runs along the robot's own upright."""
_BOX = np.reshape(list(map(int, "021123456576014154263367042246135375")), (12, 3))
"""Triangles of a box whose corners run through its ends, sides and heights."""


def drawing_of(cell: Cell, *, every: bool = False) -> Drawing:
    """Return the drawing of a cell with the tool and the setup in work, or with ``every`` one."""
    kinematics, zero = build(cell.robot), np.zeros(6)
    found = list(_all(cell, kinematics) if every else _at_work(cell, kinematics))
    rails = [_rail(cell, axis) for axis in cell.external_axes if axis.kind == "rail"]
    most = max(_FEWEST_FACES, MAX_FACES // max(len(found), 1))
    thinned = ((body.coarse(most), tool, bases) for body, tool, bases in found)
    return Drawing(
        cell,
        kinematics.link_frames(zero),
        kinematics.jacobian(zero)[3:, :].T,
        kinematics.fk(zero),
        (
            *(
                Solid(body.name, body.kind, body.link, body.vertices, body.faces, tool, bases)
                for body, tool, bases in thinned
            ),
            *rails,
        ),
    )


def _rail(cell: Cell, axis: ExternalAxis) -> Solid:
    """Return the two beams on which a robot rides, under its foot all along its way."""
    T, way = np.asarray(cell.robot.T_world_robroot), np.asarray(axis.axis)
    up = T[:3, 2]
    side = np.cross(way, up) if np.linalg.norm(np.cross(way, up)) > _ALONG else T[:3, 1]
    side = side / np.linalg.norm(side)
    ends = np.array([axis.q_min - _FOOT, axis.q_max + _FOOT])
    beams = [
        T[:3, 3] + end * way + (sign * _GAUGE + across * _BEAM) * side + (below - 1.0) * _BEAM * up
        for sign in (-1.0, 1.0)
        for end, across, below in product(ends, (-0.5, 0.5), (-1.0, 0.0))
    ]
    faces = np.vstack([_BOX, _BOX + 8])
    return Solid(f"rail {axis.name}", "rail", -1, np.array(beams), faces)


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
