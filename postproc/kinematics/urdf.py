"""Arms from URDF files: joint frames by pinocchio, then the same kinematics as built-in arms.

The link names and limits come from ``model.urdfchain``; pinocchio gives the placements of the
joints. An arm that turns out to be ortho-parallel with a spherical wrist is solved in closed form
(followed by Newton steps if its numbers are rounded); any other one numerically.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import UrdfGeometry, read_chain
from postproc.errors import KinematicsError, SourceRef
from postproc.kinematics.chain import SerialChain
from postproc.kinematics.detect import ortho_parallel
from postproc.kinematics.model import Kinematics, closed_form
from postproc.kinematics.numeric import DeterminantBranches, NumericSolver, PolishedSolver
from postproc.kinematics.opw import OpwArm, chain_of

EXACT = 1e-9
"""Largest difference [m and 1] of forward kinematics for a closed form without Newton steps."""


def build_urdf(geometry: UrdfGeometry, q_min: FloatArray, q_max: FloatArray) -> Kinematics:
    """Return the kinematics of a URDF arm; its link frames are those of the file.

    Raises:
        KinematicsError: KIN002 if pinocchio cannot use the file.
        CellError: CEL011 if it is not the URDF of a six-axis arm.
    """
    chain = load_chain(geometry.path, geometry.tip)
    arm = ortho_parallel(chain)
    if arm is None:
        branches = DeterminantBranches(chain)
        solver = NumericSolver(chain, branches)
        return Kinematics(chain, solver, branches, q_min, q_max, is_closed_form=False)
    exact = closed_form(arm, q_min, q_max)
    is_exact = _difference(chain, arm) < EXACT
    return Kinematics(
        chain=chain,
        solver=exact.solver if is_exact else PolishedSolver(chain, exact.solver),
        branches=arm,
        q_min=q_min,
        q_max=q_max,
        is_closed_form=True,
        arm=arm,
    )


def load_chain(path: Path, tip: str | None = None) -> SerialChain:
    """Return the joint frames between root link and flange.

    Raises:
        KinematicsError: KIN002 if pinocchio cannot use the file.
        CellError: CEL011 if it is not the URDF of a six-axis arm.
    """
    import pinocchio

    joints = read_chain(path, tip)
    try:
        model = pinocchio.buildModelFromUrdf(str(path))
    except (ValueError, RuntimeError) as problem:
        reason = " ".join(str(problem).split()) or "not a usable robot"
        raise KinematicsError("KIN002", f"pinocchio: {reason}", SourceRef(str(path))) from None
    placements = np.tile(np.eye(4), (7, 1, 1))
    axes = np.zeros((6, 3))
    for place, joint in enumerate(joints.moving):
        index = model.getJointId(joint.name)
        placements[place] = model.jointPlacements[index].homogeneous
        motion_subspace = np.asarray(model.joints[index].createData().S, dtype=np.float64)
        axes[place] = motion_subspace.reshape(6)[3:]
    placements[6] = model.frames[model.getFrameId(joints.tip)].placement.homogeneous
    return SerialChain(placements, axes)


def _difference(chain: SerialChain, arm: OpwArm) -> float:
    q = np.random.default_rng(6).uniform(-np.pi, np.pi, (64, 6))
    return float(np.abs(chain.fk(q) - chain_of(arm).fk(q)).max())
