"""Run the experiments of Jiao et al. 2022 on a synthetic KR 500 and print them beside the paper's.

    python -m tools.reproduce                       all tables
    python -m tools.reproduce --tables smoothing    losses of interpolated rotations
    python -m tools.reproduce --tables errors --truths 10 [--periods long|slow|medium]

The twin is ``tools.dev.hidden_twin.Twin``: the product sees readings only. The box is the paper's
1200 x 600 x 600 mm; tool, place of the box and centre of gravity are not in the paper and are
chosen so that the uncompensated error fits (tool point 362 mm below and 107 mm ahead of the flange,
box centre (1800, 0, 800) mm).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from postproc.cell.cell import Cell
from postproc.cell.file import load_cell
from postproc.compensation.real_arm import loads
from postproc.compensation.solve import solve
from postproc.gap import RobotModel, stiffness_tables
from postproc.geometry.frames import inverse, rotation_y, transform
from postproc.kinematics import Kinematics, build
from postproc.measurement.rows import MeasurementSet
from postproc.model.modelfile import ModelFile
from postproc.stiffness.field import ConstantField, Grid, StiffnessField
from postproc.stiffness.identify.cases import load_cases
from postproc.stiffness.identify.constant import ConstantFit, fit_constant
from postproc.stiffness.identify.continuous import fit_continuous
from postproc.stiffness.identify.gridded import fit_grid
from postproc.stiffness.sample.sampling import SamplingRules, box_grid, plan_sampling
from postproc.units import UM
from tests.cells import STIFFNESS, twin_text
from tools.dev.hidden_twin import Twin

LOW, HIGH = np.array([1.5, -0.6, 0.5]), np.array([2.1, 0.6, 1.1])
EDGES = {1: 1.2, 2: 0.6, 16: 0.3, 128: 0.15}
PAPER = {
    "uncompensated": (0.2868, 0.3587),
    "1 cell": (0.1201, 0.1610),
    "128 cells": (0.0570, 0.1134),
}
TRACKER = 12 * UM
REPEATABILITY = 22 * UM
LONG_WAY = {"long": (110.0, 220.0), "slow": (80.0, 180.0), "medium": (40.0, 90.0)}
TABLES = ("errors", "force", "visibility", "timing", "plan", "smoothing")
TRUTHS, RUNS = 3, 50
"""Enough to compare with the paper; more narrow the ranges."""
CELL = twin_text(STIFFNESS, "[optimize]\nrange_deg = [-90, 90]\n", origin=(0, 0, 0))


class Experiment:
    """One truth: the hidden robot, the product's view of it, and the noise of the readings."""

    def __init__(self, twin: Twin, folder: Path, repeatability: bool) -> None:
        self.twin = twin
        self.cell = twin_cell(folder)
        self.kinematics = build(self.cell.robot)
        self.tcp = np.asarray(self.cell.tool.T_flange_tcp[:3, 3])
        self.sigma = np.hypot(TRACKER, REPEATABILITY if repeatability else 0.0)
        self.rng = np.random.default_rng(1000 + twin.seed)

    def noisy(self, points: np.ndarray) -> np.ndarray:
        """Return points as they are read."""
        return points + self.rng.normal(size=points.shape) * self.sigma

    def readings(self, q: np.ndarray) -> MeasurementSet:
        """Return what is read at postures (n, 6), without and with the weight."""
        both = np.vstack([q, q])
        position = np.vstack([self.noisy(self.twin.point(q)), self.noisy(self.twin.weight(q))])
        none = np.zeros(len(q), dtype=bool)
        wrench = np.vstack([np.zeros((len(q), 6)), loads(q, self.cell, self.kinematics, none)])
        n = len(both)
        return MeasurementSet(
            "twin", np.arange(n), tuple(str(i) for i in range(n)), both, position, wrench=wrench
        )

    def postures(self, grid: Grid) -> np.ndarray:
        """Return the 27 postures of each cell (cells, 27, 6): nine tags, -10, 0, +10 degrees."""
        steps = [*((a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1)), (0.5, 0.5, 0.5)]
        points = grid.lowest[:, None] + np.array(steps) * grid.size
        where = np.repeat(points.reshape(-1, 3), 3, axis=0)
        angle = np.tile(np.radians([-10.0, 0.0, 10.0]), len(where) // 3)
        return joints(self.kinematics, self.cell, where, angle).reshape(len(grid), 27, 6)

    def fields(self, configurations: int) -> tuple[dict[str, StiffnessField], ConstantFit]:
        """Return the identified fields: 1, 2, 16, 128 cells (paper's rule) and continuous."""
        found: dict[str, StiffnessField] = {}
        constant: ConstantFit | None = None
        for cells, edge in EDGES.items():
            grid = box_grid(LOW, HIGH, edge)
            measured = self.readings(self.postures(grid).reshape(-1, 6))
            cases = load_cases(measured, self.kinematics, self.tcp)
            constant = fit_constant(cases, robust=False)
            name = "1 cell" if cells == 1 else f"{cells} cells"
            if cells == 1:
                found[name] = ConstantField(constant.c_joint)
                first = constant
                continue
            found[name] = fit_grid(cases, grid, constant, blend=False).field
            if cells == 128:
                found["128 cells, blended"] = fit_grid(cases, grid, constant, blend=True).field
        q = self.spread(configurations)
        cases = load_cases(self.readings(q), self.kinematics, self.tcp)
        constant = fit_constant(cases)
        found[f"continuous, {configurations}"] = fit_continuous(cases, constant).field
        return found, first

    def spread(self, count: int) -> np.ndarray:
        """Return postures spread over box and angle (Halton points)."""
        u = halton(count, 4)
        return joints(
            self.kinematics,
            self.cell,
            LOW + u[:, :3] * (HIGH - LOW),
            np.radians(-10 + 20 * u[:, 3]),
        )

    def fresh(self) -> np.ndarray:
        """Return one random posture in each 150 mm cell, as the paper's verification."""
        low = box_grid(LOW, HIGH, 0.15).lowest
        where = low + np.random.default_rng(77 + self.twin.seed).uniform(size=low.shape) * 0.15
        return joints(self.kinematics, self.cell, where, np.zeros(len(where)))

    def compensated(self, field: StiffnessField, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return true and measured error (n, 3) after commanding what the model asks for."""
        mean = field.compliance(q.mean(axis=0), self.twin.point(q).mean(axis=0))
        model = RobotModel.of(
            self.kinematics, self.cell, ModelFile(stiffness_tables(field, np.asarray(mean)))
        )
        wrench = loads(q, self.cell, self.kinematics, np.zeros(len(q), dtype=bool))
        command = solve(model, self.kinematics, self.cell.tool.T_flange_tcp, q, wrench).q
        target = self.twin.point(q)
        real = self.twin.weight(command)
        return real - target, self.noisy(real) - self.noisy(target)


def twin_cell(folder: Path) -> Cell:
    """Return the product's cell of the twin."""
    path = folder / "twin_p.toml"
    path.write_text(CELL, encoding="utf-8")
    return load_cell(path)


def joints(kinematics: Kinematics, cell: Cell, where: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return joints (n, 6) with the tool's axes along those of the box, turned about its y axis."""
    T = transform(rotation_y(angle), where)
    q, valid = kinematics.ik(T @ inverse(cell.tool.T_flange_tcp))
    start = np.radians([0.0, -60.0, 90.0, 0.0, 60.0, 180.0])
    slot = int(kinematics.slot(start))
    if not np.all(valid[:, slot]):
        raise SystemExit("a posture of the experiment cannot be reached")
    return kinematics.nearest(q[:, slot], start)


def halton(count: int, dimensions: int) -> np.ndarray:
    """Return evenly spread points (count, dimensions) in the unit cube."""
    columns = []
    for base in (2, 3, 5, 7)[:dimensions]:
        values = np.zeros(count)
        for i in range(count):
            k, part = i + 20, 1.0
            while k:
                part /= base
                values[i] += part * (k % base)
                k //= base
        columns.append(values)
    return np.stack(columns, axis=1)


@cache
def calibrated(seed: int, periods: tuple[float, float], folder: Path) -> Twin:
    """Return a truth whose no-grid fit leaves the paper's 0.1201 mm, noise included."""
    low, high = 0.0, 4.0
    for _ in range(14):
        twin = Twin(seed, 0.5 * (low + high), tuple(np.radians(periods)))
        run = Experiment(twin, folder, repeatability=False)
        q = run.postures(box_grid(LOW, HIGH, 1.2)).reshape(-1, 6)
        cases = load_cases(run.readings(q), run.kinematics, run.tcp)
        field = ConstantField(fit_constant(cases, robust=False).c_joint)
        left = length(run.compensated(field, run.fresh())[1]).mean()
        low, high = (twin.amplitude, high) if left < 0.1201e-3 else (low, twin.amplitude)
    return twin


def length(errors: np.ndarray) -> np.ndarray:
    """Return (n,) lengths."""
    return np.linalg.norm(errors, axis=-1)


def largest_step(run: Experiment, field: StiffnessField) -> float:
    """Return the largest change [m] of the predicted deflection along a 1 mm move."""
    worst = 0.0
    for corner in (LOW, np.array([LOW[0], HIGH[1], LOW[2]]), np.array([HIGH[0], LOW[1], LOW[2]])):
        end = LOW + HIGH - corner
        count = int(np.linalg.norm(end - corner) / 1e-3)
        where = corner + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - corner)
        q = joints(run.kinematics, run.cell, where, np.zeros(len(where)))
        wrench = loads(q, run.cell, run.kinematics, np.zeros(len(q), dtype=bool))
        J = run.kinematics.jacobian(q, run.tcp)
        torque = np.einsum("nij,ni->nj", J, wrench)
        moved = np.einsum("nij,nj->ni", J[:, :3], field.compliance(q, where) * torque)
        worst = max(worst, float(length(np.diff(moved, axis=0)).max()))
    return worst


def errors_table(arguments: argparse.Namespace, folder: Path) -> None:
    """Print errors before and after compensation, as Figures 16 and 17 of the paper."""
    constant = Experiment(Twin(0, 0.0), folder, repeatability=False)
    before = [
        length(run.twin.weight(run.fresh()) - run.twin.point(run.fresh()))
        for run in (Experiment(Twin(s, 0.0), folder, repeatability=False) for s in range(10))
    ]
    mean = np.mean([b.mean() for b in before]) * 1e3
    worst = np.mean([b.max() for b in before]) * 1e3
    print("Uncompensated, constant stiffness of the paper, 50 kg, 128 random points [mm]")
    print(
        f"  paper 0.2868 / 0.3587   twin {mean:.4f} / {worst:.4f} "
        f"({100 * (mean / 0.2868 - 1):+.1f} % / {100 * (worst / 0.3587 - 1):+.1f} %; 10 draws)"
    )
    rows: dict[str, list[tuple[float, ...]]] = {}
    count = arguments.configurations
    for seed in range(arguments.truths):
        twin = calibrated(seed, LONG_WAY[arguments.periods], folder)
        run = Experiment(twin, folder, arguments.repeatability)
        fields, _ = run.fields(count)
        q = run.fresh()
        for name, field in fields.items():
            true, measured = (length(e) * 1e3 for e in run.compensated(field, q))
            step = largest_step(run, field) / UM
            rows.setdefault(name, []).append(
                (measured.mean(), measured.max(), true.mean(), true.max(), step)
            )
        print(f"  truth {seed}: amplitude {twin.amplitude:.2f}", file=sys.stderr)
    noise = constant.rng.normal(size=(200_000, 3)) * run.sigma * np.sqrt(2.0) * 1e3
    print(
        f"\nAfter compensation [mm], mean over {arguments.truths} truths (lowest .. highest); "
        f"joint periods {arguments.periods}; reading noise {run.sigma / UM:.1f} um per axis"
    )
    print(f"  floor: noise alone reads {length(noise).mean():.4f} mean")
    print(
        f"  {'model':>22} {'paper mean/max':>16} {'measured mean':>24} {'measured max':>24} "
        f"{'true mean':>10} {'true max':>9} {'step/mm':>9}"
    )
    for name, values in rows.items():
        table = np.array(values)
        paper = PAPER.get(name)
        shown = f"{paper[0]:.4f}/{paper[1]:.4f}" if paper else "-"
        print(
            f"  {name:>22} {shown:>16} {_span(table[:, 0]):>24} {_span(table[:, 1]):>24} "
            f"{table[:, 2].mean():10.4f} {table[:, 3].mean():9.4f} {table[:, 4].max():6.1f} um"
        )
    one, fine = (np.mean([v[0] for v in rows[n]]) for n in ("1 cell", "128 cells"))
    print(f"  gain of 128 cells over 1: paper 52.54 %, twin {100 * (1 - fine / one):.1f} %")
    best = rows[f"continuous, {count}"]
    wins = sum(b[2] < g[2] and b[3] < g[3] for b, g in zip(best, rows["128 cells"], strict=True))
    print(
        f"  {count} configurations, continuous, beat 3456 in 128 cells (true mean and max) in "
        f"{wins} of {arguments.truths} truths"
    )
    ratio = [v[0] / length(noise).mean() for v in best]
    print(f"  residual on fresh points over the noise floor, continuous: {_span(np.array(ratio))}")


def _span(values: np.ndarray) -> str:
    return f"{values.mean():.4f} ({values.min():.4f} .. {values.max():.4f})"


def force_table(arguments: argparse.Namespace, folder: Path) -> None:
    """Print how well process forces are predicted in directions that were never measured."""
    print("\nPrediction of 500 N process forces: error relative to |d| (median over points)")
    count = arguments.configurations
    for label, directions in (
        ("dead weight only", []),
        ("weight, x and y force", [[490.0, 0, 0], [0, 490.0, 0]]),
    ):
        found: dict[str, list[float]] = {"x": [], "y": [], "z": []}
        for seed in range(arguments.truths):
            twin = calibrated(seed, LONG_WAY[arguments.periods], folder)
            run = Experiment(twin, folder, arguments.repeatability)
            q = run.spread(count)
            measured = run.readings(q)
            for force in directions:
                measured = joined(measured, forced(run, q, np.array(force)))
            cases = load_cases(measured, run.kinematics, run.tcp)
            constant = fit_constant(cases, run.cell.joint_stiffness)
            field = fit_continuous(cases, constant).field.with_fallback(run.cell.joint_stiffness)
            fresh = run.fresh()
            J = run.kinematics.jacobian(fresh, run.tcp)
            for axis, name in enumerate("xyz"):
                force = 500.0 * np.eye(3)[axis]
                torque = np.einsum("nij,i->nj", J[:, :3], force)
                model = np.einsum("nij,nj->ni", J[:, :3], field.compliance(fresh) * torque)
                true = run.twin.loaded_point(fresh, force, run.tcp) - run.twin.point(fresh)
                found[name].append(float(np.median(length(model - true) / length(true))))
        shown = ", ".join(f"{n} {100 * np.mean(v):.0f} %" for n, v in found.items())
        print(f"  identified by {label:>22}: {shown}")


def forced(run: Experiment, q: np.ndarray, force: np.ndarray) -> MeasurementSet:
    """Return readings under a force at the tool point."""
    n = len(q)
    return MeasurementSet(
        "twin",
        np.arange(n),
        tuple(f"f{i}" for i in range(n)),
        q,
        run.noisy(run.twin.loaded_point(q, force, run.tcp)),
        wrench=np.tile(np.concatenate([force, np.zeros(3)]), (n, 1)),
    )


def joined(a: MeasurementSet, b: MeasurementSet) -> MeasurementSet:
    """Return both sets of readings."""
    return replace(
        a,
        line=np.arange(len(a) + len(b)),
        ids=a.ids + b.ids,
        q=np.vstack([a.q, b.q]),
        position=np.vstack([a.position, b.position]),
        wrench=np.vstack([a.wrench, b.wrench]),
    )


def visibility_table(arguments: argparse.Namespace, folder: Path) -> None:
    """Print what the loads show, and how often 90 % intervals cover a constant truth."""
    print(
        "\nWhat the loads show (constant truth, 3456 postures), and coverage of 90 % intervals "
        f"over {arguments.runs} runs"
    )
    run = Experiment(Twin(0, 0.0), folder, arguments.repeatability)
    everything = run.postures(box_grid(LOW, HIGH, 0.15)).reshape(-1, 6)
    three = [[490.0, 0, 0], [0, 490.0, 0]]
    for label, directions in (("dead weight", []), ("three directions", three)):
        measured = run.readings(everything)
        for force in directions:
            measured = joined(measured, forced(run, everything, np.array(force)))
        fit = fit_constant(load_cases(measured, run.kinematics, run.tcp), run.cell.joint_stiffness)
        grades = ", ".join(f"A{i + 1} {v}" for i, v in enumerate(fit.observability.visibility))
        print(f"  {label}: {grades}; condition {fit.observability.condition:.0f}")
    covered, seen = np.zeros(6), np.zeros(6)
    truth = 1.0 / np.asarray(run.cell.joint_stiffness)
    for k in range(arguments.runs):
        pick = np.random.default_rng(k).choice(len(everything), 400, replace=False)
        measured = run.readings(everything[pick])
        for force in three:
            measured = joined(measured, forced(run, everything[pick], np.array(force)))
        fit = fit_constant(load_cases(measured, run.kinematics, run.tcp), run.cell.joint_stiffness)
        covered += (fit.low <= truth) & (truth <= fit.high)
        seen += fit.observability.seen
    print(
        f"  three directions, 400 postures: seen {np.round(100 * seen / arguments.runs)} %, "
        f"covered {np.round(100 * covered / arguments.runs, 1)} %"
    )


def timing_table(folder: Path) -> None:
    """Print how long 3456 configurations take."""
    run = Experiment(calibrated(0, LONG_WAY["slow"], folder), folder, repeatability=False)
    grid = box_grid(LOW, HIGH, 0.15)
    measured = run.readings(run.postures(grid).reshape(-1, 6))
    start = time.process_time()
    cases = load_cases(measured, run.kinematics, run.tcp)
    constant = fit_constant(cases)
    fit_grid(cases, grid, constant)
    middle = time.process_time()
    fit_continuous(cases, constant)
    print(
        f"\n3456 configurations: per cell {middle - start:.2f} s (limit 2), "
        f"continuous {time.process_time() - middle:.2f} s (limit 20), processor time"
    )


def plan_table(folder: Path) -> None:
    """Print how many postures the measuring plan has with shared corners."""
    print("\nMeasuring plan")
    cell = twin_cell(folder)
    rules = SamplingRules(np.array([0.0, 1.0, 0.0]), np.radians([-10.0, 0.0, 10.0]), np.eye(3))
    for edge in (0.6, 0.3, 0.15):
        grid = box_grid(LOW, HIGH, edge)
        plan = plan_sampling(grid, build(cell.robot), cell.tool.T_flange_tcp, rules)
        print(
            f"  grid {edge * 1e3:.0f} mm: {27 * len(grid)} configurations in the paper, "
            f"{len(plan)} with shared corners once"
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print all tables."""
    import tempfile

    from tools.reproduce.smoothing import smoothing_table

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--truths", type=int, default=TRUTHS, help="of errors and force")
    parser.add_argument("--runs", type=int, default=RUNS, help="of the coverage of intervals")
    parser.add_argument("--configurations", type=int, default=64)
    parser.add_argument("--periods", choices=list(LONG_WAY), default="long")
    parser.add_argument("--repeatability", action="store_true", help="add 22 um per arrival")
    parser.add_argument(
        "--tables", nargs="+", choices=TABLES, default=TABLES, help="which of them to print"
    )
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "errors" in chosen.tables:
            errors_table(chosen, folder)
        if "force" in chosen.tables:
            force_table(chosen, folder)
        if "visibility" in chosen.tables:
            visibility_table(chosen, folder)
        if "timing" in chosen.tables:
            timing_table(folder)
        if "plan" in chosen.tables:
            plan_table(folder)
        if "smoothing" in chosen.tables:
            smoothing_table(folder)


if __name__ == "__main__":
    main()
