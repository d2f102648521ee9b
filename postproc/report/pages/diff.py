"""A comparison of two programs as a page, what moved drawn in it, and as a comment in Markdown."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from postproc.report.parts import Page, RowsView, TagColumn, add_rows, first_rows, table
from postproc.units import MM

if TYPE_CHECKING:
    from postproc.comparison import Difference, DiffReport

_MOST_ROWS = 2000
_GROUPS, _SINGLE = 20, 25
_WIDTH = 300
"""So many characters of a line are shown."""


def diff_page(report: DiffReport) -> bytes:
    """Return the page of a comparison as one self-contained HTML file.

    Moved targets stand at their old places with an arrow to the new ones, in $BASE of each program.
    """
    page = Page(f"{report.old} against {report.new}", _lead(report))
    moved = [item for item in report.differences if item.position_mm is not None]
    if moved:
        add_rows(page, "Moved points, $BASE", _view(moved))
    counts = [(kind, count) for kind, count in report.counts().items()]
    page.section("How many of each kind", table(("kind", "differences"), counts), "third")
    page.section("All differences", _all(report), "wide" if counts else "")
    return page.render()


def _lead(report: DiffReport) -> list[str]:
    if report.same:
        return [f"Same: the robot does the same with both, {report.old_motions} motions."]
    text = report.headline().removeprefix("different: ")
    motions = f"{report.old_motions} motions in the old program, {report.new_motions} in the new."
    return [f"Different: {text}.", motions]


def _view(moved: list[Difference]) -> RowsView:
    pairs = np.array([item.position_mm for item in moved], dtype=np.float64)[..., :3] * MM
    turned = [item.angle_deg if item.angle_deg is not None else np.nan for item in moved]
    shift = [item.distance_mm if item.distance_mm is not None else np.nan for item in moved]
    lines = [float(item.old_line or 0) for item in moved]
    columns = [
        TagColumn("shift", "shift", "mm", np.array(shift), "high"),
        TagColumn("turn", "turned", "deg", np.array(turned), "high"),
        TagColumn("line", "old line", "line", np.array(lines)),
    ]
    known = [column for column in columns if np.isfinite(column.values).any()]
    names = [_place(item.old_file, item.old_line) for item in moved]
    return RowsView("point", names, pairs[:, 0], known, None, pairs[:, 1] - pairs[:, 0])


def _all(report: DiffReport) -> str:
    if report.same:
        return '<p class="good">none</p>'
    rows = [
        (
            item.kind,
            _place(item.old_file, item.old_line),
            _place(item.new_file, item.new_line),
            "" if item.distance_mm is None else f"{item.distance_mm:.4f}",
            "" if item.angle_deg is None else f"{item.angle_deg:.4f}",
            item.detail,
        )
        for item in report.differences[:_MOST_ROWS]
    ]
    head = ("kind", "old", "new", "shift [mm]", "turn [deg]", "what")
    return first_rows(head, rows, len(report.differences) - _MOST_ROWS)


def _place(file: str, line: int | None) -> str:
    return "-" if line is None else f"{PurePath(file).name}:{line}"


def diff_markdown(report: DiffReport) -> bytes:
    """Return what changed in at most 60 lines: the verdict, groups, the first differences."""
    lines = [f"### {_safe(report.old)} against {_safe(report.new)}", "", _safe(report.headline())]
    groups = report.groups()
    if groups:
        lines += ["", "| what | how many | |", "| --- | --- | --- |"]
        lines += [f"| {g.kind} | {g.count} | {_safe(g.text)} |" for g in groups[:_GROUPS]]
        lines += _more(len(groups) - _GROUPS, "kinds of changes")
    if report.differences:
        lines += ["", "<details><summary>single differences</summary>", ""]
        lines += [f"- {_safe(str(item))}" for item in report.differences[:_SINGLE]]
        lines += _more(len(report.differences) - _SINGLE, "differences")
        lines += ["", "</details>"]
    return ("\n".join(lines) + "\n").encode()


def _more(left: int, what: str) -> list[str]:
    return ["", f"and {left} more {what}"] if left > 0 else []


def _safe(text: str) -> str:
    """Return text of a program in one line that means nothing to Markdown."""
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())[:_WIDTH]
    for mark in "\\`*_|<>[]#":
        plain = plain.replace(mark, f"\\{mark}")
    return plain
