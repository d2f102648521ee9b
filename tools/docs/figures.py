"""Figures of the explanations, drawn by the product from the example files at build time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.cell import load_cell
from postproc.planning import plan, spin_curves, spin_degrees, spin_map
from postproc.readers import read
from postproc.report.parts import Series, draw, line_chart
from postproc.units import N_PER_MM

CASE = "trim_5axis"
INPUT = "trim.cls"
STYLE = (
    "<style>text{font:11px system-ui,sans-serif;fill:#444}.grid,.axis{stroke:#ccc}"
    "path,polyline{fill:none;stroke-width:2}</style>"
)


def pictures(root: Path) -> dict[str, str | bytes]:
    """Return the pictures by their place in ``docs``."""
    case = root / "fixtures" / CASE
    cell = load_cell(str(case / "cell.toml"))
    toolpath = read(str(case / INPUT))
    curves = spin_curves(toolpath, cell, np.array([0, len(toolpath) // 2]), step=np.radians(2.0))
    degrees = spin_degrees(curves)

    def chart(row: int, names: tuple[str, ...]) -> str:
        series = [Series(name, degrees, curves.values[name][row] / N_PER_MM) for name in names]
        return _standalone(line_chart(series, "rotation about the tool axis [deg]", "N/mm"))

    return {
        "pictures/stiffness_axial.svg": chart(0, ("axial", "radial")),
        "pictures/stiffness_index.svg": chart(0, ("axial", "ellipsoid_kx")),
        "pictures/spin_map.png": draw(spin_map(plan(toolpath, cell), cell)).png,
    }


def _standalone(chart: str) -> str:
    """Return a chart of a page as a file of its own."""
    head, body = chart.split(">", 1)
    return f'{head} xmlns="http://www.w3.org/2000/svg">{STYLE}{body}'
