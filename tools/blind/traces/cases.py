"""Cases: a path, hidden causes, a recorder; written as files, with the truth beside."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind.chain import Array
from tools.blind.robots import KR210, KR500, RobotClass, cell_text
from tools.blind.traces.effects import EFFECTS, OUTSIDE, Motion
from tools.blind.traces.robot import Path as Way
from tools.blind.traces.robot import fk, ik, jacobian

DEG = np.pi / 180.0
KINDS = ("none", "single", "single", "single", "pair", "pair", "outside")


@dataclass
class Recorder:
    """How a run is written: cycle [s], noise and counts of the encoders [deg], jitter [s]."""

    cycle: float
    noise: float
    count: float
    jitter: float
    lost: float
    tracker: float


def write_case(folder: Path, seed: int, kind: str | None = None) -> dict[str, Any]:
    """Write ``log.csv``, ``cell.toml`` and ``program.src``; return the truth."""
    rng = np.random.default_rng(seed)
    kind = kind or KINDS[rng.integers(len(KINDS))]
    folder.mkdir(parents=True, exist_ok=True)
    robot = (KR500, KR210)[rng.integers(2)]
    (folder / "cell.toml").write_text(cell_text(robot, None), encoding="utf-8")
    start = (robot.start_deg + rng.uniform(-8, 8, 6)) * DEG
    way = _way(rng, fk(robot.arm, robot.tool, start[None])[0][0])
    recorder = Recorder(
        rng.choice([0.004, 0.004, 0.012]),
        10.0 ** rng.uniform(-4.3, -3.3),
        rng.choice([0.0, 1e-4, 4e-4]),
        rng.choice([0.0, 0.0, 2e-4]),
        rng.choice([0.0, 0.0, 0.002]),
        rng.uniform(0.01e-3, 0.025e-3),
    )
    names = list(EFFECTS)
    chosen: list[str] = []
    if kind == "single":
        chosen = [names[rng.integers(len(names))]]
    elif kind == "pair":
        chosen = [str(n) for n in rng.choice(names, 2, replace=False)]
        if {"servo_lag", "controller_delay"} == set(chosen):
            chosen = ["servo_lag", "reversal_error"]
    tracked = "clock_offset" in chosen or rng.random() < 0.3
    time, points = way.timed()
    command = ik(robot.arm, robot.tool, start, points)
    J = jacobian(robot.arm, robot.tool, command)
    order = [n for n in names if n in chosen]
    outside = OUTSIDE[rng.integers(len(OUTSIDE))] if kind == "outside" else None
    truth: dict[str, Any] = {}
    rows = []
    state = rng.integers(1 << 31)
    runs = int(rng.integers(1, 4))
    for run in range(runs):
        m = Motion(time, command, command.copy(), np.zeros((len(time), 3)), points, J)
        same = np.random.default_rng(state)
        for name in order:
            EFFECTS[name](m, same)
        if outside is not None:
            outside(m, same)
        truth = m.truth
        rows.append(recorded(m, robot, recorder, rng, run + 1, tracked))
    write_log(folder / "log.csv", np.concatenate(rows), tracked)
    # the same robot once more, and what its recorder would have written without noise
    again = recorded(m, robot, recorder, np.random.default_rng([seed, 1]), 1, tracked)
    write_log(folder / "fresh.csv", again, tracked)
    still = Recorder(recorder.cycle, 0.0, 0.0, 0.0, 0.0, 0.0)
    pure = recorded(m, robot, still, np.random.default_rng(0), 1, tracked)
    shares = phase_shares(way, robot, m, pure, tracked)
    factor = float(rng.uniform(0.6, 0.97)) if rng.random() < 0.25 else 1.0
    (folder / "program.src").write_text(program_text(way, robot, start, factor), encoding="utf-8")
    told = {"seed": seed, "kind": kind, "effects": truth, "tracked": tracked, "runs": runs}
    told |= {"phases": shares}
    told |= {"cycle": recorder.cycle, "cdis_mm": 1e3 * way.cdis, "form": way.form, "factor": factor}
    (folder / "truth.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
    return told


def _way(rng: np.random.Generator, start: Array) -> Way:
    count = rng.integers(5, 9)
    size = rng.uniform(0.06, 0.18)
    corners = [start]
    heading = rng.uniform(0, 2 * np.pi)
    tilt = rng.uniform(-0.3, 0.3)
    for _ in range(count):
        heading += rng.choice([-1, 1]) * rng.uniform(0.6, 2.4)
        step = size * rng.uniform(0.5, 1.2)
        move = np.array([np.cos(heading), np.sin(heading), tilt * np.sin(2 * heading)])
        goal = corners[-1] + step * move
        if np.linalg.norm(goal - start) > 0.25:
            heading += np.pi
            goal = corners[-1] - step * move
        corners.append(goal)
    cdis = rng.choice([0.0, 0.002, 0.005, 0.01])
    form = str(rng.choice(["parabola", "arc"]))
    return Way(np.array(corners), cdis, form, rng.uniform(0.03, 0.2), rng.uniform(0.8, 3.0))


def recorded(
    m: Motion, robot: RobotClass, r: Recorder, rng: np.random.Generator, run: int, tracked: bool
) -> Array:
    """Return the rows of one run: time, command, actual, point, run."""
    stamp = np.arange(0.0, m.time[-1], r.cycle)
    true = stamp + rng.normal(0.0, r.jitter, len(stamp)) if r.jitter else stamp
    actual = m.actual.copy()
    if not tracked:
        # nothing but the encoders saw it: the motors swing along
        J = m.jacobian[:, :3, :3]
        actual[:, :3] += np.linalg.solve(J, m.shift[..., None])[..., 0]
    at = [np.interp(stamp, m.time, c) for c in m.command.T]
    got = np.stack([np.interp(true, m.time, c) for c in actual.T], axis=1) / DEG
    got = got + rng.normal(0.0, r.noise, got.shape)
    if r.count:
        got = np.round(got / r.count) * r.count
    columns = [stamp, *(np.array(at) / DEG), *got.T]
    if tracked:
        seen = stamp - m.clock
        q = np.stack([np.interp(seen, m.time, c) for c in m.actual.T], axis=1)
        shift = np.stack([np.interp(seen, m.time, c) for c in m.shift.T], axis=1)
        point = fk(robot.arm, robot.tool, q)[0] + shift
        point += rng.normal(0.0, r.tracker, point.shape)
        point[rng.random(len(point)) < 0.003] = np.nan
        columns += list(1e3 * point.T)
    columns.append(np.full(len(stamp), float(run)))
    table = np.stack(columns, axis=1)
    return table[rng.random(len(table)) >= r.lost]


def phase_shares(
    way: Way, robot: RobotClass, m: Motion, rows: Array, tracked: bool
) -> dict[str, float]:
    """Return the share of the squared gap of noiseless ``rows`` in each phase of the motion.

    The gap is of the tool from the command at the same time, and of the command from the corners'
    polyline. A row of several phases has the first of corner, start and stop, reversal.
    """
    arm, tool, time = robot.arm, robot.tool, rows[:, 0]
    command = fk(arm, tool, rows[:, 1:7] * DEG)[0]
    real = 1e-3 * rows[:, 13:16] if tracked else fk(arm, tool, rows[:, 7:13] * DEG)[0]
    place = np.interp(time, m.time, way.place)
    leg = np.clip(place.astype(int), 0, len(way.corners) - 2)
    ways = []
    for k in (leg - 1, leg, leg + 1):
        a, b = (way.corners[np.clip(k + j, 0, len(way.corners) - 1)] for j in (0, 1))
        square = np.maximum(np.sum((b - a) ** 2, axis=1), 1e-12)
        along = np.clip(np.sum((command - a) * (b - a), axis=1) / square, 0.0, 1.0)
        ways.append(command - a - along[:, None] * (b - a))
    nearest = np.argmin([np.sum(w**2, axis=1) for w in ways], axis=0)
    off = np.array(ways)[nearest, np.arange(len(time))]
    square = np.nan_to_num(np.sum((off + real - command) ** 2, axis=1))
    phase = np.full(len(time), "steady", dtype="<U10")
    for q in m.command.T:
        sign = np.sign(np.where(np.abs(np.diff(q)) > 1e-9, np.diff(q), 0.0))
        moves = np.flatnonzero(sign)
        at = moves[1:][sign[moves[1:]] != sign[moves[:-1]]]
        # back by twenty counts of an encoder is a reversal
        at = [k for k in at if np.abs(q[k : k + 1000] - q[k]).max() > 0.002 * DEG]
        _mark(phase, "reversal", time, m.time[at], 0.02, 0.15)
    speed = np.linalg.norm(np.gradient(m.point, m.time, axis=0), axis=1)
    stands = speed < 0.01 * np.quantile(speed, 0.9)
    for k in np.flatnonzero(np.diff(stands.astype(int))):
        to = slice(k + 1, k + 501) if stands[k] else slice(k, max(0, k - 500), -1)
        ramp = int(np.argmax(speed[to] >= 0.9 * speed[to].max())) * (m.time[1] - m.time[0])
        before, after = (0.0, ramp) if stands[k] else (ramp, 0.15)
        _mark(phase, "start_stop", time, m.time[[k]], before, after)
    way_of = np.cumsum(np.r_[0.0, np.linalg.norm(np.diff(m.point, axis=0), axis=1)])
    for k in range(1, len(way.corners) - 1):
        inside = np.abs(way_of - np.interp(k, way.place, way_of)) < max(way.cdis, 0.005)
        first, last = m.time[inside][[0, -1]]
        _mark(phase, "corner", time, np.array([first]), 0.0, last - first + 0.15)
    total = max(float(square.sum()), 1e-30)
    return {str(n): float(square[phase == n].sum()) / total for n in np.unique(phase)}


def _mark(phase: Array, name: str, time: Array, events: Array, before: float, after: float) -> None:
    for event in events:
        phase[(time >= event - before) & (time <= event + after)] = name


def write_log(path: Path, table: Array, tracked: bool) -> None:
    """Write rows of ``recorded`` as CSV."""
    names = ["time_s", *(f"q{k}_cmd_deg" for k in range(1, 7))]
    names += [f"q{k}_act_deg" for k in range(1, 7)]
    names += ["x_mm", "y_mm", "z_mm"] if tracked else []
    lines = [",".join([*names, "run"])]
    for row in table:
        cells = [f"{row[0]:.4f}", *(f"{v:.5f}" for v in row[1:13])]
        cells += ["" if np.isnan(v) else f"{v:.4f}" for v in row[13:-1]]
        lines.append(",".join([*cells, f"{row[-1]:.0f}"]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def program_text(way: Way, robot: RobotClass, start: Array, factor: float) -> str:
    """Return the KRL program of a path, run at ``factor`` of the feed that it asks for."""
    R = fk(robot.arm, robot.tool, start[None])[1][0]
    a = np.arctan2(R[1, 0], R[0, 0])
    b = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    c = np.arctan2(R[2, 1], R[2, 2])
    abc = ", ".join(f"{n} {v / DEG:.4f}" for n, v in zip("ABC", (a, b, c), strict=True))
    axes = ", ".join(f"A{k + 1} {v / DEG:.5f}" for k, v in enumerate(start))
    tool = ", ".join(f"{n} {1e3 * v:.3f}" for n, v in zip("XYZ", robot.tool, strict=True))
    lines = [
        "DEF program()",
        "$TOOL = {X 0, Y 0, Z 0, A 0, B 0, C 0}".replace("X 0, Y 0, Z 0", tool),
        "$BASE = $NULLFRAME",
        f"$VEL.CP = {way.feed / factor:.5f}",
        f"$APO.CDIS = {1e3 * way.cdis:.3f}",
        f"PTP {{{axes}}}",
    ]
    for k, p in enumerate(way.corners[1:]):
        xyz = ", ".join(f"{n} {1e3 * v:.4f}" for n, v in zip("XYZ", p, strict=True))
        last = k == len(way.corners) - 2
        lines.append(f"LIN {{{xyz}, {abc}}}" + (" C_DIS" if way.cdis and not last else ""))
    return "\n".join([*lines, "END"]) + "\n"
