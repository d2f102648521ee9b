"""The command whose loaded real tool point is a target: a fixed-point iteration on the model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, Table
from postproc.compensation.drive import LARGEST
from postproc.compensation.real_arm import real_point
from postproc.gap import RobotModel
from postproc.geometry import inverse
from postproc.kinematics import Kinematics
from postproc.records import dataclass

ACCURACY = 1e-7
"""The iteration ends when every real tool point is this close [m] to its target."""
_STEPS = 30


@dataclass(frozen=True, slots=True)
class Compensated(Table):
    """Joint angles whose loaded tool point is the target.

    q (n, 6) [rad]; shift (n, 3) [m] of the commanded tool point, robroot; left (n,) [m] distance
    that remains; reached (n,): the shifted pose exists on the same branch.
    """

    q: FloatArray
    shift: FloatArray
    left: FloatArray
    reached: BoolArray


def solve(
    model: RobotModel,
    kinematics: Kinematics,
    T_flange_tcp: FloatArray,
    q: FloatArray,
    wrench: FloatArray,
    conditions: Mapping[str, Any] | None = None,
) -> Compensated:
    """Find commands whose loaded real tool point is the nominal tool point of ``q`` (n, 6) [rad].

    ``kinematics``: nominal, as the controller computes; ``wrench`` (n, 6): load on the tool at each
    pose, robroot; ``conditions``: further columns: ``direction`` of approach, joint speeds ``qd``.
    """
    T_tcp_flange = inverse(T_flange_tcp)
    T_target = kinematics.fk(q) @ T_flange_tcp
    slot = kinematics.slot(q)
    rows = np.arange(len(q))
    shift = np.zeros((len(q), 3))
    command = np.array(q, dtype=np.float64)
    reached = np.ones(len(q), dtype=bool)
    left = np.zeros((len(q), 3))
    for _ in range(_STEPS):
        left = real_point(model, command, wrench, conditions) - T_target[:, :3, 3]
        if float(np.max(np.linalg.norm(left, axis=1), initial=0.0)) < ACCURACY:
            break
        shift = shift - np.where(reached[:, None], left, 0.0)
        if float(np.max(np.abs(shift), initial=0.0)) > LARGEST:
            break
        T = T_target.copy()
        T[:, :3, 3] += shift
        branches, valid = kinematics.ik(T @ T_tcp_flange)
        reached = valid[rows, slot]
        found = kinematics.split_wrist(kinematics.nearest(branches[rows, slot], q), q)
        command = np.where(reached[:, None], found, command)
    return Compensated(command, shift, np.linalg.norm(left, axis=1), reached)
