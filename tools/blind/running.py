"""Runs the product on the cases, only through its command line; resumable."""

from __future__ import annotations

import csv
import json
import math
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind.names import INSTRUMENT
from tools.blind.pages import contradictions

LIMIT_S = 300.0
Record = dict[str, Any]


def run_all(folder: Path, answers: list[Record], processes: int, again: bool) -> list[Record]:
    """Return one record a case, from earlier runs where there are any.

    Args:
        folder: of the generated cases.
        answers: the cases, for their names and calls.
        processes: cases at a time.
        again: do not use earlier records.
    """
    runs = folder / "runs"

    def one(answer: Record) -> Record:
        path = runs / answer["case"] / "record.json"
        if path.is_file() and not again:
            kept: Record = json.loads(path.read_text(encoding="utf-8"))
            return kept
        record = run_case(folder / "cases" / answer["case"], path.parent, answer)
        path.write_text(json.dumps(record) + "\n", encoding="utf-8")
        print(f"{answer['case']} {record['seconds']:.1f} s", file=sys.stderr, flush=True)
        return record

    with ThreadPoolExecutor(processes) as pool:
        return list(pool.map(one, answers))


def run_case(case: Path, out: Path, answer: Record) -> Record:
    """Return the diagnosis of a case, its run time, and what its model does on new rows."""
    out.mkdir(parents=True, exist_ok=True)
    cell = ["--cell", str(case / "cell.toml")]
    register = ["--register"] if answer["registered"] else []
    known = ["--model", str(case / "known.toml")] if answer["known_stiffness"] else []
    start = time.perf_counter()
    call = ["diagnose", str(case / "measured.csv"), *cell, *known, *register, "--json"]
    done = _call([*call, "-o", str(out)])
    record: Record = {"case": answer["case"], "seconds": time.perf_counter() - start}
    record["exit"], record["error"] = done.returncode, done.stderr[-400:]
    try:
        record["diagnosis"] = json.loads(done.stdout)
    except json.JSONDecodeError:
        record["diagnosis"] = None
        return record
    page = out / "report.html"
    record["contradictions"] = (
        contradictions(record["diagnosis"], page.read_bytes()) if page.is_file() else []
    )
    found = ["--model", str(_arm(out / "model.toml"))] if (out / "model.toml").is_file() else known
    for name in ("fresh", "transfer"):
        rows = case / f"{name}.csv"
        before = _miss(rows, out / f"{name}_before.csv", [*cell, *known, *register])
        after = _miss(rows, out / f"{name}_after.csv", [*cell, *found, *register])
        record[name] = {"before_mm": before, "after_mm": after}
        record[name] |= _promise(rows, out / f"{name}_after.csv")
    return record


def _arm(model: Path) -> Path:
    """Return a model without what was of one set-up of the instrument: new rows have another.

    Tools, fixtures and the rail stay what they are, and new rows log which.
    """
    parts = re.split(r"(?m)^(?=\[)", model.read_text(encoding="utf-8"))
    path = model.with_name("arm.toml")
    gone = "|".join(sorted(INSTRUMENT))
    kept = "".join(part for part in parts if not re.match(rf"\[+instrument\.({gone})\b", part))
    path.write_text(kept, encoding="utf-8")
    return path


def _promise(rows: Path, out: Path) -> Record:
    """Return how many points lie within their promised radius, of how many inside."""
    if not out.is_file():
        return {}
    measured, held = _points(rows), []
    with out.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row.get("inside") != "1":
                continue
            expected = [float(row[f"{axis}_mm"]) for axis in "xyz"]
            held.append(math.dist(expected, measured[row["id"]]) <= float(row["u95_mm"]))
    return {"held": sum(held), "inside": len(held)}


def _call(arguments: list[str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "postproc", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 124, "", f"over {LIMIT_S:g} s")


def _miss(rows: Path, out: Path, options: list[str]) -> float | None:
    """Return how far a model's points lie from the measured ones (rms) [mm]; None if it failed."""
    if _call(["predict", str(rows), *options, "-o", str(out), "--quiet"]).returncode != 0:
        return None
    measured, expected = _points(rows), _points(out)
    away = np.array([measured[name] for name in expected]) - np.array(list(expected.values()))
    return float(np.sqrt(np.mean(np.sum(away**2, axis=1))))


def _points(path: Path) -> dict[str, list[float]]:
    with path.open(encoding="utf-8", newline="") as file:
        return {
            row["id"]: [float(row[f"{axis}_mm"]) for axis in "xyz"] for row in csv.DictReader(file)
        }
