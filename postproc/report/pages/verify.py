"""The page of a verification: the program as its text says it, motion by motion."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, forward_filled
from postproc.cell import Cell
from postproc.errors import headlines
from postproc.model import ToolPath
from postproc.planning import FailingPose
from postproc.records import dataclass
from postproc.report.pages.program import (
    frame_data,
    frame_words,
    motion_sections,
    nearest_words,
    pose_data,
    time_span,
)
from postproc.report.parts import (
    Drawing,
    Page,
    TagColumn,
    axes_in_drawn_base,
    cam_lines,
    extent_of,
    in_drawn_base,
    packed,
    packed_text,
    scene_data,
    table,
    unix_text,
)
from postproc.units import DEG, MM, MM_PER_MIN
from postproc.verification import Played, VerifyReport

MOST_ROWS = 300
"""Findings, and colliding motions, that are shown."""


@dataclass(frozen=True, slots=True)
class RunMaps:
    """Motions of a run in figures.

    ``margin``, ``wrist`` (m,): smallest way [rad] to a joint limit and to A5 = 0, NaN where
    unknown; ``texts``: what stands against motions; ``poses``: colliding ones; ``clearance`` [m]:
    the smallest at the ends of motions, NaN where nothing is near or it was not searched.
    """

    margin: FloatArray
    wrist: FloatArray
    texts: Mapping[int, list[str]]
    poses: Mapping[int, FailingPose]
    clearance: float = np.nan


def verify_page(
    report: VerifyReport, drawing: Drawing, maps: RunMaps, toolpath: ToolPath | None = None
) -> bytes:
    """Return the page of a verification, whose report has its run, as one HTML file."""
    if report.run is None:
        raise ValueError("a report without its run cannot be shown")
    columns = _columns(report.run, maps)
    lead = _lead(report, maps)
    page = Page(f"{report.program}: {drawing.cell.name}", lead, good=report.ok)
    page.script = "program.js"
    page.data |= {
        **scene_data(drawing),
        "what": "motion",
        **_moves(report.run, drawing.cell),
        **_rows(report.run, drawing.cell, columns),
        **_texts(report.run, toolpath),
        "failing": {str(row): "; ".join(text) for row, text in maps.texts.items()},
        "poses": pose_data(maps.poses, drawing.cell),
        "objective": "",
        "spin_map": None,
    }
    motion_sections(page, columns, "Motions")
    page.section("Worst of each measure", _worst(report), "half")
    first = _first_motions(report.run)
    page.findings([*report.violations, *report.warnings], lambda item: first.get(item.place))
    return page.render()


def _lead(report: VerifyReport, maps: RunMaps) -> list[str]:
    careful = "".join(f", but {text}" for text in headlines(report.warnings))
    near = nearest_words(maps.clearance, maps.margin / DEG)
    if report.ok:
        lines = [
            f"The program is good: {report.points} motions, nothing against them{careful}.{near}"
        ]
    else:
        first = report.violations[0]
        count = len(report.violations)
        word = "one violation" if count == 1 else f"{count} violations"
        lines = [f"The program is bad: {word}.{near}", f"First: {first}"]
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


def _first_motions(run: Played) -> dict[tuple[str, int], int]:
    """Return the first motion of each line, by file and line."""
    trace = run.paths.trace
    return {trace.place(row): row for row in reversed(range(len(trace)))}


def texts_by_motion(report: VerifyReport) -> dict[int, list[str]]:
    """Return the violations by the first motion of the line they name."""
    first = _first_motions(report.run) if report.run else {}
    found: dict[int, list[str]] = defaultdict(list)
    for violation in report.violations:
        at = first.get(violation.place)
        if at is not None:
            found[at].append(f"{violation.code}: {violation.message}")
    return dict(found)


def _moves(run: Played, cell: Cell) -> dict[str, Any]:
    paths, station = run.paths, run.paths.station
    m = len(paths)
    is_cp = paths.trace.is_cp
    owner, _, _, point, _ = paths.in_order()
    point = in_drawn_base(cell, station.base[owner], point)
    end_point = in_drawn_base(cell, station.base, paths.end_point)
    known = np.isfinite(point).all(axis=1)
    return {
        "q": packed(forward_filled(paths.q)),
        "time": packed(np.cumsum(run.durations)),
        "positions": packed(forward_filled(end_point)),
        **frame_data(cell, station.tool, station.base),
        "tag": packed(np.arange(m), "int32"),
        "rapid": packed(~is_cp, "uint8"),
        "trail": packed(point[known]),
        "owner": packed(owner[known], "int32"),
        "circles": packed(np.zeros(0), "int32"),
        "aux": packed(np.zeros((0, 3))),
        "stations": [],
        "station": packed(np.zeros(0), "uint16"),
    }


def _columns(run: Played, maps: RunMaps) -> list[TagColumn]:
    trace = run.paths.trace
    speed = np.where(trace.is_cp, trace.column("speed"), np.nan)
    columns = [
        TagColumn("feed", "speed", "mm/min", speed / MM_PER_MIN),
        TagColumn("margin", "margin", "deg", maps.margin / DEG, "low"),
        TagColumn("wrist", "wrist |A5|", "deg", maps.wrist / DEG, "low"),
        TagColumn("deviation", "deviation", "mm", _deviation(run) / MM, "high"),
    ]
    return [column for column in columns if np.isfinite(column.values).any()]


def _deviation(run: Played) -> FloatArray:
    result = np.full(len(run.paths), np.nan)
    if run.served is not None and run.position_error is not None:
        known = run.served >= 0
        result[run.served[known]] = run.position_error[known]
    return result


def _rows(run: Played, cell: Cell, columns: list[TagColumn]) -> dict[str, Any]:
    paths, station = run.paths, run.paths.station
    points = forward_filled(in_drawn_base(cell, station.base, paths.end_point))
    axes = axes_in_drawn_base(cell, station.base, paths.end_axis)
    return {
        "names": [str(i + 1) for i in range(len(paths))],
        "lines": packed(paths.trace.line, "int32"),
        "columns": [column.to_page() for column in columns],
        "tag_positions": packed(points),
        "tag_axes": packed(-forward_filled(axes)),
        "tag_frames": frame_words(cell, station.tool, station.base),
        "move_of_tag": packed(np.arange(len(paths)), "int32"),
        **extent_of(points),
    }


def _texts(run: Played, toolpath: ToolPath | None) -> dict[str, Any]:
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
