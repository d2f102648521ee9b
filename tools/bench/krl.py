"""Processor time of writing and of reading KRL.

    python -m tools.bench krl [--points 100000]

Written: a five-axis cut in each style. Read: parse, lint, verify (against the path it was made
from, without collisions) and diff of one program with that many LIN motions.
"""

from __future__ import annotations

import argparse

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import parse_cell
from postproc.comparison import diff_files
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.geometry import rotation_from_abc, transform
from postproc.krl import LintOptions, lint, parse_files
from postproc.model import MoveKind, MoveRole, Plan
from postproc.verification import verify
from tests.cells import cell_text
from tools.bench.harness import told
from tools.bench.paths import bare_path

STYLES = (
    ("dense, 1000 points per file", ""),
    ("dense, points in the data list", 'points = "dat"\n'),
    ("spline blocks", 'motion = "spline_block"\n'),
)
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


def main() -> None:
    """Write and read."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=100_000)
    n = parser.parse_args().points
    writing(n)
    reading(n)


def writing(n: int) -> None:
    """Write one plan in each style."""
    plan, few = cut(n), cut(10)
    for name, style in STYLES:
        cell = parse_cell(cell_text(f"[krl]\n{style}").encode(), "cell.toml")
        emit(few, cell)  # templates and imports
        modules = told(f"emit {n} points, {name}", lambda cell=cell: emit(plan, cell))
        files = told("  print them", lambda modules=modules: render_files(modules))
        size = sum(len(content) for content in files.values()) / 1e6
        print(f"           {len(files)} files, {size:.1f} MB")


def cut(n: int) -> Plan:
    """A 5-axis cut of n points on a spiral, feed and approximation as CAM systems give them."""
    angle = np.linspace(0.0, 200.0, n)
    p = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), angle * 1e-3])
    R = rotation_from_abc(np.column_stack([angle % 3.0, 1.0 + 0.1 * np.sin(angle), angle % 0.5]))
    is_first = np.arange(n) == 0
    nothing = np.full(n, np.nan)
    return Plan(
        name="SPIRAL",
        toolpath=bare_path("SPIRAL", np.zeros((n, 3)), (0.0, 0.0, 1.0), feed=0.02),
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


def reading(n: int) -> None:
    """Read one program in every way."""
    points = spiral(n)
    old = {"SPIRAL.src": program(points)}
    cell = parse_cell(cell_text(origin=(1900, 100, 1100)).encode(), "cell.toml")
    kind = np.where(np.arange(n) == 0, 0, 1)
    toolpath = bare_path("SPIRAL", points * 1e-3, (-1.0, 0.0, 0.0), feed=0.02, kind=kind)
    modules = told(f"parse {n} points", lambda: parse_files(old))
    large = LintOptions(max_points=n + 1, max_bytes=len(old["SPIRAL.src"]) + 1)
    findings = told("lint", lambda: lint(modules, large))
    print(f"           {len(findings)} findings")
    report = told(
        "verify against the path, no collisions",
        lambda: verify(modules, "SPIRAL", cell, toolpath, collisions=False),
    )
    print(f"           {len(report.violations)} violations, {report.matched} of {n} matched")
    points[n // 2, 1] += 0.5
    new = {"SPIRAL.src": program(np.delete(points, n // 3, axis=0))}
    found = told("diff, one point moved, one removed", lambda: diff_files(old, new, "SPIRAL"))
    print(f"           {found.counts()}")
    moved = {"SPIRAL.src": program(points + 0.1)}
    found = told("diff, every point moved", lambda: diff_files(old, moved, "SPIRAL"))
    print(f"           {found.counts()}")


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
