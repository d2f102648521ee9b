"""A robot from a URDF file: limits, speeds, masses, parts on its links; what lacks is assumed."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.cell import Robot, UrdfGeometry
from postproc.cell.choices import Origin, Provenance
from postproc.cell.robotfile import assumed_acceleration
from postproc.cell.urdf.chain import UrdfChain, read_chain
from postproc.cell.urdf.numbers import LARGEST, origin_of, values_of
from postproc.errors import SourceRef
from postproc.geometry import inverse
from postproc.units import DEG

_FULL_TURN = 360.0 * DEG
_ASSUMED_SPEED = 60.0 * DEG


def read_urdf_robot(path: Path, tip: str | None = None, source: SourceRef | None = None) -> Robot:
    """Return the robot of a URDF file, standing at the world's origin; arguments as ``read_chain``.

    A URDF gives no accelerations: they are assumed such that a joint reaches full speed in half a
    second. A continuous joint gets +-360 degrees, a missing speed 60 degrees per second; each is
    marked assumed in ``origins``. Efforts are the torques where all are above 0, no larger than a
    real arm's, and the file gives the inertias as well.
    """
    chain = read_chain(path, tip, source)
    joints = chain.moving
    lower = np.array([joint.lower for joint in joints])
    upper = np.array([joint.upper for joint in joints])
    speed = np.array([joint.velocity for joint in joints])
    has_limits, has_speed = np.isfinite(lower + upper), np.isfinite(speed)
    speed = np.where(has_speed, speed, _ASSUMED_SPEED)
    from_file = Origin(Provenance.USER, f"URDF file {path.name}")
    assumed = Origin(Provenance.ASSUMED, f"not in the URDF file {path.name}")
    qdd_max, ramp = assumed_acceleration(speed)
    limits = from_file if has_limits.all() else assumed
    origins = {
        "geometry": from_file,
        "q_min": limits,
        "q_max": limits,
        "qd_max": from_file if has_speed.all() else assumed,
        "qdd_max": ramp,
    }
    mass, com, has_inertia = _inertia(chain)
    if mass is not None:
        origins |= {"link_mass": from_file, "link_com": from_file}
    effort = np.array([joint.effort for joint in joints])
    knows_torque = has_inertia and bool(((effort > 0.0) & (effort <= LARGEST)).all())
    if knows_torque:
        origins["torque_max"] = from_file
    return Robot(
        name=str(chain.tree.get("name") or path.stem),
        geometry=UrdfGeometry(path, chain.tip),
        q_min=np.where(has_limits, lower, -_FULL_TURN),
        q_max=np.where(has_limits, upper, _FULL_TURN),
        qd_max=speed,
        qdd_max=qdd_max,
        torque_max=effort if knows_torque else None,
        has_inertia=has_inertia,
        T_world_robroot=np.eye(4),
        link_mass=mass,
        link_com=com,
        origins=origins,
    )


def _inertia(chain: UrdfChain) -> tuple[FloatArray | None, FloatArray | None, bool]:
    """Return masses (6,) [kg] and centres (6, 3) [m] of links 1..6, None if any has no mass.

    The centres are in the link frames of the file. Last: whether all turn about all axes with an
    inertia.
    """
    mass, moment, turning = np.zeros(6), np.zeros((6, 3)), np.zeros((6, 3))
    moving = [joint.child for joint in chain.moving]
    for link, T_link_part, element in fixed_parts(chain, moving):
        for inertial in element.findall("inertial"):
            own_mass = values_of(inertial.find("mass"), "value", 1, 0.0)[0]
            mass[link] += own_mass
            moment[link] += own_mass * (T_link_part @ origin_of(inertial))[:3, 3]
            tensor = inertial.find("inertia")
            for axis, key in enumerate(("ixx", "iyy", "izz")):
                turning[link, axis] += values_of(tensor, key, 1, 0.0)[0]
    if not (mass > 0.0).all():
        return None, None, False
    return mass, moment / mass[:, None], bool((turning > 0.0).all())


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
