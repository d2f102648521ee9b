"""The simulated path of a program as a table: where every axis is at every step, and when."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.controller import EventWord
from postproc.errors import UsageError
from postproc.geometry import abc_from_rotation, inverse
from postproc.kinematics import build, wrist_distance
from postproc.model import ToolPath
from postproc.paths import STEP_ANGLE, Paths
from postproc.records import dataclass
from postproc.units import DEG, MM
from postproc.verification import Played, VerifyReport

_DIGITS = 6
"""Decimals of a number: nanometres, and less than an arc second."""
_SUFFIXES = (".csv", ".json")


@dataclass(frozen=True, slots=True)
class _Steps:
    """Steps (n,) in order of time: motion, share of it, joints (n, 6), external axes (n, k)."""

    row: AnyIntArray
    share: FloatArray
    q: FloatArray
    external: FloatArray


def check_path_name(name: str | None) -> None:
    """Refuse a file whose name says no form that a path is written in: CLI015."""
    if name is not None and Path(name).suffix.lower() not in _SUFFIXES:
        text = f"--path {name}: expected a name that ends in .csv or .json"
        raise UsageError("CLI015", text)


def path_file(
    name: str, report: VerifyReport, cell: Cell, toolpath: ToolPath | None = None
) -> bytes:
    """Return the simulated path of a verified program: CSV, or JSON with the same rows.

    A cell is empty, or null, where a number is not known: out of reach, or clearance without
    solids. The toolpath that the program was compared with names the tags.
    """
    columns = _columns(report, cell, toolpath)
    if Path(name).suffix.lower() == ".json":
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        document = {"schema": "postproc.path/1", "program": report.program, "rows": rows}
        return (json.dumps(document, allow_nan=False, ensure_ascii=False) + "\n").encode("utf-8")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue().encode("utf-8")


def _columns(
    report: VerifyReport, cell: Cell, toolpath: ToolPath | None
) -> dict[str, Sequence[Any]]:
    run = report.run
    if run is None:
        raise ValueError("a report without its run has no path")
    paths, kinematics = run.paths, build(cell.robot)
    steps = _steps(paths)
    moving, waiting = _times(run, steps)
    R, point = _tool_in_base(paths, cell, steps)
    abc = abc_from_rotation(R) / DEG
    robot = cell.robot
    limit = np.minimum(steps.q - robot.q_min, robot.q_max - steps.q).min(axis=1, initial=np.inf)
    margin = np.minimum(limit, wrist_distance(kinematics, steps.q))
    step, took = np.linalg.norm(np.diff(point, axis=0), axis=1), np.diff(moving)
    speed = np.divide(step, took, out=np.zeros_like(step), where=took > 0.0)
    place = [paths.trace.place(motion) for motion in range(len(paths))]
    tags = _tags(run, toolpath)
    externals = {
        f"{axis.name.lower()}_{'mm' if axis.kind == 'rail' else 'deg'}": steps.external[:, k]
        / (MM if axis.kind == "rail" else DEG)
        for k, axis in enumerate(cell.external_axes)
    }
    end = steps.share == 1.0
    numbers = {
        **{f"q{k + 1}_deg": steps.q[:, k] / DEG for k in range(6)},
        **externals,
        **{f"{name}_mm": point[:, k] / MM for k, name in enumerate("xyz")},
        **{f"{name}_deg": abc[:, k] for k, name in enumerate("abc")},
        "speed_mm_s": np.append(0.0, speed)[: len(moving)] / MM,
        "margin_deg": margin / DEG,
        "clearance_mm": _clearance(report, cell, steps) / MM,
    }
    return {
        "time_s": _written(moving + waiting),
        "file": [Path(place[row][0]).name for row in steps.row],
        "line": [place[row][1] for row in steps.row],
        "tag": [
            tags.get(row, "") if at_end else ""
            for row, at_end in zip(steps.row.tolist(), end, strict=True)
        ],
        **{name: _written(values) for name, values in numbers.items()},
    }


def _written(values: FloatArray) -> list[float | None]:
    return [round(v, _DIGITS) + 0.0 if np.isfinite(v) else None for v in values.tolist()]


def _steps(paths: Paths) -> _Steps:
    """Return the samples of path motions, and of joint motions as fine as these turn."""
    row, share, q, *_ = paths.in_order()
    before = np.vstack([np.full((1, 6), np.nan), q[:-1]])
    joint = ~paths.trace.is_cp[row]
    way = np.nan_to_num(np.abs(q - before).max(axis=1)) * joint
    pieces = np.maximum(np.ceil(way / STEP_ANGLE - 1e-9), 1).astype(np.int64)
    which = np.repeat(np.arange(len(row)), pieces)
    last = np.cumsum(pieces)
    number = np.arange(len(which)) - (last - pieces)[which] + 1
    part = number / pieces[which]
    several = (pieces > 1)[which]
    q = np.where(several[:, None], before[which] + part[:, None] * (q - before)[which], q[which])
    row, share = row[which], np.where(several, part, share[which])
    return _Steps(row, share, q, paths.curves.external_at(row, share, paths.external))


def _times(run: Played, steps: _Steps) -> tuple[FloatArray, FloatArray]:
    """Return the time (n,) [s] in motion until every step, and that of the waits before."""
    wait = np.zeros(len(run.durations) + 1)
    for event in run.paths.trace.events:
        if event.word is EventWord.DWELL and np.isfinite(event.value):
            wait[event.motion] += event.value
    start = np.cumsum(run.durations) - run.durations
    moving = start[steps.row] + steps.share * run.durations[steps.row]
    return np.asarray(moving), np.cumsum(wait)[steps.row]


def _tool_in_base(paths: Paths, cell: Cell, steps: _Steps) -> tuple[FloatArray, FloatArray]:
    """Return orientation (n, 3, 3) and place (n, 3) [m] of the TCP in the base of each motion."""
    station = paths.station
    known = np.asarray(np.isfinite(steps.q).all(axis=1))[:, None, None]
    T = build(cell.robot).fk(np.nan_to_num(steps.q)) @ cell.tcp_of(station.tool[steps.row])
    T_base = station.parts(steps.external, steps.row)
    T = np.where(known, inverse(np.broadcast_to(T_base, T.shape)) @ T, np.nan)
    return T[:, :3, :3], T[:, :3, 3]


def _tags(run: Played, toolpath: ToolPath | None) -> dict[int, str]:
    """Return the names of the tags that motions end at."""
    found: dict[int, list[str]] = {}
    if toolpath is not None and run.served is not None:
        for tag, motion in enumerate(np.asarray(run.served).tolist()):
            if motion >= 0:
                found.setdefault(motion, []).append(toolpath.tag_name(tag))
    return {motion: " ".join(names) for motion, names in found.items()}


def _clearance(report: VerifyReport, cell: Cell, steps: _Steps) -> FloatArray:
    """Return the smallest distance (n,) [m] of solids; what cuts may touch the workpiece."""
    result = np.full(len(steps.row), np.nan)
    if not report.collisions_checked or report.run is None:
        return result
    known = np.asarray(np.isfinite(steps.q).all(axis=1))
    for rows, here in setups_of(report.run.paths, cell, steps.row):
        rows = rows[known[rows]]
        poses = np.hstack([steps.q, steps.external])[rows]
        found = Scene.shared(here, build(cell.robot)).clearance(poses, True)
        result[rows] = found
    result[np.isinf(result)] = np.nan
    return result


def setups_of(paths: Paths, cell: Cell, row: AnyIntArray) -> Iterator[tuple[AnyIntArray, Cell]]:
    """Yield the steps of every tool in every base, and the cell with these in work."""
    own = np.stack([paths.station.tool, paths.station.base], axis=1)[row]
    for tool, base in np.unique(own, axis=0).tolist():
        here = (own[:, 0] == tool) & (own[:, 1] == base)
        yield np.flatnonzero(here), cell.with_tool(tool, base)
