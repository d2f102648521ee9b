"""Processor time of reading KRL: `python tools/bench_krl_read.py [--points 100000]`.

Parse, lint, verify (against the path it was made from, without collisions) and diff of one program
with that many LIN motions. Each line: seconds of one core, and what was done.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.cell import Cell
from postproc.cell.file import load_cell
from postproc.comparison.diff import diff_bytes
from postproc.krl.lint import lint
from postproc.krl.rules.subject import LintOptions
from postproc.krl.text.parse import parse_files
from postproc.model.toolpath import ToolPath
from postproc.verification.verify import verify_modules

CELL = Path(__file__).resolve().parent.parent / "tests" / "cell" / "data" / "drilling_kr500.toml"
HEAD = """&ACCESS RVP
DEF SPIRAL( )
;FOLD INI
BAS(#INITMOV,0)
;ENDFOLD
BAS(#TOOL,1)
BAS(#BASE,1)
$VEL.CP=0.020000
$APO.CDIS=0.0500
PTP {A1 -5.14,A2 -73.15,A3 101.79,A4 -174.35,A5 -61.92,A6 -7.83}
"""
T = TypeVar("T")


def cell_of_the_bench() -> Cell:
    """The drilling cell with its workpiece where the arm reaches all around the origin."""
    cell = load_cell(CELL)
    T_robroot_base = np.eye(4)
    T_robroot_base[:3, 3] = (1.9, 0.1, 1.1)
    return replace(cell, workpiece=replace(cell.workpiece, T_robroot_base=T_robroot_base))


def spiral(n: int) -> FloatArray:
    """Points (n, 3) [mm] of a spiral on a panel, 0.2 mm apart or so."""
    angle = np.linspace(0.0, n / 250.0, n)
    radius = np.linspace(40.0, 60.0, n)
    return np.column_stack([np.zeros(n), radius * np.cos(angle), radius * np.sin(angle)])


def program(points: FloatArray) -> bytes:
    """The program that drives along the points."""
    blends = ["C_DIS"] * (len(points) - 1) + [""]
    lines = [
        f"LIN {{X {x:.4f},Y {y:.4f},Z {z:.4f},A 0.00000,B 0.00000,C 175.00000}} {blend} ; line {i}"
        for i, ((x, y, z), blend) in enumerate(zip(points.tolist(), blends, strict=True), 1)
    ]
    return (HEAD + "\n".join(lines) + "\nEND\n").replace("\n", "\r\n").encode("ascii")


def path(points: FloatArray) -> ToolPath:
    """The same as CAM data."""
    n = len(points)
    return ToolPath(
        path="spiral.cls",
        name="SPIRAL",
        format="apt",
        dialect="nx",
        units="mm",
        points=points * 1e-3,
        axes=np.tile([-1.0, 0.0, 0.0], (n, 1)),
        kind=np.where(np.arange(n) == 0, 0, 1),
        feed=np.full(n, 0.02),
        line=np.arange(1, n + 1),
        operation=np.full(n, -1),
        tool=np.full(n, -1),
        arc=np.full(n, -1),
        cycle=np.full(n, -1),
    )


def timed(what: str, work: Callable[[], T]) -> T:
    """Run and print the processor time."""
    start = time.process_time()
    result = work()
    print(f"{time.process_time() - start:7.2f} s  {what}")
    return result


def main() -> None:
    """Read one program in every way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=100_000)
    n = parser.parse_args().points
    points = spiral(n)
    old = program(points)
    cell, toolpath = cell_of_the_bench(), path(points)
    modules = timed(f"parse {n} points", lambda: parse_files({"SPIRAL.src": old}))
    large = LintOptions(max_points=n + 1, max_bytes=len(old) + 1)
    findings = timed("lint", lambda: lint(modules, large))
    print(f"           {len(findings)} findings")
    report = timed(
        "verify against the path, no collisions",
        lambda: verify_modules(modules, "SPIRAL", cell, toolpath, collisions=False),
    )
    print(f"           {len(report.violations)} violations, {report.matched} of {n} matched")
    points[n // 2, 1] += 0.5
    new = program(np.delete(points, n // 3, axis=0))
    found = timed("diff, one point moved, one removed", lambda: diff_bytes(old, new, "SPIRAL.src"))
    print(f"           {found.counts()}")
    moved = program(points + 0.1)
    found = timed("diff, every point moved", lambda: diff_bytes(old, moved, "SPIRAL.src"))
    print(f"           {found.counts()}")


if __name__ == "__main__":
    main()
