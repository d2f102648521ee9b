"""A drawn case as files: what the product may read, and the sealed answer beside."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind import forms
from tools.blind.campaign import Plan, Rows, drive
from tools.blind.case import Case
from tools.blind.cases import draw, kinds, wanted
from tools.blind.chain import Array, rotation
from tools.blind.names import STATION
from tools.blind.robots import cell_text, model_text, urdf
from tools.blind.sizes import joint_give, rare, truth
from tools.blind.world import joint_shares, simulate

FRESH_ROWS = 80
ENOUGH = 10
"""Rows measured again from which the noise is known."""
GAPS = 0.26
"""Share of temperatures that nobody wrote down, where some are missing."""


def generate(folder: Path, count: int, seed: int) -> list[dict[str, Any]]:
    """Write ``count`` cases and the sealed answers.

    Args:
        folder: gets ``cases/NNNN/`` and ``answers.json``.
        count: how many.
        seed: of everything that is drawn.

    Returns:
        The answers.
    """
    all_kinds = kinds(count, seed)
    names = wanted(all_kinds, seed)
    answers = []
    for number, (kind, some) in enumerate(zip(all_kinds, names, strict=True), start=1):
        case = draw(number, kind, some, seed)
        answers.append(write_case(folder / "cases" / f"{number:04d}", case, seed))
    sealed = {"schema": "blind.answers/1", "seed": seed, "cases": answers}
    (folder / "answers.json").write_text(json.dumps(sealed, indent=1) + "\n", encoding="utf-8")
    return answers


def write_case(folder: Path, case: Case, seed: int) -> dict[str, Any]:
    """Write what the product may read of a case; return the answer."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 3, case.number])
    text = cell_text(case.robot, case.stiffness)
    told = case.plan.repeats == 0 and case.number % 4 > 0
    if told:
        # what the instrument is said to have, within a fifth
        size = 1e3 * case.sigma * float(np.exp(rng.normal(0.0, 0.1)))
        text += f"\n[measuring]\nsigma_mm = {size:.5f}\n"
    (folder / "cell.toml").write_text(text, encoding="utf-8")
    if case.robot.builtin is None:
        (folder / "robot.urdf").write_text(urdf(case.robot), encoding="utf-8")
    if case.known is not None:
        (folder / "known.toml").write_text(model_text(case.known), encoding="utf-8")
    faults = _write_rows(folder / "measured.csv", case, case.rows, rng, case.outliers)
    later = replace(
        case,
        entries=tuple(e for e in case.entries if e.effect.name not in STATION),
        form="xyz",
    )
    for name, plan in (("fresh.csv", _same(case.plan)), ("transfer.csv", _other(case.plan, rng))):
        rows = drive(case.robot, plan, rng, case.rows.start_temp)
        if case.plan.loads != "none":
            most = float(np.max(np.linalg.norm(case.rows.force, axis=1)))
            now = float(np.max(np.linalg.norm(rows.force, axis=1)))
            rows = replace(rows, force=rows.force * most / max(now, 1e-9))
        _write_rows(folder / name, later, rows, rng, 0.0)
    known = told or case.form == "sigmas" or case.plan.repeats >= ENOUGH
    return _answer(case, faults) | {"noise_told": known}


def _same(plan: Plan) -> Plan:
    return replace(plan, rows=FRESH_ROWS, repeats=0, pace=plan.rows / FRESH_ROWS)


def _other(plan: Plan, rng: np.random.Generator) -> Plan:
    """Return another design with the same kind of loads."""
    loaded = plan.loads != "none"
    names = ("wide_loads" if loaded else "wide_noload", "patch", "grid")
    design = str(rng.choice([name for name in names if name != plan.design]))
    return replace(_same(plan), design=design, loads="three" if loaded else "none")


def _answer(case: Case, faults: list[str]) -> dict[str, Any]:
    outcome = simulate(case.robot, case.rows, case.hidden)
    shares, by_joints = joint_shares(case.robot, case.rows, outcome)
    seen = case.plan.loads != "none" and "wrench" not in case.dropped
    return {
        "case": f"{case.number:04d}",
        "kind": case.kind,
        "robot": case.robot.name,
        "design": case.plan.design,
        "loads": case.plan.loads if seen or case.plan.loads == "none" else "not logged",
        "rows": len(case.rows.q),
        "repeats": case.plan.repeats,
        "registered": case.registered,
        "known_stiffness": case.known is not None,
        "dropped": list(case.dropped),
        "noise_mm": case.sigma * 1e3,
        "outliers": faults,
        "genuine": [f"r{k + 1}" for k in rare(case)],
        "form": case.form,
        "truth": truth(case),
        "joint_share": None if case.registered else np.round(shares, 4).tolist(),
        "joints_explain": None if case.registered else round(by_joints, 4),
        "joint_Nmm_per_rad": (1e3 / joint_give(case)).tolist(),
    }


