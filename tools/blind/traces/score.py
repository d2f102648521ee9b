"""Cases against what the command line says of them: ``python -m tools.blind.traces.score``."""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from postproc.cell import load_cell
from postproc.controller import load_program
from postproc.kinematics import build
from postproc.model import load_model
from postproc.trace import PathDiagnosis, of_program, read_recording
from tools.blind.traces.cases import write_case
from tools.blind.traces.loop import asked

RATIOS = (("feed_deviation", "factor", "factor"), ("corner_rounding", "cdis_mm", "cdis"))
LIMITS = {"hz": 0.5, "cdis": 0.15, "factor": 0.02, "promise": 0.08}
"""What is near enough; other numbers are times [ms], within one."""


def marked(truth: dict[str, Any], told: dict[str, Any]) -> dict[str, Any]:
    """Return what is right and wrong in one answer."""
    real = set(truth["effects"]) - {"outside"}
    rows = told["effects"]
    named = [row["name"] for row in rows if row["adopted"]]
    wrong = [r["name"] for r in rows if r["name"] not in real and r["probability"] > 0.5]
    mark: dict[str, Any] = {
        "verdict": told["verdict"],
        "named": named,
        "wrong_likely": sorted(set(wrong)),
        "wrong_named": sorted(set(named) - real),
        "missed": sorted(real - set(named)),
    }
    if real:
        mark["top"] = bool(named) and named[0] in real
    if truth["effects"]:
        mark["false_calm"] = told["verdict"] == "no_gap"
        said = {row["phase"]: row["share"] for row in told["where"]["phases"]}
        first, true = max(said, key=lambda p: said[p]), truth["phases"]
        mark["phase"] = true.get(first, 0.0) == max(true.values())
        both = {*said, *true}
        mark["shares"] = max(abs(said.get(p, 0.0) - true.get(p, 0.0)) for p in both)
    for row in rows:
        if row["adopted"] and row["name"] in real:
            mark |= _numbers(row["name"], truth["effects"][row["name"]], row["parameters"])
    return mark


def _numbers(name: str, real: dict[str, Any], got: dict[str, Any]) -> dict[str, Any]:
    if name == "vibration":
        return {"hz": [got["frequency_Hz"] - real["frequency_Hz"]]}
    if name == "clock_offset":
        return {"clock_ms": [got["offset_ms"] - real["offset_ms"]]}
    if name == "controller_delay":
        return {"delay_ms": [got["delay_ms"] - real["delay_ms"]]}
    if name == "servo_lag":
        pairs = zip(got["delay_ms"], real["delay_ms"], strict=True)
        return {"delay_ms": [float(a - b) for a, b in pairs if a is not None]}
    for effect, key, short in RATIOS:
        if name == effect:
            return {short: [got[key] / real[key] - 1.0]}
    return {}


def _planner_too(truth: dict[str, Any]) -> None:
    """Add to the truth what can be seen beside the program."""
    if truth["cdis_mm"] > 0.0:
        truth["effects"]["corner_rounding"] = {"cdis_mm": float(truth["cdis_mm"])}
    if truth["factor"] != 1.0:
        truth["effects"]["feed_deviation"] = {"factor": truth["factor"]}


def delivered(folder: Path, told: dict[str, Any], with_program: bool) -> dict[str, Any]:
    """Return the promised share of the contour error left [1] less what a fresh run has of it."""
    model = load_model(folder / "gap" / "model.toml")
    promise = told["contour"].get("left_rms_mm")
    if promise is None:
        return {}
    cell = load_cell(folder / "cell.toml")
    rows, kinematics = read_recording(folder / "fresh.csv"), build(cell.robot)
    path = None
    if with_program:
        modules = load_program(folder / "program.src", on_controller=True)
        path = of_program(modules, cell, kinematics, cell.tool.T_flange_tcp[:3, 3])
    pair = [PathDiagnosis(rows, cell, kinematics, m, program=path) for m in (None, model)]
    before, after = (float(np.sqrt(np.mean(found.contour**2))) for found in pair)
    left = after / max(before, 1e-12)
    return {"promise": [promise / told["contour"]["rms_mm"] - left], "worse": left > 1.02}


def main() -> None:
    """Write cases, run the product on them, print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind")
    parser.add_argument("--program", action="store_true")
    parser.add_argument("-v", action="store_true")
    options = parser.parse_args()
    total: dict[str, list[Any]] = defaultdict(list)
    for seed in range(options.seed, options.seed + options.cases):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            truth = write_case(folder, seed, options.kind)
            more = []
            if options.program:
                _planner_too(truth)
                more = ["--program", folder / "program.src"]
            told = asked(
                "diagnose", "--trace", folder / "log.csv", "--cell", folder / "cell.toml",
                "-o", folder / "gap", *more,
            )  # fmt: skip
            mark = marked(truth, told) | delivered(folder, told, options.program)
        if options.v:
            what = {k: v for k, v in mark.items() if v is not None and v != []}
            print(seed, truth["kind"], json.dumps(truth["effects"])[:300], "->", json.dumps(what))
        for key, value in mark.items():
            total[key] += value if key in LIMITS or key.endswith("_ms") else [value]
        total[f"verdict of {truth['kind']}"].append(mark["verdict"])
    _table(total)


def _table(total: dict[str, list[Any]]) -> None:
    for key, values in sorted(total.items()):
        if key in LIMITS or key.endswith("_ms"):
            size, limit = np.abs(values), LIMITS.get(key, 1.0)
            ends = " ".join(f"{q:.0%}: {np.quantile(size, q):.3f}" for q in (0.5, 0.9, 1))
            print(f"{key} n={len(size)} {ends}, within {limit}: {np.mean(size <= limit):.1%}")
        elif key == "shares":
            print(f"{key} n={len(values)} within .1: {np.mean(np.array(values) <= 0.1):.1%}")
        elif key in ("top", "phase", "worse", "false_calm"):
            print(f"{key} {np.mean(values):.1%} of {len(values)}")
        elif key.startswith("verdict of"):
            print(key, {v: values.count(v) for v in sorted(set(values))})
        elif key in ("wrong_likely", "wrong_named", "missed"):
            print(key, f"{np.mean([bool(v) for v in values]):.1%}", [v for v in values if v][:12])


if __name__ == "__main__":
    main()
