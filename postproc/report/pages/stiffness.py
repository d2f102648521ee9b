"""The page of stiffness over the rotation about the tool axis, per key tag."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.planning import INDICES, SpinCurves, spin_degrees
from postproc.report.parts import Drawing, Page, RowsView, TagColumn, add_rows, packed, table
from postproc.units import DEG, N_PER_MM, PERCENT

_CHARTS = {
    "along the tool axis": ("axial", "ellipsoid_kx"),
    "across the path": ("normal", "ellipsoid_kv"),
    "across the tool axis": ("radial", "first_cross", "second_cross"),
}
_SHOWN = ("axial", "normal", "ellipsoid_kx", "ellipsoid_kv")


def stiffness_page(
    curves: SpinCurves, places: FloatArray, title: str, stiffness: str, drawing: Drawing
) -> bytes:
    """Return the page of curves of tags at places (t, 3) [m] in the robot root.

    ``stiffness``: what the joint stiffness is, in words.
    """
    can, robot = curves.best("axial") >= 0, drawing.cell.robot
    q = curves.q[np.arange(len(can)), np.maximum(curves.best("axial"), 0)]
    margin = np.minimum(q - robot.q_min, robot.q_max - q).min(axis=1)
    margin = np.where(can, margin, np.nan)
    lead = [_result(curves, margin), f"Calculated with {stiffness}."]
    if curves.coaxial.all():
        lead.append(
            "The tool axis lies on axis 6: the rotation turns axis 6 alone and changes no "
            "stiffness. Spinning the tool gains nothing here."
        )
    page = Page(f"Stiffness of {title}", lead, good=bool(can.all()))
    names = [name + _tool(curves, row) for row, name in enumerate(curves.names)]
    view = RowsView(
        "tag",
        names,
        places,
        [*_columns(curves), TagColumn("margin", "margin", "deg", margin / DEG, "low")],
        np.where(np.isfinite(q), q, 0.0),
        notes=["" if here else "cannot be run at any rotation" for here in can],
    )
    add_rows(page, "Robot at the best rotation", view, drawing, with_part=True)
    page.data["curves"] = {
        "spins": spin_degrees(curves).tolist(),
        "values": {name: packed(v / N_PER_MM) for name, v in curves.values.items()},
        "blocked": packed(curves.blocked, "uint8"),
        "charts": list(_CHARTS.values()),
    }
    for k, heading in enumerate(_CHARTS):
        page.section(f"Stiffness {heading}", f'<div id="curve{k}"></div>', "third")
    meaning = [(name, text) for name, text in INDICES.items()]
    page.section("What the curves are", table(("curve", "stiffness"), meaning))
    return page.render()


def _tool(curves: SpinCurves, row: int) -> str:
    """Return the tool of a tag in words, nothing where all have one."""
    return f", tool {curves.tools[row]}" if len(set(curves.tools)) > 1 else ""


def _result(curves: SpinCurves, margin: FloatArray) -> str:
    """Return what the curves come to, in one sentence."""
    best = curves.best("axial")
    can = np.flatnonzero(best >= 0)
    if not len(can):
        return "Bad: no tag can be run at any rotation about the tool axis."
    free = np.where(curves.blocked[can], np.nan, curves.values["axial"][can])
    most, least = np.nanmax(free, axis=1), np.nanmin(free, axis=1)
    loss = float(np.max(1.0 - least / most)) / PERCENT
    cannot = len(best) - len(can)
    head = f"Bad: {cannot} of {len(best)} tags cannot be run at any rotation."
    return (
        (head if cannot else f"Good: all {len(best)} tags can be run.")
        + f" At the best rotation the tool is {most.min() / N_PER_MM:.0f} to "
        f"{most.max() / N_PER_MM:.0f} N/mm stiff along its axis; the worst one that can be run "
        f"costs up to {loss:.0f} % of it. Smallest margin to a joint limit "
        f"{np.nanmin(margin) / DEG:.1f} deg."
    )


def _columns(curves: SpinCurves) -> list[TagColumn]:
    """Return value, rotation and gain of the best rotation by each index."""
    degrees, rows, columns = spin_degrees(curves), np.arange(len(curves.tags)), []
    for name in _SHOWN:
        at = curves.best(name)
        known = at >= 0
        value = curves.values[name][rows, np.maximum(at, 0)] / N_PER_MM
        columns += [
            TagColumn(name, name, "N/mm", np.where(known, value, np.nan), "low"),
            TagColumn(f"{name}_at", "at", "deg", np.where(known, degrees[at], np.nan)),
            TagColumn(f"{name}_gain", "over 0", "%", curves.gain(name) / PERCENT),
        ]
    return columns
