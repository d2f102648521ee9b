"""The arm of a robot: built-in geometry or a URDF file.

Of a URDF pinocchio gives the joint frames. An arm that turns out to be ortho-parallel with a
spherical wrist is solved in closed form (followed by Newton steps if its numbers are rounded): axis
2 parallel to axis 3 and square to axis 1, axis 4 square to axis 3, axes 4, 5, 6 through one point
and square to each other in turn, all at q = 0. Any other one is solved numerically.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import OpwGeometry, Robot, UrdfGeometry, find_robot, load_robot, read_chain
from postproc.errors import CellError, KinematicsError, SourceRef
from postproc.geometry import inverse, rotation_angle, rotation_y, rotation_z, transform
from postproc.kinematics.chain import SerialChain
from postproc.kinematics.model import Kinematics, closed_form
from postproc.kinematics.numeric import DeterminantBranches, NumericSolver, PolishedSolver
from postproc.kinematics.opw import OpwArm, arm_of, chain_of
from postproc.records import dataclass
from postproc.units import DEG, MM

_OFF, _TURNED = 1.0 * MM, 0.1 * DEG
"""Digits and rounding of a file may cost so much."""

LOOSE = 1e-3
"""Angle [rad] and length [m] up to which an arm counts as ortho-parallel with small errors."""

EXACT = 1e-9
"""Largest difference [m and 1] of forward kinematics for a closed form without Newton steps."""


@dataclass(frozen=True, slots=True)
class _Lines:
    """Joint axes at q = 0 in robroot: points (6, 3) [m] and unit directions (6, 3)."""

    points: FloatArray
    directions: FloatArray


@lru_cache(maxsize=16)
def build(robot: Robot) -> Kinematics:
    """Return the kinematics of a robot; the same object for the same robot object.

    KIN001 if the geometry is no arm (a length of zero), KIN002 and above if a URDF cannot be used.
    """
    if isinstance(robot.geometry, OpwGeometry):
        return closed_form(arm_of(robot.geometry), robot.q_min, robot.q_max)
    arm = build_urdf(robot.geometry, robot.q_min, robot.q_max)
    _compared(arm, robot)
    return arm


def _compared(arm: Kinematics, robot: Robot) -> None:
    """Compare a URDF arm with the built-in one of its name, if there is one."""
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
        hint = "reverse the joint axis in the file, or"
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


def ortho_parallel(chain: SerialChain) -> OpwArm | None:
    """Return the ortho-parallel arm nearest to a chain, None if it is another kind of arm.

    The match may be off by small errors of the chain (rounded numbers, calibrated axes); the
    caller compares forward kinematics to see whether it is exact.
    """
    frames = chain.link_frames(np.zeros(6))[1:]
    directions = np.einsum("nij,nj->ni", frames[:, :3, :3], chain.axes)
    lines = _Lines(frames[:, :3, 3], directions)
    wrist = _wrist_centre(lines)
    if wrist is None or not _is_ortho_parallel(lines.directions):
        return None
    return _fitted(lines, wrist, chain.fk(np.zeros(6)))


def _is_ortho_parallel(d: FloatArray) -> bool:
    square = [(0, 1), (2, 3), (3, 4), (4, 5)]
    is_parallel = float(np.linalg.norm(np.cross(d[1], d[2]))) < LOOSE
    return is_parallel and all(abs(float(d[i] @ d[j])) < LOOSE for i, j in square)


def _wrist_centre(lines: _Lines) -> FloatArray | None:
    """Return the point nearest to axes 4, 5 and 6, None if they do not meet."""
    d = lines.directions[3:]
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    centre = np.linalg.lstsq(
        across.sum(axis=0), np.einsum("nij,nj->i", across, lines.points[3:]), rcond=None
    )[0]
    missed = np.einsum("nij,nj->ni", across, centre - lines.points[3:])
    return centre if float(np.abs(missed).max()) < LOOSE else None


def _fitted(lines: _Lines, wrist: FloatArray, T_robroot_flange: FloatArray) -> OpwArm | None:
    d = lines.directions
    up = d[0] if d[0, 2] >= 0.0 else -d[0]
    up = up if abs(d[0, 2]) > LOOSE else d[0]
    side = _unit(d[1] - (d[1] @ up) * up)
    R_robroot_foot = np.stack([np.cross(side, up), side, up], axis=1)
    foot = lines.points[0] - (lines.points[0] @ up) * up
    a, e, w = ((p - foot) @ R_robroot_foot for p in (lines.points[1], lines.points[2], wrist))
    n = d @ R_robroot_foot
    c2 = float(np.hypot(e[0] - a[0], e[2] - a[2]))
    upper = float(np.arctan2(e[0] - a[0], e[2] - a[2]))
    reach = np.array([w[0] - e[0], 0.0, w[2] - e[2]])
    forward = n[3] if n[3] @ reach >= 0.0 else -n[3]
    lower = float(np.arctan2(forward[0], forward[2]))
    a2, _, c3 = rotation_y(lower).T @ reach
    hand = rotation_y(lower).T @ n[4]
    sign_5 = 1.0 if hand[1] >= 0.0 else -1.0
    twist = float(np.arctan2(-sign_5 * hand[0], sign_5 * hand[1]))
    end = (T_robroot_flange[:3, 3] - foot) @ R_robroot_foot
    out = n[5] if (end - w) @ n[5] >= 0.0 else -n[5]
    bent = (rotation_y(lower) @ rotation_z(twist)).T @ out
    bend = float(np.arctan2(bent[0], bent[2]))
    c4 = float((end - w) @ out)
    if c2 < LOOSE or np.hypot(a2, c3) < LOOSE:
        return None
    zero = np.array([0.0, upper, lower - upper, twist, bend, 0.0])
    signs = np.array([d[0] @ up, 1.0, d[2] @ side, n[3] @ forward, sign_5, n[5] @ out])
    geometry = OpwGeometry(
        a1=float(a[0]), a2=float(a2), b=float(w[1]), c1=float(a[2]), c2=c2, c3=float(c3), c4=c4,
        signs=np.sign(signs), offsets=-zero,
    )  # fmt: skip
    T_robroot_foot = transform(R_robroot_foot, foot)
    R_foot_end = rotation_y(lower) @ rotation_z(twist) @ rotation_y(bend)
    T_foot_end = transform(R_foot_end, w + c4 * R_foot_end[:, 2])
    T_end_flange = inverse(T_robroot_foot @ T_foot_end) @ T_robroot_flange
    return OpwArm(geometry, T_robroot_foot, T_end_flange)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))


def build_urdf(geometry: UrdfGeometry, q_min: FloatArray, q_max: FloatArray) -> Kinematics:
    """Return the kinematics of a URDF arm; its link frames are those of the file."""
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
    """Return the joint frames between root link and flange, as pinocchio has them."""
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