def _write_rows(
    path: Path, case: Case, rows: Rows, rng: np.random.Generator, outliers: float
) -> list[str]:
    """Write a measurement file; return the names of its measuring faults."""
    outcome = simulate(case.robot, rows, case.hidden)
    n = len(rows.q)
    point = outcome.point
    if case.registered:
        point = _seen_by_tracker(point, rng)
    noise = rng.normal(0, case.sigma, (n, 3))
    faulty = np.flatnonzero(rng.random(n) < outliers)
    way = rng.normal(size=(len(faulty), 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    wrong = way * np.exp(rng.uniform(np.log(5e-4), np.log(5e-3), (len(faulty), 1)))
    names = [f"r{k + 1}" for k in range(n)]
    table: dict[str, list[str]] = {"id": names}
    if case.form == "plane":
        noise[faulty] += wrong
        rows, readings = forms.touch(
            case.robot.arm,
            rows,
            lambda now: simulate(case.robot, now, case.hidden).point + noise,
            rng,
        )
    else:
        seen = point.copy()
        seen[faulty] += wrong
        readings = forms.read(case.form, seen, noise, rng)
    _put(table, [f"q{i}_deg" for i in range(1, 7)], np.rad2deg(rows.q), 7)
    table |= readings
    _put_optional(table, case, rows, rng)
    if not case.registered and case.number % 5 == 0:
        turned = _abc(outcome.poses.flange_turn) + np.rad2deg(rng.normal(0, 1e-4, (n, 3)))
        _put(table, ["a_deg", "b_deg", "c_deg"], turned, 6)
    if case.form == "gaps" and "temp_C" in table:
        away = rng.random(n) < GAPS
        table["temp_C"] = ["" if o else c for c, o in zip(table["temp_C"], away, strict=True)]
    lines = [",".join(table), *(",".join(cells) for cells in zip(*table.values(), strict=True))]
    if outliers > 0.0 and case.number % 3 == 0 and case.form in ("xyz", "sigmas"):
        lines = _dirty(lines, rng)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return [names[k] for k in faulty]


def _dirty(lines: list[str], rng: np.random.Generator) -> list[str]:
    """Copy some rows, swap the readings of neighbours, write a row in metres, leave a blank."""
    header, table = lines[0].split(","), [line.split(",") for line in lines[1:]]
    at = [header.index(f"{axis}_mm") for axis in "xyz"]
    n = len(table)
    for k in rng.choice(n - 1, max(1, n // 100), replace=False):
        for i in at:
            table[k][i], table[k + 1][i] = table[k + 1][i], table[k][i]
    for i in at:
        table[n // 2][i] = repr(float(table[n // 2][i]) * 1e-3)
    if "temp_C" in header:
        table[n // 3][header.index("temp_C")] = ""
    copies = [list(table[k]) for k in rng.choice(n, 3, replace=False)]
    return [lines[0], *(",".join(row) for row in table + copies)]


def _put(table: dict[str, list[str]], names: list[str], values: Array, digits: int) -> None:
    for name, column in zip(names, np.reshape(values, (len(values), -1)).T, strict=True):
        table[name] = [f"{value:z.{digits}f}" for value in column]


def _put_optional(
    table: dict[str, list[str]], case: Case, rows: Rows, rng: np.random.Generator
) -> None:
    dropped, number = case.dropped, case.number
    if "time_s" not in dropped:
        _put(table, ["time_s"], rows.time, 1)
    if "temp_C" not in dropped:
        _put(table, ["temp_C"], rows.temp, 2)
    if "dir" not in dropped:
        _put(table, [f"dir{i}" for i in range(1, 7)], rows.direction, 0)
    if "qd" not in dropped:
        _put(table, [f"qd{i}_deg_s" for i in range(1, 7)], np.rad2deg(rows.qd), 5)
    if case.plan.loads != "none" and "wrench" not in dropped:
        _put(table, ["fx_N", "fy_N", "fz_N"], rows.force, 3)
    for name, values in rows.marks.items():
        table[name] = [f"{value:g}" for value in values]
    if number % 3 == 0:
        table["group"] = [f"p{k}" for k in rows.pose]
    if number % 4 == 0:
        _put(table, ["humidity"], 45 + np.cumsum(rng.normal(0, 0.1, len(rows.q))), 1)
    if number % 2 == 0:
        _put(table, ["dwell_s"], rows.dwell, 1)


def _seen_by_tracker(point: Array, rng: np.random.Generator) -> Array:
    """Return points in the frame of a tracker that stands anywhere."""
    angles = np.array([rng.uniform(-3.1, 3.1), rng.uniform(-0.05, 0.05), rng.uniform(-0.05, 0.05)])
    R = np.eye(3)
    for k, axis in enumerate(np.eye(3)[[2, 1, 0]]):
        R = R @ rotation(axis[None], angles[k : k + 1])[0]
    seen: Array = point @ R.T + rng.uniform(-4, 4, 3)
    return seen


def _abc(R: Array) -> Array:
    """Return KUKA A, B, C [deg] of rotations Rz(A) Ry(B) Rx(C)."""
    b = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 0, 0], R[:, 1, 0]))
    a = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    c = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    return np.rad2deg(np.stack([a, b, c], axis=1))
