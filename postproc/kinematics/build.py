"""The arm of a robot: built-in geometry or a URDF file."""

from __future__ import annotations

from functools import lru_cache

from postproc.cell import OpwGeometry, Robot
from postproc.kinematics.model import Kinematics, closed_form
from postproc.kinematics.opw import arm_of
from postproc.kinematics.urdf import build_urdf


@lru_cache(maxsize=16)
def build(robot: Robot) -> Kinematics:
    """Return the kinematics of a robot; the same object for the same robot object.

    Raises:
        KinematicsError: KIN001 if the geometry is no arm (a length of zero), KIN002 and above if
            a URDF cannot be used.
    """
    if isinstance(robot.geometry, OpwGeometry):
        return closed_form(arm_of(robot.geometry), robot.q_min, robot.q_max)
    return build_urdf(robot.geometry, robot.q_min, robot.q_max)
