"""Joint stiffness that varies, on hidden robots: what is said of loads that were never measured.

A campaign reads 64 postures with and without a load; ``identify`` makes a model of it, ``predict``
says where the arm stands in other postures under other loads. The error counts against what the
loads do there; intervals of single joints against the mean give over the measured postures.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind.campaign import Plan, Rows, drive
from tools.blind.chain import JOINTS, Array, torques
from tools.blind.effects import LIBRARY
from tools.blind.robots import KR210, KR500, RobotClass, cell_text
from tools.blind.world import TOOL_BODY, Hidden, nominal, reference_torque, simulate

TITLE = "Varying stiffness"
HELP = "identify stiffness that varies"
PAIRS, FRESH = 64, 200
"""Postures measured, and asked about."""
SIGMA = 1.5e-5
"""Of a reading, per axis [m]."""
DESIGNS = ("wide_loads", "patch")
_LIMIT_S = 600.0
_FINEST = 1e-6


def draw(number: int, seed: int) -> tuple[RobotClass, Plan, tuple[Hidden, ...]]:
    """Return robot, plan and springs of a case; designs take turns."""
    rng = np.random.default_rng([seed, 23, number])
    robot = (KR500, KR210)[rng.integers(2)]
    plan = plan_of(DESIGNS[number % 2], PAIRS)
    some = drive(robot, plan, rng)
    names = ("joint_compliance", "variable_stiffness")
    drawn = {name: LIBRARY[name].draw(rng, robot, some) for name in names}
    return robot, plan, tuple(Hidden(n, x, 1.0, LIBRARY[n].change) for n, x in drawn.items())


def run(number: int, seed: int, folder: Path) -> dict[str, Any]:
    """Run a case in a folder; return how far its model is off, and which intervals hold."""
    folder.mkdir(parents=True, exist_ok=True)
    robot, plan, hidden = draw(number, seed)
    rng = np.random.default_rng([seed, 24, number])
    cell = folder / "cell.toml"
    cell.write_text(cell_text(robot, 1.0 / robot.arm.give), encoding="utf-8")
    rows = _each_loaded(robot, drive(robot, plan, rng), rng)
    fresh = _each_loaded(robot, drive(robot, plan_of(plan.design, FRESH), rng), rng)
    measured, asked = folder / "measured.csv", folder / "fresh.csv"
    _write(measured, rows, _pairs(robot, rows, hidden), rng)
    still = nominal(robot, fresh)
    _write(asked, fresh, np.stack([still, still]), None)
    model = folder / "model.toml"
    told = json.loads(_called(["identify", measured, "--cell", cell, "-o", model, "--json"]))
    answer = folder / "answer.csv"
    _called(["predict", asked, "--cell", cell, "--model", model, "-o", answer, "-q"])
    free, loaded = _pairs(robot, fresh, hidden)
    said = _points(answer)
    off = (said[1] - said[0]) - (loaded - free)
    inside = [
        _holds(entry, give)
        for entry, give in zip(told["joints"], _mean_give(robot, rows, hidden), strict=True)
    ]
    return {
        "case": number,
        "robot": robot.name,
        "design": plan.design,
        "method": told["method"],
        "error": _rms(off) / _rms(loaded - free),
        "held_out_mm": min(model["held_out_mean_mm"] for model in told["models"]),
        "intervals": [held for held in inside if held is not None],
        "contradictions": contradictions(told),
    }


def plan_of(design: str, postures: int) -> Plan:
    """Return a plan with so many postures; ``drive`` takes three rows for each."""
    return Plan(design, 3 * postures, "three", 0.8, False, 0, False, 0.0)


def contradictions(told: dict[str, Any]) -> int:
    """Return how many joints are called good and doubted at once, or lie off their interval."""
    found = 0
    for entry in told["joints"]:
        k, (low, high) = entry["stiffness_Nmm_per_rad"], entry["stiffness_ci_Nmm_per_rad"]
        if k is not None and low is not None:
            found += not low <= k <= (np.inf if high is None else high)
        name = f"A{entry['joint']}"
        doubted = any("bound" in text and name in text for text in told["warnings"])
        found += entry["status"] == "good" and doubted
    return found


def table(cases: list[dict[str, Any]], title: str) -> str:
    """Return what came of the cases as a table in markdown."""
    lines = [f"# {title}", "", "| design | cases | error, median | mean | worst |"]
    lines.append("|---|--:|--:|--:|--:|")
    for design in DESIGNS:
        error = 100.0 * np.array([c["error"] for c in cases if c["design"] == design])
        if len(error):
            values = (np.median(error), np.mean(error), np.max(error))
            shown = " | ".join(f"{v:.1f} %" for v in values)
            lines.append(f"| {design} | {len(error)} | {shown} |")
    held = [inside for case in cases for inside in case["intervals"]]
    odd = sum(case["contradictions"] for case in cases)
    share = 100.0 * float(np.mean(held)) if held else float("nan")
    told = f"90 % intervals that hold: {share:.0f} % of {len(held)}; contradictions: {odd}"
    lines += ["", told, ""]
    return "\n".join(lines)


def _each_loaded(robot: RobotClass, rows: Rows, rng: np.random.Generator) -> Rows:
    """Return rows each of another pose, with a load of any direction."""
    way = rng.normal(size=(len(rows.q), 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    rows.force[:] = way * 0.8 * robot.force * rng.uniform(0.5, 1.0, (len(way), 1))
    first = np.unique(rows.pose, return_index=True)[1]
    return rows if len(first) == len(rows.q) else rows.take(np.sort(first))


def _pairs(robot: RobotClass, rows: Rows, hidden: tuple[Hidden, ...]) -> Array:
    """Return the points (2, n, 3) without and with the load."""
    free = rows.take(np.arange(len(rows.q)))
    free.force[:] = 0.0
    return np.stack([simulate(robot, r, hidden).point for r in (free, rows)])


def _mean_give(robot: RobotClass, rows: Rows, hidden: tuple[Hidden, ...]) -> Array:
    """Return the give (6,) of the joints [rad/(N*m)], mean over the postures that were measured.

    Springs are a little stiffer under load. What counts is the turn over the torque at the usual
    torque of a joint in the campaign, in every posture, however little the load turns it there.
    """
    loaded = simulate(robot, rows, hidden)
    poses = loaded.poses
    at = poses.tool_point(robot.tool)
    torque = torques(poses, TOOL_BODY, at, rows.force)[:, JOINTS]
    turned = loaded.joints - rows.q
    rate = max(float(h.parameters["hardening"][0]) for h in hidden if "hardening" in h.parameters)
    stiffer = rate / reference_torque(robot)[JOINTS]
    usual = np.sqrt(np.mean(torque**2, axis=0))
    some = np.abs(torque) > _FINEST * usual
    soft = turned / np.where(some, torque, np.nan) * (1.0 + stiffer * np.abs(torque))
    return np.asarray(np.nanmean(soft, axis=0) / (1.0 + stiffer * usual))


def _holds(entry: dict[str, Any], give: float) -> bool | None:
    low, high = entry["stiffness_ci_Nmm_per_rad"]
    if low is None:
        return None
    return bool(low <= 1e3 / give <= (np.inf if high is None else high))


def _write(path: Path, rows: Rows, points: Array, rng: np.random.Generator | None) -> None:
    head = [
        "id",
        *(f"q{k}_deg" for k in range(1, 7)),
        "x_mm",
        "y_mm",
        "z_mm",
        "fx_N",
        "fy_N",
        "fz_N",
    ]
    lines = [",".join(head)]
    for load, point in enumerate(points):
        read = point if rng is None else point + rng.normal(0.0, SIGMA, point.shape)
        for k in range(len(read)):
            values = [*np.rad2deg(rows.q[k]), *(1e3 * read[k]), *(load * rows.force[k])]
            lines.append(",".join([f"{'ab'[load]}{k}", *(f"{v:.6f}" for v in values)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _points(path: Path) -> Array:
    with path.open(encoding="utf-8", newline="") as file:
        rows = [[float(row[f"{a}_mm"]) for a in "xyz"] for row in csv.DictReader(file)]
    return 1e-3 * np.array(rows).reshape(2, -1, 3)


def _rms(points: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(points**2, axis=1))))


def _called(words: list[Any]) -> str:
    command = [sys.executable, "-m", "postproc", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_LIMIT_S, check=False)
    if done.returncode > 1:
        raise RuntimeError(f"{' '.join(command[3:])}: {done.stderr[-800:]}")
    return done.stdout
