"""Collision geometry of a URDF file, by link."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from postproc.collision.mesh import Mesh, box, cylinder, load_mesh
from postproc.errors import CellError, Issue, Severity, SourceRef
from postproc.frames import rotation_x, rotation_y, rotation_z, transform
from postproc.model.arrays import FloatArray
from postproc.model.cell import UrdfGeometry
from postproc.model.urdfchain import read_chain

_FORMATS = (".stl", ".obj", ".ply", ".off")
_BALL_RINGS = 8


def urdf_links(geometry: UrdfGeometry) -> tuple[list[list[Mesh]], list[Issue]]:
    """Return the collision solids of links 0..6, each in its link frame, as far as they exist.

    Link 0 is all that does not move; what is fixed to a moving link belongs to it. A link of which
    one mesh file is missing or of another format gets none, and a warning says so.

    Raises:
        CellError: COL001 to COL004 for a mesh file that is there but broken, COL006 for numbers
            that cannot be read.
    """
    chain = read_chain(geometry.path, geometry.tip)
    elements = {str(link.get("name")): link for link in chain.tree.findall("link")}
    solids: list[list[Mesh]] = [[] for _ in range(7)]
    issues: list[Issue] = []
    index, T_link_part = 0, np.eye(4)
    parts = [(chain.root, 0, T_link_part)]
    for joint in chain.joints:
        if joint in chain.moving:
            index, T_link_part = index + 1, np.eye(4)
        else:
            T_link_part = T_link_part @ _origin(joint.element, geometry.path)
        parts.append((joint.child, index, T_link_part))
    for name, index, T_link_part in parts:
        for collision in elements[name].findall("collision"):
            mesh, lacks = _solid(collision, geometry.path)
            if mesh is None:
                text = f"link {index}: {lacks}; a simple hull stands in for it"
                issues.append(Issue(Severity.WARNING, "COL102", text))
                solids[index] = []
                break
            solids[index].append(mesh.moved(T_link_part))
    return solids, issues


def _solid(collision: ET.Element, path: Path) -> tuple[Mesh | None, str]:
    """Return a collision element as a mesh in its link, or what is missing for it."""
    T_link_solid = _origin(collision, path)
    shape = next(iter(collision.find("geometry") or ()), None)
    if shape is None:
        return None, "collision element without geometry"
    if shape.tag == "mesh":
        file = _resolved(str(shape.get("filename", "")), path)
        if file is None or file.suffix.lower() not in _FORMATS:
            return (
                None,
                f"collision mesh {shape.get('filename')!r} is missing or of no known format",
            )
        scale = _numbers(shape.get("scale") or "1 1 1", 3, path)
        mesh = load_mesh(file, 1.0)
        mesh = Mesh(mesh.vertices * scale, mesh.faces)
    elif shape.tag == "box":
        mesh = box(_numbers(shape.get("size"), 3, path))
    elif shape.tag == "cylinder":
        radius, length = _numbers(f"{shape.get('radius')} {shape.get('length')}", 2, path)
        mesh = cylinder(float(radius), float(length))
    elif shape.tag == "sphere":
        mesh = _ball(float(_numbers(shape.get("radius"), 1, path)[0]))
    else:
        return None, f"collision geometry <{shape.tag}> is not known"
    return mesh.moved(T_link_solid), ""


def _resolved(name: str, path: Path) -> Path | None:
    """Return the file of a URDF mesh name; ``package://`` is looked for in the folders above."""
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        folders = [parent for parent in path.resolve().parents]
        candidates = [f / rest for f in folders if f.name == package]
        candidates += [f / package / rest for f in folders]
    else:
        candidates = [path.parent / name.removeprefix("file://")]
    return next((file for file in candidates if file.is_file()), None)


def _origin(element: ET.Element, path: Path) -> FloatArray:
    """Return the transform of an ``<origin xyz rpy>``: fixed axes x, then y, then z."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = _numbers(origin.get("rpy") or "0 0 0", 3, path)
    R = rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
    return transform(R, _numbers(origin.get("xyz") or "0 0 0", 3, path))


def _numbers(text: str | None, count: int, path: Path) -> FloatArray:
    try:
        values = np.array([float(word) for word in str(text).split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not np.isfinite(values).all():
        raise CellError(
            "COL006",
            f"collision geometry: found {text!r}, expected {count} numbers",
            SourceRef(str(path)),
        )
    return values


def _ball(radius: float) -> Mesh:
    """Return a closed polyhedron that encloses a ball [m]."""
    from postproc.collision.mesh import loft, ring

    angle = np.pi * (np.arange(_BALL_RINGS) + 0.5) / _BALL_RINGS
    wide = radius / np.cos(np.pi / (2 * _BALL_RINGS)) ** 2
    sections = [ring(wide * float(np.sin(a)), 2 * _BALL_RINGS) for a in angle]
    return loft(sections, [-wide * float(np.cos(a)) for a in angle])
