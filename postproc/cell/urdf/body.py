"""What hangs on the links of a URDF chain: parts fixed to them, and their masses."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.urdf.chain import UrdfChain
from postproc.cell.urdf.numbers import origin_of, values_of
from postproc.geometry import inverse


def link_inertia(chain: UrdfChain) -> tuple[FloatArray | None, FloatArray | None]:
    """Return masses (6,) [kg] and centres (6, 3) [m] of links 1..6, None if any has no mass.

    The centres are in the link frames of the file.
    """
    mass, moment = np.zeros(6), np.zeros((6, 3))
    moving = [joint.child for joint in chain.moving]
    for link, T_link_part, element in fixed_parts(chain, moving):
        for inertial in element.findall("inertial"):
            own_mass = values_of(inertial.find("mass"), "value", 1, 0.0)[0]
            centre = T_link_part @ origin_of(inertial)
            mass[link] += own_mass
            moment[link] += own_mass * centre[:3, 3]
    if not (mass > 0.0).all():
        return None, None
    return mass, moment / mass[:, None]


def has_inertia(chain: UrdfChain) -> bool:
    """Return whether every one of the links 1..6 has a mass and an inertia about all axes."""
    mass, turning = np.zeros(6), np.zeros((6, 3))
    moving = [joint.child for joint in chain.moving]
    for link, _, element in fixed_parts(chain, moving):
        for inertial in element.findall("inertial"):
            mass[link] += values_of(inertial.find("mass"), "value", 1, 0.0)[0]
            tensor = inertial.find("inertia")
            for axis, key in enumerate(("ixx", "iyy", "izz")):
                turning[link, axis] += values_of(tensor, key, 1, 0.0)[0]
    return bool((mass > 0.0).all() and (turning > 0.0).all())


def fixed_parts(chain: UrdfChain, links: list[str]) -> Iterator[tuple[int, FloatArray, ET.Element]]:
    """Yield number in ``links``, pose of a part in that link, and the part's <link> element.

    The parts of a link are itself and all that fixed joints hold to it.
    """
    elements = {str(link.get("name")): link for link in chain.tree.findall("link")}
    below: dict[str, list[tuple[str, FloatArray]]] = {}
    for joint in chain.all_joints:
        if joint.kind == "fixed":
            T_parent_child = origin_of(joint.element)
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
