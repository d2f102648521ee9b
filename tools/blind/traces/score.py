"""Cases against what the product says of them: ``python -m tools.blind.traces.score``."""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from postproc.cell import load_cell
from postproc.jobs.diagnose_trace import diagnose_trace
from tools.blind.traces.cases import write_case

RATIOS = (("feed_deviation", "factor", "factor"), ("corner_rounding", "cdis_mm", "cdis"))


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
    for row in rows:
        if row["adopted"] and row["name"] in real:
            mark |= _numbers(row["name"], truth["effects"][row["name"]], row["parameters"])
    return mark


def _numbers(name: str, real: dict[str, Any], got: dict[str, Any]) -> dict[str, Any]:
    if name == "vibration":
        return {"hz": got["frequency_Hz"] - real["frequency_Hz"]}
    if name == "clock_offset":
        return {"clock_ms": got["offset_ms"] - real["offset_ms"]}
    if name == "controller_delay":
        return {"delay_ms": [got["delay_ms"] - real["delay_ms"]]}
    if name == "servo_lag":
        pairs = zip(got["delay_ms"], real["delay_ms"], strict=True)
        return {"delay_ms": [a - b for a, b in pairs if a is not None]}
    for effect, key, short in RATIOS:
        if name == effect:
            return {short: got[key] / real[key] - 1.0}
    return {}


def _planner_too(truth: dict[str, Any]) -> None:
    """Add to the truth what can be seen beside the program."""
    if truth["cdis_mm"] > 0.0:
        truth["effects"]["corner_rounding"] = {"cdis_mm": truth["cdis_mm"]}
    if truth["factor"] != 1.0:
        truth["effects"]["feed_deviation"] = {"factor": truth["factor"]}


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
        with tempfile.TemporaryDirectory() as folder:
            truth = write_case(Path(folder), seed, options.kind)
            program = Path(folder) / "program.src" if options.program else None
            if program is not None:
                _planner_too(truth)
            cell = load_cell(Path(folder) / "cell.toml")
            told = diagnose_trace(Path(folder) / "log.csv", cell, program=program).document
        mark = marked(truth, told)
        what = {k: v for k, v in mark.items() if v not in ([], None)}
        if options.v:
            print(seed, truth["kind"], json.dumps(truth["effects"])[:200], "->", json.dumps(what))
        for key, value in mark.items():
            total[key] += value if key == "delay_ms" else [value]
        total[f"verdict of {truth['kind']}"].append(mark["verdict"])
    _table(total)


def _table(total: dict[str, list[Any]]) -> None:
    for key, values in sorted(total.items()):
        if key in ("hz", "clock_ms", "delay_ms", "cdis", "factor"):
            size = np.abs(values)
            print(
                key,
                f"n={len(size)}",
                *(f"{q:.0%}: {np.quantile(size, q):.3f}" for q in (0.5, 0.9, 1)),
            )
            limit = {"hz": 0.5, "cdis": 0.15, "factor": 0.02}.get(key, 1.0)
            print("   within", limit, f"{np.mean(size <= limit):.1%}")
        elif key == "top":
            print("top right", f"{np.mean(values):.1%} of {len(values)}")
        elif key.startswith("verdict of"):
            print(key, {v: values.count(v) for v in sorted(set(values))})
        elif key in ("wrong_likely", "wrong_named", "missed"):
            print(key, f"{np.mean([bool(v) for v in values]):.1%}", [v for v in values if v][:12])


if __name__ == "__main__":
    main()
