"""Masses and collision solids of the links of a URDF chain.

Whatever hangs on a link by fixed joints belongs to it: its mass is added and its solids move along.
Link 0 is everything that does not move, link 6 includes the flange and what is fixed to it.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.errors import CellError, SourceRef
from postproc.frames import inverse, rotation_from_abc, transform
from postproc.model.arrays import FloatArray
from postproc.model.cell import MeshPlacement
from postproc.model.urdfchain import UrdfChain

_READABLE = (".stl", ".obj", ".ply", ".off")
_PACKAGE = "package://"


def link_inertia(chain: UrdfChain) -> tuple[FloatArray | None, FloatArray | None]:
    """Return masses (6,) [kg] and centres (6, 3) [m] of links 1..6, None if any has no mass.

    The centres are in the link frames of the file.
    """
    mass, moment = np.zeros(6), np.zeros((6, 3))
    for link, T_link_part, element in _parts(chain):
        for inertial in element.findall("inertial"):
            own_mass = _values(inertial.find("mass"), "value", 1, 0.0, chain.path)[0]
            centre = T_link_part @ _origin(inertial, chain.path)
            if link > 0:
                mass[link - 1] += own_mass
                moment[link - 1] += own_mass * centre[:3, 3]
    if not (mass > 0.0).all():
        return None, None
    return mass, moment / mass[:, None]


def link_solids(
    chain: UrdfChain,
) -> tuple[tuple[tuple[int, MeshPlacement], ...], tuple[str, ...]]:
    """Return the collision solids as (link 0..6, solid) and the mesh files that were not found.

    A sphere becomes the cylinder around it. Mesh files are searched beside the URDF and, for
    ``package://``, in the folders above it.
    """
    solids: list[tuple[int, MeshPlacement]] = []
    missing: list[str] = []
    for link, T_link_part, element in _parts(chain):
        for collision in element.findall("collision"):
            T_link_solid = T_link_part @ _origin(collision, chain.path)
            name = str(element.get("name"))
            geometry = collision.find("geometry")
            for shape in geometry if geometry is not None else ():
                solid = _solid(shape, name, T_link_solid, chain.path)
                if solid is None:
                    missing.append(str(shape.get("filename")))
                else:
                    solids.append((link, solid))
    return tuple(solids), tuple(missing)


def _parts(chain: UrdfChain) -> Iterator[tuple[int, FloatArray, ET.Element]]:
    """Yield moving link number, pose of the part in that link, and the part's element."""
    elements = {str(link.get("name")): link for link in chain.tree.findall("link")}
    below: dict[str, list[tuple[str, FloatArray]]] = {}
    for joint in chain.all_joints:
        if joint.kind == "fixed":
            T_parent_child = _origin(joint.element, chain.path)
            below.setdefault(joint.parent, []).append((joint.child, T_parent_child))
            below.setdefault(joint.child, []).append((joint.parent, inverse(T_parent_child)))
    heads = [chain.root, *(joint.child for joint in chain.moving)]
    for number, head in enumerate(heads):
        waiting, seen = [(head, np.eye(4))], set()
        while waiting:
            name, T_link_part = waiting.pop()
            if name in seen:
                continue
            seen.add(name)
            yield number, T_link_part, elements[name]
            for child, T_parent_child in below.get(name, ()):
                waiting.append((child, T_link_part @ T_parent_child))


def _solid(
    shape: ET.Element, name: str, T_link_solid: FloatArray, path: Path
) -> MeshPlacement | None:
    """Return a solid, None for a mesh file that is not there or of a kind that is not read."""
    if shape.tag == "box":
        size = _values(shape, "size", 3, 0.0, path)
        return MeshPlacement(name, T_link_solid, size=size)
    if shape.tag in ("cylinder", "sphere"):
        radius = float(_values(shape, "radius", 1, 0.0, path)[0])
        length = float(_values(shape, "length", 1, 2.0 * radius, path)[0])
        return MeshPlacement(name, T_link_solid, radius=radius, length=length)
    file = _found(str(shape.get("filename", "")), path)
    if file is None or file.suffix.lower() not in _READABLE:
        return None
    scale = _values(shape, "scale", 3, 1.0, path)
    if not np.allclose(scale, scale[0]):
        return None
    return MeshPlacement(name, T_link_solid, file=file, scale=float(scale[0]))


def _found(name: str, path: Path) -> Path | None:
    if not name.startswith(_PACKAGE):
        file = path.parent / name.removeprefix("file://")
        return file if file.is_file() else None
    inside = Path(name.removeprefix(_PACKAGE))
    tails = (inside, Path(*inside.parts[1:]))
    folders = (path.parent, *path.absolute().parents)
    return next((f / t for f in folders for t in tails if (f / t).is_file()), None)


def _origin(element: ET.Element, path: Path) -> FloatArray:
    """Return the pose (4, 4) of an element's <origin>; roll, pitch, yaw turn about fixed axes."""
    origin = element.find("origin")
    xyz = _values(origin, "xyz", 3, 0.0, path)
    roll, pitch, yaw = _values(origin, "rpy", 3, 0.0, path)
    return transform(rotation_from_abc(np.array([yaw, pitch, roll])), xyz)


def _values(
    element: ET.Element | None, key: str, count: int, default: float, path: Path
) -> FloatArray:
    text = element.get(key) if element is not None else None
    if text is None:
        return np.full(count, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        tag = element.tag if element is not None else "?"
        raise CellError(
            "CEL011",
            f"<{tag}>: {key} is {text!r}, expected {count} numbers",
            SourceRef(str(path)),
        )
    return np.array(values)
