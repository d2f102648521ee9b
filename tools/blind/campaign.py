"""Measuring campaigns: which poses, loads, directions, speeds and temperatures are driven."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tools.blind.chain import Array, Geometry, embed, rotation, solve_pose, sweep
from tools.blind.robots import RobotClass

DESIGNS = ("wide_loads", "wide_noload", "patch", "grid")
MARKS = {
    "tool_no": np.arange(1.0, 4.0),
    "fixture": np.arange(1.0, 4.0),
    "pressure_bar": np.array([5.5, 6.2]),
    "e1_mm": np.linspace(0.0, 4000.0, 9),
}
"""Columns logged beside the usual ones, and their values."""


@dataclass(frozen=True)
class Rows:
    """What the robot was told and what acted on it, row by row.

    Args:
        q: (n, 6) [rad]; force: (n, 3) on the tool point, axes of the root [N].
        time: (n,) [s]; temp: (n,) [degC]; direction: (n, 6); qd: (n, 6) [rad/s]; dwell: (n,) [s].
        pose: (n,) number of the pose; start_temp: of the day the robot was set up [degC].
        marks: further logged columns (n,) by name.
    """

    q: Array
    force: Array
    time: Array
    temp: Array
    direction: Array
    qd: Array
    dwell: Array
    pose: Array
    start_temp: float
    marks: dict[str, Array] = field(default_factory=dict)

    def take(self, index: Array) -> Rows:
        """Return some rows, in the order of ``index``."""
        names = ("q", "force", "time", "temp", "direction", "qd", "dwell", "pose")
        marks = {name: values[index] for name, values in self.marks.items()}
        return replace(self, **{name: getattr(self, name)[index] for name in names}, marks=marks)


@dataclass(frozen=True)
class Plan:
    """How a campaign is driven.

    Args:
        design: one of ``DESIGNS``; rows: how many; loads: "none", "one" or "three" directions.
        level: share of the robot's largest load; moving: share of rows read in motion.
        repeats: rows measured again; both_sides: every pose is approached from both sides.
        warming: rise of the arm's temperature [K]; slow: its time constant [s].
        pace: time per row against the usual half minute; marks: names of ``MARKS``.
    """

    design: str
    rows: int
    loads: str
    level: float
    moving: bool
    repeats: int
    both_sides: bool
    warming: float
    slow: float = 3000.0
    pace: float = 1.0
    marks: tuple[str, ...] = ()


def drive(
    robot: RobotClass, plan: Plan, rng: np.random.Generator, start_temp: float | None = None
) -> Rows:
    """Return the rows of a campaign, in the order of time."""
    per_pose = (3 if plan.loads == "three" else 1) * (2 if plan.both_sides else 1)
    fresh = max(plan.rows - plan.repeats, 20)
    q = _poses(robot, plan, -(-fresh // per_pose), rng)
    pose = np.repeat(np.arange(len(q)), per_pose)[:fresh]
    direction = rng.choice([-1.0, 1.0], (fresh, 6))
    if plan.both_sides:
        direction[1::2] = -direction[: 2 * (fresh // 2) : 2]
    direction[rng.random((fresh, 6)) < 0.03] = 0.0
    speed = np.deg2rad(rng.uniform(3, 40, (fresh, 6))) * direction
    speed[rng.random(fresh) < 0.3] = 0.0
    time, temp, start = _clock(plan, rng, start_temp)
    rows = Rows(
        q=q[pose],
        force=_loads(robot, plan, q, fresh, rng),
        time=np.zeros(fresh),
        temp=np.zeros(fresh),
        direction=direction,
        qd=speed if plan.moving else np.zeros_like(speed),
        dwell=rng.choice([1.0, 2.0, 5.0, 20.0], fresh),
        pose=pose,
        start_temp=start,
    )
    rows = rows.take(_order(plan, fresh, rng))
    count = len(rows.q)
    marks = {name: rng.choice(MARKS[name], count) for name in plan.marks}
    return replace(rows, time=time[:count], temp=temp[:count], marks=marks)


def _order(plan: Plan, fresh: int, rng: np.random.Generator) -> Array:
    """Return the order of the rows: sorted for a grid, else random; repeats strewn in."""
    order = np.arange(fresh) if plan.design == "grid" else rng.permutation(fresh)
    for again in rng.choice(fresh, min(plan.repeats, fresh), replace=False):
        order = np.insert(order, rng.integers(len(order) // 2, len(order) + 1), again)
    return order


def _clock(
    plan: Plan, rng: np.random.Generator, start_temp: float | None
) -> tuple[Array, Array, float]:
    count = plan.rows + 40
    time = np.cumsum(rng.uniform(15, 45, count) + 1500 * (rng.random(count) < 0.008))
    time = plan.pace * (time - time[0])
    start = float(rng.uniform(18, 24)) if start_temp is None else start_temp
    first = start if start_temp is None else start + float(rng.uniform(0, 3))
    swing = rng.uniform(0.2, 0.6) * np.sin(2 * np.pi * time / 9000 + rng.uniform(0, 6))
    temp = first + plan.warming * (1 - np.exp(-time / plan.slow)) + swing - swing[0]
    return time, np.round(temp, 2), start


def _loads(robot: RobotClass, plan: Plan, q: Array, fresh: int, rng: np.random.Generator) -> Array:
    top = plan.level * robot.force
    size = top * rng.choice([0.35, 0.7, 1.0], (fresh, 1)) * rng.uniform(0.95, 1.0, (fresh, 1))
    if plan.loads == "none":
        return np.zeros((fresh, 3))
    if plan.loads == "one":
        force = size * np.array([0.2, 0.1, -1.0]) / 1.02
        force[rng.random(fresh) < 0.3] = 0.0
        return force
    frames = np.linalg.qr(rng.normal(size=(len(q), 3, 3)))[0]
    times = -(-fresh // len(q)) // 3 + 1
    ways = np.tile(frames, (1, times, 1))[:, : -(-fresh // len(q))]
    return size * ways.reshape(-1, 3)[:fresh]


def _poses(robot: RobotClass, plan: Plan, count: int, rng: np.random.Generator) -> Array:
    if plan.design.startswith("wide"):
        return _wide(robot, count, rng)
    start = np.deg2rad(robot.start_deg + rng.uniform(-8, 8, 6))
    flange = sweep(Geometry.of(robot.arm, 1), embed(start[None]))
    extent = robot.extent * (1.0 if plan.design == "patch" else 1.3)
    found = np.empty((0, 6))
    while len(found) < count:
        offset, turn = _offsets(plan, 2 * count, extent, rng)
        angle = np.linalg.norm(turn, axis=1)
        D = rotation(turn / np.maximum(angle, 1e-12)[:, None], angle)
        R = D @ flange.flange_turn
        q, good = solve_pose(robot.arm, flange.flange_p + offset, R, start)
        bounds = np.deg2rad(robot.range_deg)
        wide = np.abs(q - bounds.mean(axis=1)) < 0.5 * (bounds[:, 1] - bounds[:, 0]) + 0.25
        found = np.concatenate([found, q[good & wide.all(axis=1)]])
    return found[:count]


def _offsets(
    plan: Plan, count: int, extent: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    if plan.design == "patch":
        box = np.array([0.6, 1.0, 0.8]) * extent
        return rng.uniform(-1, 1, (count, 3)) * box, rng.normal(0, 0.06, (count, 3))
    side = max(3, round((0.5 * count) ** (1 / 3)))
    line = np.linspace(-1, 1, side)
    mesh = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    turns = rng.normal(0, 0.35, (4, 3))
    which = np.arange(count) % 4
    return extent * mesh[np.arange(count) % len(mesh)], turns[which]


def _wide(robot: RobotClass, count: int, rng: np.random.Generator) -> Array:
    low, high = np.deg2rad(robot.range_deg).T
    found = np.empty((0, 6))
    while len(found) < count:
        q = rng.uniform(low, high, (4 * count, 6))
        q[:, 4] *= rng.choice([-1.0, 1.0], len(q)) if robot.builtin else 1.0
        poses = sweep(Geometry.of(robot.arm, len(q)), embed(q))
        point = poses.tool_point(robot.tool)
        reach = np.linalg.norm(robot.arm.point[5] - robot.arm.point[1])
        far = np.hypot(point[:, 0], point[:, 1]) > 0.25 * reach
        found = np.concatenate([found, q[far & (point[:, 2] > -0.1 * reach)]])
    return found[:count]
