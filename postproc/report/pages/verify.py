"""The page of a verification: the program as its text says it, motion by motion."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.arrays import forward_filled
from postproc.kinematics import wrist_distance
from postproc.report.pages.program import motion_sections, time_span
from postproc.report.parts import (
    Page,
    TagColumn,
    add_scene,
    cam_lines,
    escape,
    packed,
    packed_text,
    table,
    unix_text,
)
from postproc.units import DEG, MM, MM_PER_MIN

if TYPE_CHECKING:
    from postproc.arrays import FloatArray, IndexArray
    from postproc.cell import Cell
    from postproc.collision import Scene
    from postproc.kinematics import Kinematics
    from postproc.model import ToolPath
    from postproc.paths import Paths
    from postproc.verification import Run, VerifyReport

_MOST_ROWS = 300


def verify_page(report: VerifyReport, cell: Cell, toolpath: ToolPath | None = None) -> bytes:
    """Return the page of a verification as one self-contained HTML file.

    Args:
        report: with its run.
        cell: the cell that the program was run in.
        toolpath: the CAM file that it was compared with.

    Raises:
        ValueError: if the report has no run.
    """
    from postproc.collision import Scene
    from postproc.kinematics import build

    if report.run is None:
        raise ValueError("a report without its run cannot be shown")
    kinematics = build(cell.robot)
    scene = Scene.build(cell, kinematics)
    motions = _motions(report)
    columns = _columns(report.run, cell, kinematics)
    page = Page(f"{report.program}: {cell.name}", _lead(report))
    add_scene(page, cell, kinematics, scene)
    page.script = "program.js"
    page.data |= {
        "what": "motion",
        **_moves(report.run),
        **_rows(report.run, columns),
        **_texts(report.run, toolpath),
        "failing": {str(row): "; ".join(text) for row, text in motions.items()},
        "poses": _poses(report, scene, motions),
        "objective": "",
        "spin_map": None,
    }
    motion_sections(page, columns, "Motions")
    page.section("Worst of each measure", _worst(report), "half")
    page.section("Findings", _findings(report), "half")
    return page.render()


def _lead(report: VerifyReport) -> list[str]:
    if report.ok:
        lines = [f"The program is good: {report.points} motions, nothing against them."]
    else:
        first = report.violations[0]
        count = len(report.violations)
        word = "one violation" if count == 1 else f"{count} violations"
        lines = [f"The program is bad: {word}.", f"First: {first}"]
    if report.position_error is not None:
        lines.append(
            f"{report.matched} of {report.tags} CAM points are passed in order, the worst "
            f"{report.position_error / MM:.4f} mm and {(report.axis_error or 0.0) / DEG:.4f} deg "
            "off."
        )
    if report.expectation is not None:
        both = report.expectation
        lines.append(
            f"There the real, loaded tool is expected: rms {both.expected_rms / MM:.4f} mm. The "
            f"commanded points are up to {both.nominal_max / MM:.4f} mm off, to make up for it."
        )
    searched = "" if report.collisions_checked else " Collisions were not searched."
    lines.append(f"About {time_span(report.cycle_time)}.{searched}")
    return lines


def _motions(report: VerifyReport) -> dict[int, list[str]]:
    """Return the violations by the first motion of the line they name."""
    trace = report.run.paths.trace if report.run else None
    first: dict[tuple[str, int], int] = {}
    for row in range(len(trace) if trace is not None else 0):
        first.setdefault(trace.place(row), row)  # type: ignore[union-attr]
    found: dict[int, list[str]] = defaultdict(list)
    for violation in report.violations:
        at = first.get(violation.place)
        if at is not None:
            found[at].append(f"{violation.code}: {violation.message}")
    return dict(found)


def _moves(run: Run) -> dict[str, Any]:
    paths = run.paths
    m = len(paths)
    is_cp = paths.trace.is_cp
    owner, _, _, point = paths.in_order()
    known = np.isfinite(point).all(axis=1)
    return {
        "q": packed(forward_filled(paths.q)),
        "time": packed(np.cumsum(run.durations)),
        "positions": packed(forward_filled(paths.end_point)),
        "tag": packed(np.arange(m), "int32"),
        "rapid": packed(~is_cp, "uint8"),
        "trail": packed(point[known]),
        "owner": packed(owner[known], "int32"),
        "circles": packed(np.zeros(0), "int32"),
        "aux": packed(np.zeros((0, 3))),
        "stations": [],
        "station": packed(np.zeros(0), "uint16"),
    }


def _columns(run: Run, cell: Cell, kinematics: Kinematics) -> list[TagColumn]:
    paths, robot = run.paths, cell.robot
    q = np.concatenate([paths.q, paths.q_sample])
    row = np.concatenate([np.arange(len(paths)), paths.row])
    known = np.isfinite(q).all(axis=1)
    q, row = q[known], row[known]
    margin = np.minimum(q - robot.q_min, robot.q_max - q).min(axis=1, initial=np.inf)
    wrist = np.asarray(wrist_distance(kinematics, q))
    m = len(paths)
    speed = np.where(paths.trace.is_cp, paths.trace.column("speed"), np.nan)
    columns = [
        TagColumn("feed", "speed", "mm/min", speed / MM_PER_MIN),
        TagColumn("margin", "margin", "deg", _least(margin, row, m) / DEG, "low"),
        TagColumn("wrist", "wrist |A5|", "deg", _least(wrist, row, m) / DEG, "low"),
        TagColumn("deviation", "deviation", "mm", _deviation(run) / MM, "high"),
    ]
    return [column for column in columns if np.isfinite(column.values).any()]


def _least(values: FloatArray, row: IndexArray, m: int) -> FloatArray:
    result = np.full(m, np.inf)
    np.minimum.at(result, row, values)
    return np.where(np.isfinite(result), result, np.nan)


def _deviation(run: Run) -> FloatArray:
    result = np.full(len(run.paths), np.nan)
    if run.served is not None and run.position_error is not None:
        known = run.served >= 0
        result[run.served[known]] = run.position_error[known]
    return result


def _rows(run: Run, columns: list[TagColumn]) -> dict[str, Any]:
    paths = run.paths
    points = forward_filled(paths.end_point)
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3),) * 2
    return {
        "names": [str(i + 1) for i in range(len(paths))],
        "lines": packed(paths.trace.line, "int32"),
        "columns": [column.to_page() for column in columns],
        "tag_positions": packed(points),
        "tag_axes": packed(-forward_filled(paths.end_axis)),
        "move_of_tag": packed(np.arange(len(paths)), "int32"),
        "centre": [float(v) for v in (low + high) / 2],
        "extent": float(np.linalg.norm(high - low)),
    }


def _texts(run: Run, toolpath: ToolPath | None) -> dict[str, Any]:
    trace = run.paths.trace
    cam_line = np.zeros(len(trace), dtype=np.int64)
    if toolpath is not None and run.served is not None:
        known = run.served >= 0
        cam_line[run.served[known]] = toolpath.line[known]
    return {
        "cam_lines": packed(cam_line, "int32"),
        "cam": packed_text(cam_lines(toolpath) if toolpath is not None else ""),
        "krl_files": [Path(name).name for name in trace.files],
        "krl": [packed_text(_file_text(name)) for name in trace.files],
        "krl_file": packed(trace.file, "int32"),
        "krl_line": packed(trace.line, "int32"),
    }


def _file_text(name: str) -> str:
    path = Path(name)
    return unix_text(path.read_bytes()) if path.is_file() else ""


def _poses(report: VerifyReport, scene: Scene, motions: dict[int, list[str]]) -> dict[str, Any]:
    """Return the first colliding configuration of motions that collide."""
    if report.run is None:
        return {}
    paths = report.run.paths
    found: dict[str, Any] = {}
    for row, texts in list(motions.items())[:_MOST_ROWS]:
        named = [text for text in texts if text.startswith("collision: ")]
        if named:
            pose = _colliding(paths, row, scene, named[0])
            if pose is not None:
                found[str(row)] = pose
    return found


def _colliding(paths: Paths, row: int, scene: Scene, text: str) -> dict[str, Any] | None:
    start = paths.q[row - 1] if row else paths.q[row]
    own = paths.q_sample[paths.row == row]
    if not len(own):
        share = np.linspace(0.0, 1.0, 60)[:, None]
        own = start + share * (paths.q[row] - start)
    own = own[np.isfinite(own).all(axis=1)]
    if not len(own):
        return None
    hits = scene.check(own, np.full(len(own), bool(paths.trace.is_cp[row])))
    rows = np.flatnonzero(hits.hit)
    named = [i for i in rows if " hits ".join(hits.pairs[int(hits.pair[i])]) in text]
    if not len(rows):
        return None
    at = int(named[0] if named else rows[0])
    names = hits.pairs[int(hits.pair[at])]
    note = f"{names[0]} hits {names[1]}"
    return {"q": [float(v) for v in own[at]], "pair": list(names), "note": note}


def _worst(report: VerifyReport) -> str:
    rows = [
        (
            name.replace("_", " "),
            f"{worst.value:.4f}",
            worst.unit,
            f"{Path(worst.file).name}:{worst.line}",
            worst.detail,
        )
        for name, worst in sorted(report.worst.items())
    ]
    return table(("measure", "value", "unit", "where", ""), rows)


def _findings(report: VerifyReport) -> str:
    if not report.violations and not report.warnings:
        return '<p class="good">none</p>'
    trace = report.run.paths.trace if report.run else None
    first = {trace.place(row): row for row in reversed(range(len(trace)))} if trace else {}
    rows = []
    for mark, items in (("failing", report.violations), ("", report.warnings)):
        for item in items[:_MOST_ROWS]:
            row = first.get(item.place)
            file, line = item.place
            goto = "" if row is None else f' data-goto="{row}"'
            text = f"{Path(file).name}:{line}: {item.code}: {item.message}"
            rows.append(f'<tr class="{mark}"{goto}><td class="text wrap">{escape(text)}</td></tr>')
    return f'<div class="scroll"><table id="findings">{"".join(rows)}</table></div>'
