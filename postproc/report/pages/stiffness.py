"""The page of stiffness over the rotation about the tool axis, per key tag."""

from __future__ import annotations

import numpy as np

from postproc.planning import INDICES, SpinCurves, spin_degrees
from postproc.report.parts import Page, Series, line_chart, table
from postproc.units import N_PER_MM, PERCENT

_PAIRS = (
    ("axial", "ellipsoid_kx"),
    ("normal", "ellipsoid_kv"),
    ("radial", "first_cross", "second_cross"),
)


def stiffness_page(curves: SpinCurves, title: str, stiffness: str) -> bytes:
    """Return the page as bytes.

    Args:
        curves: indices over the spin.
        title: name of the toolpath.
        stiffness: what the joint stiffness is, in words.
    """
    lead = [_result(curves), f"Calculated with {stiffness}."]
    if curves.coaxial.all():
        lead.append(
            "The tool axis lies on axis 6: the rotation turns axis 6 alone and changes no "
            "stiffness. Spinning the tool gains nothing here."
        )
    page = Page(f"Stiffness of {title}", lead)
    page.section("Best rotation by tag", _best(curves))
    page.section("All tags", _comparison(curves, "axial"), "half")
    page.section("All tags", _comparison(curves, "normal"), "half")
    for row, name in enumerate(curves.names):
        charts = "".join(_chart(curves, row, names) for names in _PAIRS)
        page.section(f"Tag {name}{_tool(curves, row)}", f'<div class="grid">{charts}</div>')
    meaning = [(name, text) for name, text in INDICES.items()]
    page.section("What the curves are", table(("curve", "stiffness"), meaning))
    return page.render()


def _tool(curves: SpinCurves, row: int) -> str:
    """Return the tool of a tag in words, nothing where all have one."""
    return f", tool {curves.tools[row]}" if len(set(curves.tools)) > 1 else ""


def _result(curves: SpinCurves) -> str:
    """Return what the curves come to, in one sentence."""
    best = curves.best("axial")
    can = np.flatnonzero(best >= 0)
    if not len(can):
        return "No tag can be run at any rotation about the tool axis."
    values = curves.values["axial"][can]
    free = np.where(curves.blocked[can], np.nan, values)
    most, least = np.nanmax(free, axis=1), np.nanmin(free, axis=1)
    loss = float(np.max(1.0 - least / most)) / PERCENT
    cannot = len(best) - len(can)
    return (
        f"At the best rotation the tool is {most.min() / N_PER_MM:.0f} to "
        f"{most.max() / N_PER_MM:.0f} N/mm stiff along its axis; the worst one that can be run "
        f"costs up to {loss:.0f} % of it."
        + (f" {cannot} of {len(best)} tags cannot be run at any rotation." if cannot else "")
    )


def _chart(curves: SpinCurves, row: int, names: tuple[str, ...]) -> str:
    x = spin_degrees(curves)
    blocked = curves.blocked[row]
    values = {name: curves.values[name][row] / N_PER_MM for name in names}
    series = [Series(name, x, np.where(blocked, np.nan, y)) for name, y in values.items()]
    if blocked.any():
        cannot = np.where(blocked, values[names[0]], np.nan)
        series.append(Series(f"{names[0]}, cannot be run", x, cannot))
    return line_chart(series, "rotation about the tool axis [deg]", "N/mm", size=(460, 210))


def _comparison(curves: SpinCurves, name: str) -> str:
    x = spin_degrees(curves)
    shown = range(min(len(curves.names), 6))
    series = [Series(curves.names[i], x, curves.values[name][i] / N_PER_MM) for i in shown]
    return f"<p>{INDICES[name]}</p>" + line_chart(
        series, "rotation about the tool axis [deg]", "N/mm"
    )


def _best(curves: SpinCurves) -> str:
    degrees = spin_degrees(curves)
    rows = []
    for row, name in enumerate(curves.names):
        cells: list[str] = [name + _tool(curves, row)]
        for index in ("axial", "normal", "ellipsoid_kx", "ellipsoid_kv"):
            at = int(curves.best(index)[row])
            if at < 0:
                cells += ["cannot be run", "", ""]
                continue
            gain = float(curves.gain(index)[row])
            cells += [
                f"{degrees[at]:+.0f}",
                f"{curves.values[index][row, at] / N_PER_MM:.0f}",
                f"{gain / PERCENT:+.1f} %" if np.isfinite(gain) else "-",
            ]
        rows.append(cells)
    head = ["tag"]
    for index in ("axial", "normal", "ellipsoid_kx", "ellipsoid_kv"):
        head += [f"{index} [deg]", "N/mm", "over 0 deg"]
    return table(head, rows)
