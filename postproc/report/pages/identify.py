"""The page of an identification: stiffness per joint over cells, errors before and after."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.report.parts import (
    Drawing,
    Page,
    RowsView,
    Series,
    TagColumn,
    add_rows,
    bar_chart,
    escape,
    line_chart,
    table,
)
from postproc.stiffness import ContinuousField
from postproc.stiffness.identify import Identification, identify_document, warnings
from postproc.units import DEG, MM, NMM_PER_RAD, PERCENT

_MOST_CURVES = 200
_MOST_ROWS = 3000


def identify_page(result: Identification, drawing: Drawing | None = None) -> bytes:
    """Return the page of what was identified; without a drawing the points alone."""
    content = identify_document(result)
    page = Page(
        "Joint stiffness",
        (
            f"{content['load_responses']} load responses at {content['postures']} postures; chosen "
            f"model: {result.chosen} ({result.reason}).",
            f"The loads move the tool by {result.deflection_mean / MM:.4f} mm on average, "
            f"{result.deflection_max / MM:.4f} mm at most. Noise {result.noise / MM:.4f} mm per "
            f"axis ({_source(content)}); noise alone leaves an error of "
            f"{result.floor_mean / MM:.4f} mm: no model can be seen to do better.",
        ),
    )
    found = warnings(result)
    if found:
        items = "".join(f'<li class="warn">{escape(text)}</li>' for text in found)
        page.section("Mind", f"<ul>{items}</ul>")
    _space(page, result, drawing)
    page.section("Joints, constant over the workspace", _joints(content))
    page.section("Error before and after, by model", _errors(result), "half")
    page.section("Distribution of the error", _distribution(result), "half")
    page.section("Models on tags that they have not seen", _models(content))
    for name, fit in result.grids.items():
        body = _over_cells(1.0 / fit.field.c_joint, fit.sd / fit.field.c_joint)
        page.section(f"Stiffness over the cells: {name} mm", body)
    if result.continuous is not None:
        page.section("Stiffness over each joint's own angle, continuous model", _curves(result))
    return page.render()


def _source(content: dict[str, object]) -> str:
    repeats = content["noise_from"] == "repeated readings"
    return "from repeated readings" if repeats else "upper bound: what the best model leaves"


def _joints(content: dict[str, object]) -> str:
    rows = []
    joints = content["joints"]
    if not isinstance(joints, list):
        return ""
    for joint in joints:
        low, high = joint["stiffness_ci_Nmm_per_rad"]
        sd = joint["relative_sd"]
        rows.append(
            (
                f"A{joint['joint']}",
                joint["status"],
                _short(joint["stiffness_Nmm_per_rad"]),
                _short(low),
                _short(high) if low is not None else "-",
                "-" if sd is None else f"{sd / PERCENT:.2g} %",
                f"{joint['motion_mm']:.4f}",
                joint["shown_by"] or "",
            )
        )
    share = float(str(content["confidence"])) / PERCENT
    head = (
        *("joint", "status", "k [Nmm/rad]", f"{share:.0f} % from", "to"),
        *("sd of c", "motion [mm]", "shown by"),
    )
    return table(head, rows)


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _errors(result: Identification) -> str:
    names = ["before", *(score.name for score in result.scores)]
    mean = [result.deflection_mean, *(score.held_out_mean for score in result.scores)]
    largest = [result.deflection_max, *(score.held_out_max for score in result.scores)]
    at = np.arange(len(names), dtype=np.float64)
    series = [Series("mean", at, np.array(mean) / MM), Series("max", at, np.array(largest) / MM)]
    return bar_chart(names, series, "mm", [("noise alone", result.floor_mean / MM)])


def _distribution(result: Identification) -> str:
    before = np.sort(np.linalg.norm(result.cases.d * result.cases.scale[:, None], axis=1))
    after = np.sort(np.linalg.norm(result.held_out_error, axis=1))
    share = (np.arange(len(before)) + 1.0) / len(before) / PERCENT
    step = max(len(before) // 400, 1)
    series = [
        Series("before", before[::step] / MM, share[::step]),
        Series(f"after, {result.chosen}", after[::step] / MM, share[::step]),
    ]
    return line_chart(series, "error [mm]", "% of load responses below")


def _models(content: dict[str, object]) -> str:
    models = content["models"]
    if not isinstance(models, list):
        return ""
    rows = [
        (
            model["name"],
            model["description"],
            *(
                f"{model[key]:.4f}"
                for key in (
                    *("held_out_mean_mm", "standard_error_mm", "held_out_p95_mm"),
                    *("held_out_max_mm", "fitted_mean_mm"),
                )
            ),
        )
        for model in models
    ]
    head = ("model", "", "mean [mm]", "+-", "95 %", "max", "mean fitted")
    return table(head, rows)


def _space(page: Page, result: Identification, drawing: Drawing | None) -> None:
    """Add the load responses in space, with the error on held-out tags."""
    cases = result.cases
    moved = cases.d * cases.scale[:, None]
    order = np.argsort(np.linalg.norm(result.held_out_error, axis=1))[::-1][:_MOST_ROWS]
    columns = [
        TagColumn("error", "error", "mm", _length(result.held_out_error[order]), "high"),
        TagColumn("moved", "moved", "mm", _length(moved[order])),
    ]
    names = [cases.ids[i] for i in order]
    view = RowsView("response", names, cases.point[order], columns, cases.q[order], moved[order])
    add_rows(page, f"Load responses and their error, held out, {result.chosen}", view, drawing)


def _length(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(vectors, axis=1) / MM)


def _over_cells(k: FloatArray, relative_sd: FloatArray) -> str:
    """Return one chart a joint, as Figures 11 to 15 of Jiao et al. 2022, with one sigma."""
    charts = []
    cells = np.arange(1.0, len(k) + 1.0)
    for joint in range(6):
        values = k[:, joint] / NMM_PER_RAD
        if not np.any(np.isfinite(values)):
            continue
        sd = relative_sd[:, joint]
        series = Series(
            f"A{joint + 1}", cells, values, values / (1.0 + sd), values * (1.0 + sd), marks=True
        )
        charts.append(line_chart([series], "cell", "Nmm/rad", size=(460, 190), log_y=True))
    return _side_by_side(charts)


def _curves(result: Identification) -> str:
    field = result.field
    if not isinstance(field, ContinuousField) or result.continuous is None:
        return "<p>not the chosen model</p>"
    q = result.cases.q
    order = np.linspace(0, len(q) - 1, min(len(q), _MOST_CURVES)).astype(int)
    c = field.compliance(q[order])
    sd = result.continuous.log_sd(q[order])
    charts = []
    for joint in np.flatnonzero(field.observed):
        by_angle = np.argsort(q[order, joint])
        angle = q[order[by_angle], joint] / DEG
        k = 1.0 / c[by_angle, joint] / NMM_PER_RAD
        spread = np.exp(sd[by_angle, joint])
        name = f"A{int(joint) + 1}"
        dots = Series(name, angle, k, k / spread, k * spread, marks=True)
        charts.append(line_chart([dots], "own angle [deg]", "Nmm/rad", size=(460, 190), log_y=True))
    return _side_by_side(charts)


def _side_by_side(charts: list[str]) -> str:
    return f'<div class="grid">{"".join(charts)}</div>'
