"""The real robot of a case: nominal arm, hidden effects, full static equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tools.blind.campaign import Rows
from tools.blind.chain import (
    JOINTS,
    SCREWS,
    Array,
    G,
    Geometry,
    Poses,
    columns,
    embed,
    settle,
    sweep,
    torques,
)
from tools.blind.robots import RobotClass

TOOL_BODY = len(SCREWS) - 1
Pull = Callable[[Poses], Array]


@dataclass
class State:
    """What the effects change before the equilibrium is sought.

    Args:
        geometry, theta: of every row; tool: (n, 3) tool point in the flange, where loads act;
            reflector: (3,) place of what is measured beside it, flange axes.
        give: (n, m) compliance of each screw [rad/(N*m)]; hardening: share by which a spring is
            stiffer at its reference torque; reference: (m,) that torque [N*m].
        load_gives: 1 if the arm gives under outside loads; weight: share of the links' own weight
            that the controller does not compensate; mass, com: of the links as they are.
        pulls: further torques (n, m); after: displacement of what is measured.
    """

    robot: RobotClass
    rows: Rows
    geometry: Geometry
    theta: Array
    tool: Array
    give: Array
    reference: Array
    hardening: float = 0.0
    load_gives: float = 0.0
    reflector: Array = field(default_factory=lambda: np.zeros(3))
    weight: float = 0.0
    mass: Array = field(default_factory=lambda: np.zeros(6))
    com: Array = field(default_factory=lambda: np.zeros((6, 3)))
    pulls: list[Pull] = field(default_factory=list)
    after: list[Callable[[Array], Array]] = field(default_factory=list)


@dataclass(frozen=True)
class Hidden:
    """One hidden effect: its name, its drawn numbers, its strength, and what it does."""

    name: str
    parameters: dict[str, Array]
    strength: float
    change: Callable[[State, dict[str, Array], float], None]

    def scaled(self, factor: float) -> Hidden:
        """Return the effect ``factor`` times as strong."""
        return Hidden(self.name, self.parameters, self.strength * factor, self.change)


@dataclass(frozen=True)
class Outcome:
    """Measured points without noise (n, 3), real joint angles (n, 6), the poses."""

    point: Array
    joints: Array
    poses: Poses


def nominal(robot: RobotClass, rows: Rows) -> Array:
    """Return the tool points (n, 3) of the rigid nominal arm."""
    poses = sweep(Geometry.of(robot.arm, len(rows.q)), embed(rows.q))
    return poses.tool_point(robot.tool)


def simulate(robot: RobotClass, rows: Rows, hidden: Sequence[Hidden]) -> Outcome:
    """Return where the real tool point is, in the robot root."""
    n = len(rows.q)
    give = np.zeros((n, len(SCREWS)))
    give[:, JOINTS] = robot.arm.give
    state = State(
        robot=robot,
        rows=rows,
        geometry=Geometry.of(robot.arm, n),
        theta=embed(rows.q),
        tool=np.tile(robot.tool, (n, 1)),
        give=give,
        reference=reference_torque(robot),
        mass=robot.arm.mass.copy(),
        com=robot.arm.com.copy(),
    )
    for effect in hidden:
        effect.change(state, effect.parameters, effect.strength)
    poses, theta = settle(state.geometry, state.theta, lambda p, t: _deflection(state, p, t))
    point = poses.tool_point(state.tool + state.reflector)
    for displace in state.after:
        point = point + displace(point)
    return Outcome(point, theta[:, JOINTS], poses)


def reference_torque(robot: RobotClass) -> Array:
    """Return a usual torque of each screw [N*m]: the largest load on half the arm."""
    length = np.full(len(SCREWS), 0.5 * np.linalg.norm(robot.arm.point[4]))
    length[JOINTS[3:]] = np.linalg.norm(robot.tool) + 0.1
    return robot.force * length


def _deflection(state: State, poses: Poses, _: Array) -> Array:
    """Return the give (n, m) of all springs under loads taken in the deflected pose."""
    n = len(state.rows.q)
    torque = np.zeros((n, len(SCREWS)))
    if state.load_gives:
        torque += state.load_gives * torques(
            poses, TOOL_BODY, poses.tool_point(state.tool), state.rows.force
        )
    if state.weight:
        for k in range(6):
            at = poses.body_point(int(JOINTS[k]), state.com[k])
            pull = np.tile(state.weight * state.mass[k] * G, (n, 1))
            torque += torques(poses, int(JOINTS[k]), at, pull)
    for pull_of in state.pulls:
        torque += pull_of(poses)
    stiffening = 1.0 + state.hardening * np.abs(torque) / state.reference
    return state.give * torque / stiffening


def joint_shares(robot: RobotClass, rows: Rows, outcome: Outcome) -> tuple[Array, float]:
    """Return the share (6,) of the gap that enters at each joint, and the share of all of them."""
    poses = sweep(Geometry.of(robot.arm, len(rows.q)), embed(rows.q))
    at = poses.tool_point(robot.tool)
    moved = columns(poses, at) * (outcome.joints - rows.q)[:, None, :]
    energy = np.sum(moved**2, axis=(0, 1))
    gap = outcome.point - at
    left = gap - moved.sum(axis=2)
    explained = 1.0 - float(np.sum(left**2) / max(np.sum(gap**2), 1e-30))
    return energy / max(float(energy.sum()), 1e-30), explained
