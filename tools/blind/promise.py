"""What a plan promises against what its campaign leaves, on hidden robots.

A part with holes, and a plan for a diagnosis over its place (``sample --for-diagnosis --for``). The
hidden robot takes the readings of the plan; they are diagnosed; what the model then misses is
measured at fresh poses of the box, with noise, and at the holes as the product drives to them,
without. A tracker stands anywhere, and every arm has errors of zeros and geometry.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind import loop
from tools.blind.beyond import make
from tools.blind.campaign import Rows
from tools.blind.chain import Array, Geometry, embed, rotation, solve_pose, sweep
from tools.blind.loop import Driven, Job, asked, cell_of, driven, holes, poses, program_of
from tools.blind.robots import KR210, KR500
from tools.blind.world import simulate

TITLE = "Promise of a plan"
HELP = "what a plan says that it will leave, and what is left"
BOX = np.array([[-0.25, -0.5, 0.0], [0.75, 0.6, 0.7]])
"""Corners of the measured space about the part's corner [m]."""
FRESH = 80
MORE = ("gravity_sag", "backlash", "transmission_error", "gear_coupling", "counterbalance")
_WARMING, _SLOW, _PAUSE = 4.0, 3000.0, 30.0


@dataclass(frozen=True)
class Hand:
    """A hidden robot with its part, the count of postures, and the noise per axis [m]."""

    job: Job
    count: int
    sigma: float


def draw(number: int, seed: int) -> Hand:
    """Return a case."""
    rng = np.random.default_rng([seed, 29, number])
    robot = (KR500, KR210)[rng.integers(2)]
    rows = poses(robot, rng)
    names = ["joint_offset", "link_geometry", *rng.choice(MORE, number % 3, replace=False)]
    hidden = [
        make(str(name), rng, robot, rows).scaled(float(np.exp(rng.normal(0.0, 0.4))))
        for name in names
    ]
    points, text = holes(rng)
    source, lines = ("holes.csv", text), tuple(range(2, 2 + len(points)))
    job = Job(number, "drilling", robot, tuple(hidden), np.zeros(3), source, points, lines)
    return Hand(job, int(rng.integers(30, 90)), float(np.exp(rng.uniform(*np.log([1.5e-5, 6e-5])))))


def run(number: int, seed: int, folder: Path) -> dict[str, Any]:
    """Run a case in a folder; return what was promised and what came of it."""
    hand = draw(number, seed)
    job, rng = hand.job, np.random.default_rng([seed, 30, number])
    folder.mkdir(parents=True, exist_ok=True)
    cell = folder / "cell.toml"
    told = f"\n[measuring]\nsigma_mm = {1e3 * hand.sigma:.5f}\n"
    cell.write_text(cell_of(job) + told, encoding="utf-8")
    source = folder / job.source[0]
    source.write_text(job.source[1], encoding="utf-8")
    drive = driven(job, program_of(folder / "plain", source, cell, None))
    box = 1e3 * (loop.BASE + BOX).ravel()
    call = ["sample", "--cell", cell, "--for-diagnosis", "--count", hand.count, "-o", folder]
    plans = {"for": ["--for", source], "plain": []}
    found: dict[str, Any] = {"case": number, "robot": job.robot.name}
    found |= {"hidden": [e.name for e in job.hidden], "sigma_mm": 1e3 * hand.sigma}
    for name, more in plans.items():
        plan = asked([*call, "--box", *box, *more, "--name", name])
        rows = _planned(folder / f"{name}.csv", rng)
        out = folder / name
        _table(folder / f"{name}.csv", hand, rows, hand.sigma, rng)
        answer = asked(
            ["diagnose", folder / f"{name}.csv", "--cell", cell, "--register", "-o", out]
        )
        fresh = _fresh(job, rows, rng)
        ask = ["--cell", cell, "--model", out / "model.toml"]
        found[name] = {
            "promise": plan.get("promise"),
            "readings": len(rows.q),
            "verdict": answer["verdict"],
            "named": answer["adopted"],
            "left_mm": _missed(folder / f"{name}_fresh.csv", hand, fresh, ask, hand.sigma, rng),
            "left_without_mm": _missed(folder / f"{name}_true.csv", hand, fresh, ask, 0.0, rng),
            "job_mm": _missed(
                folder / f"{name}_job.csv", hand, _at_holes(drive, rows), ask, 0.0, rng
            ),
        }
    return found


def _planned(path: Path, rng: np.random.Generator) -> Rows:
    """Return the rows of a plan, half a minute apart, the arm warming up."""
    lines = path.read_text(encoding="utf-8").splitlines()
    table = list(csv.DictReader(line for line in lines if not line.startswith("#")))

    def columns(names: list[str]) -> Array:
        return np.array([[float(row.get(name) or 0.0) for name in names] for row in table])

    n = len(table)
    time = _PAUSE * np.arange(n)
    warm = 20.0 + _WARMING * (1.0 - np.exp(-time / _SLOW)) + rng.normal(0.0, 0.02, n)
    return Rows(
        np.deg2rad(columns([f"q{k}_deg" for k in range(1, 7)])),
        columns(["fx_N", "fy_N", "fz_N"]),
        time,
        np.round(warm, 2),
        columns([f"dir{k}" for k in range(1, 7)]),
        np.zeros((n, 6)),
        np.full(n, 2.0),
        np.arange(n),
        20.0,
    )


