"""Collision geometry of a URDF file, by link."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import (
    UrdfGeometry,
    fixed_parts,
    origin_of,
    read_chain,
    resolved_mesh,
    values_of,
)
from postproc.collision.mesh import Mesh, box, cylinder, load_mesh, loft, ring
from postproc.errors import CellError, Finding, Severity, SourceRef

_FORMATS = (".stl", ".obj", ".ply", ".off")
_BALL_RINGS = 8


def urdf_links(geometry: UrdfGeometry) -> tuple[list[list[Mesh]], list[Finding]]:
    """Return the collision solids of links 0..6, each in its link frame, as far as they exist.

    Link 0 is all that does not move; what is fixed to a moving link belongs to it. A link of which
    one mesh file is missing or of another format, or that has none, gets none; a warning says so.

    Raises:
        CellError: COL001 to COL004 for a mesh file that is there but broken, COL006 for a
            size that is not above zero.
    """
    chain = read_chain(geometry.path, geometry.tip)
    names = [chain.root, *(joint.child for joint in chain.moving)]
    solids: list[list[Mesh]] = [[] for _ in names]
    lacking: dict[int, str] = {}
    for index, T_link_part, element in fixed_parts(chain, names):
        for collision in element.findall("collision"):
            mesh, lacks = _solid(collision, geometry.path)
            if mesh is None:
                lacking.setdefault(index, lacks)
            else:
                solids[index].append(mesh.moved(T_link_part))
    for index in range(len(names)):
        if not solids[index]:
            lacking.setdefault(index, "no collision geometry in the URDF file")
    findings = []
    for index, lacks in sorted(lacking.items()):
        solids[index] = []
        text = f"link {index}: {lacks}; a simple hull is used"
        findings.append(Finding(Severity.WARNING, "COL102", text))
    return solids, findings


def _solid(collision: ET.Element, path: Path) -> tuple[Mesh | None, str]:
    """Return a collision element as a mesh in its link, or what is missing for it."""
    T_link_solid = origin_of(collision)
    shape = next(iter(collision.find("geometry") or ()), None)
    if shape is None:
        return None, "collision element without geometry"
    if shape.tag == "mesh":
        file = resolved_mesh(str(shape.get("filename", "")), path)
        if file is None or file.suffix.lower() not in _FORMATS:
            return (
                None,
                f"collision mesh {shape.get('filename')!r} is missing or in an unknown format",
            )
        scale = values_of(shape, "scale", 3, 1.0)
        mesh = load_mesh(file, 1.0)
        mesh = Mesh(mesh.vertices * scale, mesh.faces)
    elif shape.tag == "box":
        mesh = box(_sizes(shape, "size", 3, path))
    elif shape.tag == "cylinder":
        radius, length = (_sizes(shape, key, 1, path) for key in ("radius", "length"))
        mesh = cylinder(float(radius[0]), float(length[0]))
    elif shape.tag == "sphere":
        mesh = _ball(float(_sizes(shape, "radius", 1, path)[0]))
    else:
        return None, f"collision geometry <{shape.tag}> is not known"
    return mesh.moved(T_link_solid), ""


def _sizes(shape: ET.Element, key: str, count: int, path: Path) -> FloatArray:
    values = values_of(shape, key, count, np.nan)
    if not (values > 0.0).all():
        raise CellError(
            "COL006",
            f"<{shape.tag}>: {key} is {shape.get(key)!r}, expected lengths above zero",
            SourceRef(str(path)),
        )
    return values


def _ball(radius: float) -> Mesh:
    """Return a closed polyhedron that encloses a ball [m]."""
    angle = np.pi * (np.arange(_BALL_RINGS) + 0.5) / _BALL_RINGS
    wide = radius / np.cos(np.pi / (2 * _BALL_RINGS)) ** 2
    sections = [ring(wide * float(np.sin(a)), 2 * _BALL_RINGS) for a in angle]
    return loft(sections, [-wide * float(np.cos(a)) for a in angle])
