"""What is assumed of the inside of an arm: joint stiffness, link masses, weight.

The assumptions only set the size of priors and the shape of a torque over the workspace; every
effect that uses them fits its own scale. Where no source gives a number it comes from the size
class of the arm and is marked so.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.geometry import inverse
from postproc.kinematics import Kinematics
from postproc.records import dataclass

CLASS_STIFFNESS = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
"""(6,) [N*m/rad] of a KUKA KR500, no grid (Jiao et al. 2022); other sources differ by 2."""
CLASS_MASS = np.array([850.6, 447.6, 545.2, 110.0, 45.0, 21.0])
"""(6,) [kg] of the KR 600 R2830 links (KUKA's ROS 2 packages), the wrist split by assumption."""
CLASS_REACH = 2.83
"""Reach [m] of that arm; masses grow with about the 2.5th, stiffness with the 4th power of it.

Where the masses are known, stiffness goes with the torque of the weight on the arm, mass times
reach, which light arms of the same reach have less of: a gear is as stiff as it must be strong."""


@dataclass(frozen=True, slots=True)
class ArmReference:
    """Reference numbers of one arm.

    gravity (3,) [m/s^2] in robroot; c_joint (6,) [rad/(N*m)]; link_mass (6,) [kg] and link_com
    (6, 3) [m] in the link frames; tool_mass [kg], tool_com (3,) [m] in the flange. ``assumed``
    lists what comes from the size class only.
    """

    gravity: FloatArray
    c_joint: FloatArray
    link_mass: FloatArray
    link_com: FloatArray
    assumed: tuple[str, ...]


def reference_of(kinematics: Kinematics, cell: Cell) -> ArmReference:
    """Return the reference numbers of a cell's robot."""
    robot = cell.robot
    frames = np.asarray(kinematics.link_frames(np.zeros((1, 6))))[0]
    flange = np.asarray(kinematics.fk(np.zeros((1, 6))))[0]
    origins = [(inverse(frames[k]) @ frames[k + 1])[:3, 3] for k in range(1, 6)]
    origins.append((inverse(frames[6]) @ flange)[:3, 3])
    chain = np.array(origins)
    reach = float(np.sum(np.linalg.norm(chain[1:5], axis=1)))
    assumed: list[str] = []
    mass, com = _masses(robot.link_mass, robot.link_com, chain, reach, assumed)
    if robot.joint_stiffness is not None and bool(np.all(np.isfinite(robot.joint_stiffness))):
        stiffness = np.asarray(robot.joint_stiffness)
    else:
        assumed.append("joint stiffness")
        size = float(np.sum(mass)) * reach / (float(np.sum(CLASS_MASS)) * CLASS_REACH)
        stiffness = CLASS_STIFFNESS * min(size, (reach / CLASS_REACH) ** 4)
    return ArmReference(robot.gravity, 1.0 / stiffness, mass, com, tuple(assumed))


def _masses(
    mass: FloatArray | None,
    com: FloatArray | None,
    chain: FloatArray,
    reach: float,
    assumed: list[str],
) -> tuple[FloatArray, FloatArray]:
    if mass is not None and com is not None and bool(np.all(np.isfinite(mass))):
        return np.asarray(mass), np.where(np.isfinite(com), com, 0.5 * chain)
    assumed.append("link masses")
    centre = np.array([0.4, 0.4, 0.3, 0.6, 0.4, 0.5])[:, None] * chain
    centre[2] += 0.3 * chain[3]
    return CLASS_MASS * (reach / CLASS_REACH) ** 2.5, centre
