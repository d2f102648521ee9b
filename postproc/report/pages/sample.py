"""The page of a measuring plan: cells and tags, what is left out, what it will tell."""

from __future__ import annotations

import numpy as np

from postproc.report.parts import (
    Drawing,
    Page,
    RowsView,
    Series,
    TagColumn,
    add_rows,
    first_rows,
    line_chart,
    space_view,
    table,
)
from postproc.stiffness.identify import shown_text
from postproc.stiffness.sample import Sampling, SamplingPlan
from postproc.units import DEG, MM, PERCENT

_ALL, _SOME, _NONE = "#0b6bcb", "#b26a00", "#c62828"
_MOST_ROWS = 500


def sample_page(sampling: Sampling, drawing: Drawing) -> bytes:
    """Return the page as bytes."""
    plan, request = sampling.plan, sampling.request
    loads = ", ".join(load.name for load in request.loads)
    nx, ny, nz = plan.grid.counts
    edge = " x ".join(f"{v:.4g}" for v in plan.grid.size / MM)
    page = Page(
        f"Measuring plan {request.name}",
        (
            f"{len(plan)} postures at {len(np.unique(plan.tag))} tags, read without load and with "
            f"{loads}: {len(plan) * (1 + len(request.loads))} readings.",
            f"{nx} x {ny} x {nz} cells of {edge} mm; joint travel {sampling.travel / DEG:.0f} deg "
            f"in one pass; robot {sampling.cell.robot.name}.",
        ),
    )
    _scene(page, sampling, drawing)
    page.section("Cells and tags", _view(plan), "half")
    page.section("Joint angles in the order of measuring", _angles(plan), "half")
    page.section("What it will tell", _outlook(sampling))
    page.section("Left out", _left_out(sampling))
    return page.render()


def _scene(page: Page, sampling: Sampling, drawing: Drawing) -> None:
    """Add the postures: the robot goes to the one that is picked."""
    plan = sampling.plan
    points = plan.points[plan.tag]
    columns = [TagColumn("order", "order", "no.", np.arange(1.0, len(plan) + 1.0))]
    columns += [TagColumn(axis, axis, "mm", points[:, k] / MM) for k, axis in enumerate("xyz")]
    columns += [TagColumn(f"a{j + 1}", f"A{j + 1}", "deg", plan.q[:, j] / DEG) for j in range(6)]
    names = [plan.name(i) for i in range(len(plan))]
    view = RowsView("posture", names, points, columns, plan.q)
    add_rows(page, "Postures", view, drawing)


def _view(plan: SamplingPlan) -> str:
    used = np.bincount(plan.tag, minlength=len(plan.points))
    most = int(used.max())
    colours = [_ALL if n == most else _SOME if n else _NONE for n in used]
    titles = [
        f"T{i + 1:04d} ({x:.0f}, {y:.0f}, {z:.0f}) mm, {used[i]} postures"
        for i, (x, y, z) in enumerate(plan.points / MM)
    ]
    low = plan.grid.lowest / MM
    boxes = [(corner, corner + plan.grid.size / MM) for corner in low[:1000]]
    foot = "<p>blue: all postures, orange: some, red: none. Robot root frame.</p>"
    return space_view(plan.points / MM, colours, boxes, titles) + foot


def _outlook(sampling: Sampling) -> str:
    rows = []
    for joint in range(6):
        sd = sampling.outlook.relative_sd[joint]
        shown = shown_text(sampling.shown_by.get(joint))
        rows.append(
            (
                f"A{joint + 1}",
                sampling.outlook.visibility[joint],
                f"{sd / PERCENT:.2g} %" if np.isfinite(sd) else "-",
                shown or "",
            )
        )
    return table(("joint", "will be", "sd of k", "shown by"), rows)


def _angles(plan: SamplingPlan) -> str:
    steps = np.arange(len(plan), dtype=np.float64)
    series = [Series(f"A{i + 1}", steps, plan.q[:, i] / DEG) for i in range(6)]
    return line_chart(series, "posture", "deg")


def _left_out(sampling: Sampling) -> str:
    rows: list[tuple[object, ...]] = [
        (f"T{tag + 1:04d}", f"{sampling.request.rules.angles[turn] / DEG:+.0f}", reason)
        for tag, turn, reason in sampling.plan.dropped
    ]
    rows += [(name, "", "the way to it collides") for name in sampling.blocked]
    if not rows:
        return "<p>nothing</p>"
    return first_rows(("tag", "angle [deg]", "why"), rows[:_MOST_ROWS], len(rows) - _MOST_ROWS)