def _fresh(job: Job, rows: Rows, rng: np.random.Generator) -> Rows:
    """Return fresh rows of the box: a planned posture carried elsewhere and turned."""
    n = 6 * FRESH
    start = rows.q[rng.integers(len(rows.q), size=n)]
    at = sweep(Geometry.of(job.robot.arm, n), embed(start))
    axis = rng.normal(size=(n, 3))
    turn = rotation(axis / np.linalg.norm(axis, axis=1)[:, None], rng.normal(0.0, 0.3, n))
    R = turn @ at.flange_turn
    tip = loop.BASE + rng.uniform(*BOX, (n, 3))
    q, good = solve_pose(job.robot.arm, tip - R @ job.robot.tool, R, start)
    bounds = np.deg2rad(job.robot.range_deg)
    inside = np.all((q > bounds[:, 0] - 0.1) & (q < bounds[:, 1] + 0.1), axis=1)
    q = q[np.flatnonzero(good & inside)[:FRESH]]
    return _late(q, rng.choice([-1.0, 1.0], q.shape), np.zeros((len(q), 3)), rows)


def _at_holes(drive: Driven, rows: Rows) -> Rows:
    """Return the rows at the holes, as the program drives to them, after the campaign."""
    at = drive.rows.take(drive.at)
    return _late(at.q, np.sign(at.direction), at.force, rows)


def _late(q: Array, direction: Array, force: Array, rows: Rows) -> Rows:
    n = len(q)
    time = rows.time[-1] + _PAUSE * (1.0 + np.arange(n))
    return Rows(
        q, force, time, np.full(n, rows.temp[-1]), direction, np.zeros((n, 6)), np.full(n, 2.0),
        np.arange(n), 20.0,
    )  # fmt: skip


def _table(path: Path, hand: Hand, rows: Rows, sigma: float, rng: np.random.Generator) -> Array:
    """Write readings by a tracker; return the points it saw (n, 3) [m]."""
    own = np.random.default_rng([31, hand.job.number])
    angle, shift = own.uniform(-3.0, 3.0, 1), own.uniform(-3.0, 3.0, 3)
    R = rotation(np.array([[0.0, 0.0, 1.0]]), angle)[0]
    point = simulate(hand.job.robot, rows, hand.job.hidden).point @ R.T + shift
    point = point + rng.normal(0.0, sigma, point.shape) if sigma else point
    head = ["id", *(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm", "time_s", "temp_C"]
    head += [*(f"dir{k}" for k in range(1, 7)), "fx_N", "fy_N", "fz_N"]
    force = rows.force if np.any(rows.force) else np.zeros((len(point), 0))
    head = head if force.shape[1] else head[:-3]
    lines = [",".join(head)]
    for k in range(len(point)):
        cells = [f"{v:.7f}" for v in (*np.rad2deg(rows.q[k]), *(1e3 * point[k]), rows.time[k])]
        cells += [f"{rows.temp[k]:.2f}", *(f"{v:.0f}" for v in rows.direction[k])]
        cells += [f"{v:.3f}" for v in force[k]]
        lines.append(",".join([f"r{k}", *cells]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return point


def _missed(
    path: Path, hand: Hand, rows: Rows, ask: list[Any], sigma: float, rng: np.random.Generator
) -> float:
    """Return by how much a model misses rows, 3D rms [mm]."""
    point = _table(path, hand, rows, sigma, rng)
    out = path.with_suffix(".out.csv")
    asked(["predict", path, *ask, "-o", out])
    with out.open(encoding="utf-8", newline="") as file:
        told = [[float(row[f"{axis}_mm"]) for axis in "xyz"] for row in csv.DictReader(file)]
    return float(np.sqrt(np.mean(np.sum((np.array(told) - 1e3 * point) ** 2, axis=1))))


def table(cases: list[dict[str, Any]], title: str) -> str:
    """Return the cases as a table in markdown: promised against got."""
    head = ["case", "robot", "hidden", "noise", "plan", "rows", "named"]
    head += ["left promised", "got", "ratio", "job promised", "got", "ratio"]
    lines = [f"# {title}", "", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    ratios: dict[str, list[float]] = {"rms_left_mm": [], "at_the_job_mm": []}
    for case in cases:
        for name in ("plain", "for"):
            one = case[name]
            cells = [str(case["case"]), case["robot"], ", ".join(case["hidden"][2:])]
            cells += [f"{case['sigma_mm']:.3f}", name, str(one["readings"])]
            cells.append(f"{one['verdict']}: {', '.join(one['named'])}")
            for key, got in (("rms_left_mm", "left_mm"), ("at_the_job_mm", "job_mm")):
                told = (one["promise"] or {}).get(key)
                ratio = float("nan") if told is None else one[got] / told
                if told is not None:
                    ratios[key].append(ratio)
                cells += ["-" if told is None else f"{told:.4f}", f"{one[got]:.4f}", f"{ratio:.2f}"]
            lines.append("| " + " | ".join(cells) + " |")
    for key, some in ratios.items():
        within = np.abs(np.log(some)) <= np.log(1.25)
        lines.append(
            f"\n{key}, got over promised: median {np.median(some):.2f}, {within.sum()} of"
            f" {len(some)} within 25 %"
        )
    better = [case["for"]["job_mm"] / case["plain"]["job_mm"] for case in cases]
    lines.append(f"\nat the job, planned for it over plain: median {np.median(better):.2f}\n")
    return "\n".join(lines)
