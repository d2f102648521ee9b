"""Torques of the joints of a URDF arm: rigid links, tool and gravity, by pinocchio.

Friction of the gears and what their motors turn are in no URDF: a real joint needs more.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Robot, Tool, UrdfGeometry, read_chain
from postproc.records import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """An arm whose links, and the tool on its flange, have masses and inertias.

    ``position``, ``velocity`` (6,): columns of the joints in the configurations and speeds of the
    model; ``turns`` (6,) whether a joint stands there as cosine and sine; ``flange``: its frame.
    """

    model: Any
    position: IndexArray
    velocity: IndexArray
    turns: tuple[bool, ...]
    flange: int

    def torques(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Return the torques (n, 6) [N*m] that the joints need, the axes moving as they do.

        Angles, speeds, accelerations (n, 6) [rad], [rad/s], [rad/s^2].
        """
        import pinocchio

        data = self.model.createData()
        place = np.zeros((len(q), self.model.nq))
        speed, push = np.zeros((2, len(q), self.model.nv))
        for joint, (at, turns) in enumerate(zip(self.position.tolist(), self.turns, strict=True)):
            place[:, at] = np.cos(q[:, joint]) if turns else q[:, joint]
            if turns:
                place[:, at + 1] = np.sin(q[:, joint])
        speed[:, self.velocity], push[:, self.velocity] = qd, qdd
        found = np.zeros((len(q), self.model.nv))
        for row in range(len(q)):
            found[row] = pinocchio.rnea(self.model, data, place[row], speed[row], push[row])
        return np.asarray(found[:, self.velocity])


def dynamics_of(robot: Robot, tool: Tool) -> Dynamics | None:
    """Return the arm with a tool, None where nobody has said the inertias of the links.

    A tool counts where its mass and its centre of gravity are known, with the axes of the flange as
    those of its inertia.
    """
    if not robot.has_inertia or not isinstance(robot.geometry, UrdfGeometry):
        return None
    import pinocchio

    bare = _arm(robot, robot.geometry)
    model = bare.model.copy()
    model.gravity.linear = np.array(robot.gravity)
    if tool.com is not None and np.isfinite(tool.mass):
        flange = model.frames[bare.flange]
        inertia = np.zeros(3) if tool.inertia is None else np.asarray(tool.inertia)
        body = pinocchio.Inertia(tool.mass, np.array(tool.com), np.diag(inertia))
        model.inertias[flange.parentJoint] += flange.placement.act(body)
    return replace(bare, model=model)


@lru_cache(maxsize=8)
def _arm(robot: Robot, geometry: UrdfGeometry) -> Dynamics:
    """Return the arm without a tool, all else at rest; the same object for the same robot."""
    import pinocchio

    chain = read_chain(geometry.path, geometry.tip)
    moving = [joint.name for joint in chain.moving]
    whole = pinocchio.buildModelFromUrdf(str(geometry.path))
    others = [i for i in range(1, whole.njoints) if whole.names[i] not in moving]
    model = pinocchio.buildReducedModel(whole, others, pinocchio.neutral(whole))
    joints = [model.joints[model.getJointId(name)] for name in moving]
    return Dynamics(
        model,
        np.array([joint.idx_q for joint in joints]),
        np.array([joint.idx_v for joint in joints]),
        tuple(joint.nq == 2 for joint in joints),
        model.getFrameId(chain.tip),
    )
