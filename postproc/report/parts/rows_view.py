"""A view of rows in space: points with values, arrows, and the robot in the posture of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import apply, inverse
from postproc.records import dataclass
from postproc.report.parts.page import Page, escape, packed
from postproc.report.parts.scene_data import Drawing, body_data, extent_of, robot_data
from postproc.report.parts.tag_values import TagColumn

_SHOWN_ARROW = 0.06
"""Share of the extent that the longest arrow gets at first."""


@dataclass(frozen=True, slots=True)
class RowsView:
    """What is shown.

    Args:
        what: one row in a word, such as ``row``, ``posture``, ``point``.
        names: (n,) of the rows.
        points: (n, 3) [m] in robroot (in the workpiece frame without a robot).
        columns: numbers of the rows; the first is the colour at first.
        q: (n, 6) [rad] posture of each row, or None.
        vectors: (n, 3) [m] arrows at the points, or None.
        notes: (n,) texts, or None.
    """

    what: str
    names: Sequence[str]
    points: FloatArray
    columns: Sequence[TagColumn]
    q: FloatArray | None = None
    vectors: FloatArray | None = None
    notes: Sequence[str] | None = None


def add_rows(
    page: Page,
    heading: str,
    view: RowsView,
    drawing: Drawing | None = None,
    with_part: bool = False,
) -> None:
    """Add the 3D view and the list of rows to a page, with the robot where one is drawn.

    ``with_part``: the rows are of the workpiece, which is drawn too.
    """
    if drawing is not None:
        robot, solids = robot_data(drawing), body_data(drawing)
        root = {} if with_part else {"T_world_base": robot["T_world_robroot"]}
        page.data["robot"] = robot | root
        page.data["bodies"] = [s for s in solids if with_part or s["kind"] != "workpiece"]
        if with_part:
            points = apply(inverse(drawing.cell.T_robroot_base), view.points)
            view = replace(view, points=points)
    page.data["rows"] = _rows(view)
    page.script = "rows.js"
    bar = f'<div class="bar">{colour_html(view.columns)}{_arrow_html(view)}</div>'
    page.section(heading, f'<div id="scene"></div>{bar}', "seven")
    page.section(f"{view.what.capitalize()}s", list_html(), "five")


def _rows(view: RowsView) -> dict[str, Any]:
    points = np.asarray(view.points, dtype=np.float64).reshape(-1, 3)
    return {
        "what": view.what,
        "names": list(view.names),
        "points": packed(points),
        "columns": [column.to_page() for column in view.columns],
        "q": None if view.q is None else packed(view.q),
        "vectors": None if view.vectors is None else packed(view.vectors),
        "notes": None if view.notes is None else list(view.notes),
        **extent_of(points),
    }


def colour_html(columns: Sequence[TagColumn]) -> str:
    """Return what chooses the column that colours a scene, and its legend."""
    options = "".join(
        f'<option value="{column.key}">{escape(column.label)} [{column.unit}]</option>'
        for column in columns
    )
    return (
        f'<label>colour <select id="colour">{options}</select></label><span id="low"></span>'
        '<span class="legend" id="legend"></span><span id="high"></span>'
    )


def list_html(filters: str = "") -> str:
    """Return the list of rows with what it is searched by."""
    return (
        f'<div class="bar">{filters}<label>find <input id="search" type="search" size="10"></label>'
        '<span id="more"></span></div><div class="scroll" id="list"><table id="tags">'
        "<thead><tr></tr></thead><tbody></tbody></table></div>"
    )


def _arrow_html(view: RowsView) -> str:
    if view.vectors is None or not len(view.vectors):
        return ""
    longest = float(np.linalg.norm(view.vectors, axis=1).max())
    extent = float(np.linalg.norm(np.ptp(view.points, axis=0)))
    start = np.log10(max(_SHOWN_ARROW * extent / max(longest, 1e-12), 1.0))
    return (
        f'<label>arrows <input type="range" id="stretch" min="0" max="{start + 1.0:.2f}" '
        f'step="0.01" value="{start:.2f}"></label><span id="factor"></span>'
    )
