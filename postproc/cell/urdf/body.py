"""What hangs on the links of a URDF chain: parts fixed to them, and their masses."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.urdf.chain import UrdfChain
from postproc.errors import CellError, SourceRef
from postproc.geometry import inverse, rotation_from_abc, transform


def link_inertia(chain: UrdfChain) -> tuple[FloatArray | None, FloatArray | None]:
    """Return masses (6,) [kg] and centres (6, 3) [m] of links 1..6, None if any has no mass.

    The centres are in the link frames of the file.
    """
    mass, moment = np.zeros(6), np.zeros((6, 3))
    moving = [joint.child for joint in chain.moving]
    for link, T_link_part, element in fixed_parts(chain, moving):
        for inertial in element.findall("inertial"):
            own_mass = values_of(inertial.find("mass"), "value", 1, 0.0, chain.path)[0]
            centre = T_link_part @ origin_of(inertial, chain.path)
            mass[link] += own_mass
            moment[link] += own_mass * centre[:3, 3]
    if not (mass > 0.0).all():
        return None, None
    return mass, moment / mass[:, None]


def fixed_parts(chain: UrdfChain, links: list[str]) -> Iterator[tuple[int, FloatArray, ET.Element]]:
    """Yield number in ``links``, pose of a part in that link, and the part's <link> element.

    The parts of a link are itself and all that fixed joints hold to it.
    """
    elements = {str(link.get("name")): link for link in chain.tree.findall("link")}
    below: dict[str, list[tuple[str, FloatArray]]] = {}
    for joint in chain.all_joints:
        if joint.kind == "fixed":
            T_parent_child = origin_of(joint.element, chain.path)
            below.setdefault(joint.parent, []).append((joint.child, T_parent_child))
            below.setdefault(joint.child, []).append((joint.parent, inverse(T_parent_child)))
    for number, link in enumerate(links):
        waiting, seen = [(link, np.eye(4))], set()
        while waiting:
            name, T_link_part = waiting.pop()
            if name in seen:
                continue
            seen.add(name)
            yield number, T_link_part, elements[name]
            for child, T_parent_child in below.get(name, ()):
                waiting.append((child, T_link_part @ T_parent_child))


def origin_of(element: ET.Element, path: Path) -> FloatArray:
    """Return the pose (4, 4) of an element's <origin>; roll, pitch, yaw turn about fixed axes."""
    origin = element.find("origin")
    xyz = values_of(origin, "xyz", 3, 0.0, path)
    roll, pitch, yaw = values_of(origin, "rpy", 3, 0.0, path)
    return transform(rotation_from_abc(np.array([yaw, pitch, roll])), xyz)


def values_of(
    element: ET.Element | None, key: str, count: int, default: float, path: Path
) -> FloatArray:
    """Return the numbers (count,) of an attribute, ``default`` where it is not given.

    Raises:
        CellError: CEL011 if they are not that many finite numbers.
    """
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
