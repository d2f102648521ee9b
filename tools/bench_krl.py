"""Processor time of writing KRL: `python tools/bench_krl.py [--points 100000]`.

Each line: seconds of one core, and what was done.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from postproc.cell.cell import Cell
from postproc.cell.file import load_cell
from postproc.cell.options import krl_of
from postproc.cell.schema import KrlTable
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.geometry.frames import rotation_from_abc, transform
from postproc.model.plan import MoveKind, MoveRole, Plan
from postproc.model.toolpath import ToolPath

CELL = Path(__file__).resolve().parent.parent / "tests" / "cell" / "data" / "drilling_kr500.toml"
T = TypeVar("T")


def spiral(n: int) -> Plan:
    """A 5-axis cut of n points on a spiral, feed and approximation as CAM systems give them."""
    angle = np.linspace(0.0, 200.0, n)
    path = ToolPath(
        path="spiral.cls",
        name="SPIRAL",
        format="apt",
        dialect="nx",
        units="mm",
        points=np.zeros((n, 3)),
        axes=np.tile([0.0, 0.0, 1.0], (n, 1)),
        kind=np.ones(n),
        feed=np.full(n, 0.02),
        line=np.arange(1, n + 1),
        operation=np.full(n, -1),
        tool=np.full(n, -1),
        arc=np.full(n, -1),
        cycle=np.full(n, -1),
    )
    p = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), angle * 1e-3])
    R = rotation_from_abc(np.column_stack([angle % 3.0, 1.0 + 0.1 * np.sin(angle), angle % 0.5]))
    is_first = np.arange(n) == 0
    nothing = np.full(n, np.nan)
    return Plan(
        name="SPIRAL",
        toolpath=path,
        kind=np.where(is_first, MoveKind.PTP, MoveKind.LIN),
        role=np.where(is_first, MoveRole.ENTRY, MoveRole.CUT),
        tag=np.arange(n),
        T_base_tcp=transform(R, p),
        aux=np.full((n, 3), np.nan),
        q=np.column_stack([np.sin(angle * k) for k in range(1, 7)]),
        spin=np.zeros(n),
        branch=np.zeros(n),
        speed=np.where(is_first, np.nan, 0.02),
        ptp_fraction=np.where(is_first, 0.5, np.nan),
        blend=np.full(n, 1e-3),
        dwell=np.zeros(n),
        duration=np.zeros(n),
        external=np.zeros((n, 0)),
        stiffness=nothing,
        stiffness_initial=nothing,
        clearance=nothing,
    )


def styled(cell: Cell, points_per_file: int, **style: object) -> Cell:
    """The cell with another style of programs."""
    table = KrlTable(max_points_per_file=points_per_file, **style)
    return replace(cell, krl=krl_of(table))


def timed(what: str, work: Callable[[], T]) -> T:
    """Run and print the processor time."""
    start = time.process_time()
    result = work()
    print(f"{time.process_time() - start:7.2f} s  {what}")
    return result


def main() -> None:
    """Write one plan in each style."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=100_000)
    n = parser.parse_args().points
    cell, plan = load_cell(CELL), spiral(n)
    emit(spiral(10), cell)  # templates and imports
    for name, style in (
        ("dense, 1000 points per file", {}),
        ("dense, points in the data list", {"points": "dat"}),
        ("spline blocks", {"motion": "spline_block"}),
    ):
        own = styled(cell, 1000, **style)
        modules = timed(f"emit {n} points, {name}", lambda own=own: emit(plan, own))
        files = timed("  print them", lambda modules=modules: render_files(modules))
        size = sum(len(content) for content in files.values()) / 1e6
        print(f"           {len(files)} files, {size:.1f} MB")


if __name__ == "__main__":
    main()
