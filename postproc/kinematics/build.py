"""The arm of a robot: built-in geometry or a URDF file."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from postproc.cell import OpwGeometry, Robot, UrdfGeometry, find_robot, load_robot
from postproc.errors import CellError, KinematicsError, SourceRef
from postproc.geometry import inverse, rotation_angle
from postproc.kinematics.model import Kinematics, closed_form
from postproc.kinematics.opw import arm_of
from postproc.kinematics.urdf import build_urdf
from postproc.units import DEG, MM

_OFF, _TURNED = 1.0 * MM, 0.1 * DEG
"""Digits and rounding of a file may cost so much."""


@lru_cache(maxsize=16)
def build(robot: Robot) -> Kinematics:
    """Return the kinematics of a robot; the same object for the same robot object.

    Raises:
        KinematicsError: KIN001 if the geometry is no arm (a length of zero), KIN002 and above if
            a URDF cannot be used.
    """
    if isinstance(robot.geometry, OpwGeometry):
        return closed_form(arm_of(robot.geometry), robot.q_min, robot.q_max)
    arm = build_urdf(robot.geometry, robot.q_min, robot.q_max)
    _compared(arm, robot)
    return arm


def _compared(arm: Kinematics, robot: Robot) -> None:
    """Compare a URDF arm with the built-in one of its name, if there is one.

    Raises:
        KinematicsError: KIN003 if joints turn the other way than those of the maker, or the flange
            is elsewhere or turned.
    """
    try:
        known = load_robot(find_robot(robot.name))
    except CellError:
        return
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 6))
    T, T_known = arm.fk(q), build(known).fk(q)
    off = float(np.linalg.norm(T[:, :3, 3] - T_known[:, :3, 3], axis=1).max())
    turned = float(rotation_angle(T[:, :3, :3], T_known[:, :3, :3]).max())
    if off <= _OFF and turned <= _TURNED:
        return
    reversed_ = _reversed(arm, build(known))
    why = "another link, or other lengths"
    hint = "name the flange as [robot] tip, or"
    if reversed_:
        why = f"{', '.join(reversed_)} of the file turns the other way than KUKA's"
        hint = "turn the axis of the joint round in the file, or"
    geometry = robot.geometry
    path = str(geometry.path) if isinstance(geometry, UrdfGeometry) else robot.name
    raise KinematicsError(
        "KIN003",
        f"the flange is up to {off / MM:.1f} mm and {turned / DEG:.1f} deg off that of "
        f"{known.name}: {why}",
        SourceRef(path),
        hint=f'{hint} take [robot] model = "{known.name}"',
    )


def _reversed(arm: Kinematics, known: Kinematics) -> list[str]:
    """Return the joints that turn about the axis of the known arm, but the other way."""
    q = np.vstack([np.zeros(6), 0.3 * np.eye(6), -0.3 * np.eye(6)])
    T, T_known = arm.fk(q), known.fk(q)
    # seen from the base, what a joint alone does to the flange does not depend on where that is
    own, other = (place[1:] @ inverse(place[0]) for place in (T, T_known))
    return [
        f"A{joint + 1}"
        for joint in range(6)
        if np.abs(own[joint] - other[6 + joint]).max() < _OFF
        and np.abs(own[joint] - other[joint]).max() > _OFF
    ]
