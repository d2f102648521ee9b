"""What to measure next as files: a table to fill in and a program that drives to the poses.

The table reads like any measurement file once it is filled in: ``diagnose`` takes it together with
the first one.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, missing_numbers
from postproc.errors import DataError, SourceRef
from postproc.gap import Diagnosis, NextPose, Reach, last_set_up, next_poses, questions, reassessed
from postproc.jobs import drive
from postproc.jobs.drive import free_ways
from postproc.kinematics import build
from postproc.measurement import (
    DIRECTION,
    EXPECTED,
    JOINTS,
    ORIENTATION,
    POSITION,
    SPEED,
    WRENCH,
    MeasurementSet,
    cells,
    table_to_fill_in,
)
from postproc.records import dataclass
from postproc.stiffness.sample import travel_order
from postproc.units import DEG, MM

NAME = "next_measurements"
FIRST_LINE = 6
"""Line of the first reading in the CSV, behind the remarks and the header."""
_SPEED = 0.3
_MOST_VIA = 80


@dataclass(frozen=True, slots=True)
class NextMeasurements:
    """Poses in the order of driving.

    q: (m, 6) all postures of the way [rad]; reads: (m,) number of the pose read there, else -1.
    """

    poses: tuple[NextPose, ...]
    q: FloatArray
    reads: tuple[int, ...]


def measure_next(diagnosis: Diagnosis, cell: Cell) -> NextMeasurements:
    """Return what to measure next within the limits of a cell and free of collision.

    Poses without any free way to the others are left out; the separations are those of the rest.
    """
    nothing = NextMeasurements((), np.zeros((0, 6)), ())
    calm = diagnosis.verdict in ("explained", "no_gap")
    if calm and not questions(diagnosis):
        return nothing
    if missing_numbers(cell):
        # where the arm may go nobody knows; where it has been it may
        again = [pose for pose in next_poses(diagnosis, Reach()) if pose.revisit]
        again = [replace(pose, id=f"next{k + 1:02d}") for k, pose in enumerate(again)]
        return NextMeasurements(tuple(again), np.zeros((0, 6)), ())
    kinematics = build(cell.robot)
    checks = drive.Checks.of(cell, kinematics)
    limits = cell.limits
    reach = Reach(limits.joint_margin, limits.singularity, checks.is_free, checks.are_free)
    proposed = next_poses(diagnosis, reach)
    if not proposed:
        return nothing
    poses = [proposed[k] for k in _order(proposed, diagnosis)]
    still = [k for k, pose in enumerate(poses) if pose.qd is None]
    via = _via(diagnosis, reach, checks)
    kept, q, reads = _way([poses[k] for k in still], checks, via)
    lost = {still[k] for k in range(len(still)) if k not in kept}
    number = {k: at for at, k in enumerate(k for k in range(len(poses)) if k not in lost)}
    left = [pose for k, pose in enumerate(poses) if k not in lost]
    left = [replace(pose, id=f"next{k + 1:02d}") for k, pose in enumerate(left)]
    if lost:
        left = list(reassessed(diagnosis, left))
    return NextMeasurements(tuple(left), q, tuple(-1 if k < 0 else number[still[k]] for k in reads))


def _order(poses: Sequence[NextPose], diagnosis: Diagnosis) -> list[int]:
    """Return poses by load, the lightest first, on short tours; first those that tell the noise."""
    kinematics = diagnosis.problem.samples.arm.kinematics
    loads = np.array([np.zeros(6) if p.wrench is None else p.wrench for p in poses])
    again = [k for k, pose in enumerate(poses) if pose.revisit]
    rest = np.array([k for k, pose in enumerate(poses) if not pose.revisit], dtype=np.int32)
    if len(rest) == 0:
        return again
    _, group = np.unique(np.round(loads[rest], 3), axis=0, return_inverse=True)
    group = group.ravel()
    weight = [
        float(np.linalg.norm(loads[rest[group == g]][0])) for g in range(int(group.max()) + 1)
    ]
    order = again
    for g in np.argsort(weight, kind="stable"):
        member = rest[group == g]
        q = np.array([poses[int(k)].q for k in member])
        tour = travel_order(q, np.arange(len(q), dtype=np.int32), kinematics)
        order += [int(k) for k in member[tour]]
    return order


def _via(diagnosis: Diagnosis, reach: Reach, checks: drive.Checks) -> FloatArray:
    """Return measured postures that ways may go through."""
    q = diagnosis.problem.samples.q
    q = np.round(q[:: max(1, len(q) // _MOST_VIA)] / DEG, 5) * DEG
    kinematics = diagnosis.problem.samples.arm.kinematics
    q = q[kinematics.within_limits(q, reach.joint_margin)]
    return q[checks.is_free(q)] if len(q) else q


def _way(
    poses: Sequence[NextPose], checks: drive.Checks, via: FloatArray
) -> tuple[set[int], FloatArray, list[int]]:
    """Return the poses that are reached, the postures of the way, and what is read at each."""
    if not poses:
        return set(), np.zeros((0, 6)), []
    stops: list[FloatArray] = []
    read: list[int] = []
    for k, pose in enumerate(poses):
        if np.any(pose.before != pose.q):
            stops.append(pose.before)
            read.append(-1)
        stops.append(pose.q)
        read.append(k)
    kept, nodes, way, _ = free_ways(np.array(stops), checks.are_free, via)
    label = [read[int(k)] for k in kept]
    reads = [label[k - 1] if k > 0 else -1 for k in way]
    return set(label) - {-1}, nodes[np.abs(way) - 1], reads


def files(found: NextMeasurements, diagnosis: Diagnosis, cell: Cell) -> dict[str, bytes]:
    """Return ``next_measurements.csv`` to fill in and the program; nothing if there is nothing."""
    if not found.poses:
        return {}
    problem = diagnosis.problem
    last = last_set_up(diagnosis)
    label = {
        "station": problem.set_ups.stations[problem.set_ups.station[last]],
        "reflector": problem.set_ups.reflectors[problem.set_ups.reflector[last]],
    }
    out = {f"{NAME}.csv": csv_text(found, problem.measurements, label)}
    if any(k >= 0 for k in found.reads):
        out |= drive.program_files(drive_of(found, cell))
    return out


def keep_readings(folder: Path) -> None:
    """Refuse to write over a table that somebody has begun to fill in: GAP005."""
    path = folder / f"{NAME}.csv"
    if not path.is_file():
        return
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    table = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and line[0] != "#"]
    rows = list(csv.reader(line for _, line in table))
    if not rows or "x_mm" not in rows[0]:
        return
    column = rows[0].index("x_mm")
    for (number, _), row in zip(table[1:], rows[1:], strict=True):
        if len(row) > column and row[column].strip():
            text = "holds readings and would be overwritten by the next plan"
            hint = "give another folder with -o, or move the file"
            raise DataError("GAP005", text, SourceRef(str(path), number), hint=hint)


def drive_of(found: NextMeasurements, cell: Cell) -> drive.Drive:
    """Return the program: from the proposed side to each pose, a halt for the reading."""
    reads = np.array([k >= 0 for k in found.reads])
    order = [k for k in found.reads if k >= 0]
    return drive.Drive(
        name=NAME,
        cell=cell,
        q=found.q,
        reads=reads,
        names=tuple(found.poses[k].id for k in order),
        line=np.array([k + FIRST_LINE for k in order], dtype=np.int32),
        notes=_notes(found),
        speed=_SPEED,
        wait=0.0,
        halt=True,
        command="diagnose",
    )


def _notes(found: NextMeasurements) -> tuple[drive.Note, ...]:
    """Return what has to be done before a pose: another load, another temperature."""
    notes = []
    last = (_load_text(None), "")
    move = 0
    for at, k in enumerate(found.reads):
        if k < 0:
            continue
        pose = found.poses[k]
        now = (_load_text(pose.wrench), _warm_text(pose.temperature))
        if now != last:
            todo = [text for text, old in zip(now, last, strict=True) if text and text != old]
            notes.append(drive.Note(move, k + FIRST_LINE, "; ".join(todo), stop=True))
        last, move = now, at + 1
    return tuple(notes)


def _load_text(wrench: FloatArray | None) -> str:
    if wrench is None or not bool(np.any(wrench)):
        return "take the load off"
    text = f"put on load: {' '.join(f'{v:.0f}' for v in wrench[:3])} N"
    if bool(np.any(wrench[3:])):
        text += f", {' '.join(f'{v:.1f}' for v in wrench[3:])} Nm"
    return text


def _warm_text(temperature: float | None) -> str:
    return "" if temperature is None else f"arm at about {temperature:.0f} degC"


def csv_text(found: NextMeasurements, measured: MeasurementSet, label: dict[str, str]) -> bytes:
    """Return the table to fill in, with the columns of the first campaign."""
    notes = (
        "fill in x_mm, y_mm, z_mm (and the other empty columns) as in the first measurement;",
        "delete rows that cannot be taken; then: diagnose FIRST.csv next_measurements.csv",
        "expected_*: where the model expects the point, same frame as x_mm; nothing is measured",
        "q, dir, loads are what to drive; correct them if something else was done",
    )
    return table_to_fill_in(notes, [_cells(pose, measured, label) for pose in found.poses])


def _cells(pose: NextPose, measured: MeasurementSet, label: dict[str, str]) -> dict[str, str]:
    row = {"id": pose.id}
    if measured.group is not None:
        row["group"] = "next"
    row |= {name: text for name, text in label.items() if text}
    row |= cells(JOINTS, pose.q / DEG, 5)
    row |= dict.fromkeys(POSITION, "")
    if measured.abc is not None:
        row |= dict.fromkeys(ORIENTATION, "")
    if pose.direction is not None:
        row |= cells(DIRECTION, pose.direction, 0)
    if pose.wrench is not None:
        row |= cells(WRENCH, pose.wrench, 3)
    if measured.qd is not None:
        row |= cells(SPEED, np.zeros(6) if pose.qd is None else pose.qd / DEG, 4)
    if measured.time is not None:
        row["time_s"] = ""
    if measured.temperature is not None:
        row["temp_C"] = "" if pose.temperature is None else f"{pose.temperature:.1f}"
    row |= cells(EXPECTED, pose.expected / MM, 3)
    return row | {"why": pose.why.replace(",", ";")}
