"""Masses of the links of a URDF chain; whatever is fixed to a link is added to it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.errors import CellError, SourceRef
from postproc.frames import inverse, rotation_from_abc, transform
from postproc.model.arrays import FloatArray
from postproc.model.urdfchain import UrdfChain


def link_inertia(chain: UrdfChain) -> tuple[FloatArray | None, FloatArray | None]:
    """Return masses (6,) [kg] and centres (6, 3) [m] of links 1..6, None if any has no mass.

    The centres are in the link frames of the file.
    """
    mass, moment = np.zeros(6), np.zeros((6, 3))
    for link, T_link_part, element in _parts(chain):
        for inertial in element.findall("inertial"):
            own_mass = _values(inertial.find("mass"), "value", 1, 0.0, chain.path)[0]
            centre = T_link_part @ _origin(inertial, chain.path)
            mass[link] += own_mass
            moment[link] += own_mass * centre[:3, 3]
    if not (mass > 0.0).all():
        return None, None
    return mass, moment / mass[:, None]


def _parts(chain: UrdfChain) -> Iterator[tuple[int, FloatArray, ET.Element]]:
    """Yield number 0..5 of the moving link, pose of the part in it, and the part's element."""
    elements = {str(link.get("name")): link for link in chain.tree.findall("link")}
    below: dict[str, list[tuple[str, FloatArray]]] = {}
    for joint in chain.all_joints:
        if joint.kind == "fixed":
            T_parent_child = _origin(joint.element, chain.path)
            below.setdefault(joint.parent, []).append((joint.child, T_parent_child))
            below.setdefault(joint.child, []).append((joint.parent, inverse(T_parent_child)))
    for number, joint in enumerate(chain.moving):
        waiting, seen = [(joint.child, np.eye(4))], set()
        while waiting:
            name, T_link_part = waiting.pop()
            if name in seen:
                continue
            seen.add(name)
            yield number, T_link_part, elements[name]
            for child, T_parent_child in below.get(name, ()):
                waiting.append((child, T_link_part @ T_parent_child))


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
            f"<{tag}>: {key} is {text!r}, expected {count} finite values",
            SourceRef(str(path)),
        )
    return np.array(values)
