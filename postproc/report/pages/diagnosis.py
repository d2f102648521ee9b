"""The page of a diagnosis: plain words first, then where, which effect, what is left, what next."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap import (
    Along,
    Diagnosis,
    Part,
    Samples,
    effect_of,
    is_ambiguous,
    noise_words,
    parts,
    summary,
)
from postproc.report.pages.certificate import add_certificate
from postproc.report.parts import (
    Drawing,
    Page,
    RowsView,
    Series,
    TagColumn,
    add_rows,
    bar_chart,
    doubt,
    escape,
    headline,
    how_far,
    line_chart,
    shaded_view,
    table,
    where_joint,
    where_place,
    where_time,
    which,
)
from postproc.units import DEG, MM, PERCENT

_MOST_POINTS = 1500
_BINS = 12
_MOST_DOTS = 600
_CARD = (440, 240)


def diagnosis_page(
    diagnosis: Diagnosis,
    content: dict[str, Any],
    drawing: Drawing | None = None,
    path: Along | None = None,
) -> bytes:
    """Return the page of a diagnosis with its document; without a drawing the points alone."""
    title = f"Sim-to-real gap: {content['verdict'].replace('_', ' ')}"
    page = Page(title, [headline(content)])
    _at_a_glance(page, diagnosis, content)
    _space(page, diagnosis, drawing)
    words = "".join(f"<p>{escape(line)}</p>" for line in summary(content))
    page.section("In words", words)
    page.section("Effects, on rows that were not fitted", _effects(content))
    page.section("Gap before and after", _before_after(diagnosis), "half")
    if path is not None:
        page.section("Gap along the program", _program(diagnosis, content, path))
    page.section("Where: direction, conditions, cells", _where(content), "half")
    for part in parts(diagnosis):
        page.section(f"{part.name}: the data against the cause", _against(diagnosis, part), "half")
    page.section("What is left: tests of the residual", _tests(content), "half")
    page.section("Numbers of the adopted effects", _numbers(content), "wide")
    page.section("What to measure next", _next(content))
    add_certificate(page, content)
    return page.render()


def _at_a_glance(page: Page, diagnosis: Diagnosis, content: dict[str, Any]) -> None:
    """Add where (joint, place, time), which, how far, how the noise is known, and one doubt."""
    for name, words, picture in (
        ("Where: joint", where_joint(content), _joint_shares(content)),
        ("Where: place", where_place(content), _places(diagnosis)),
        ("Where: time", where_time(content), _along(diagnosis)),
    ):
        page.section(name, f"<p>{escape(words)}</p>{picture}", "third")
    found = which(content)
    named = table(("cause or class", "how sure", "takes"), found)
    page.section("Which", named if found else "<p>No cause.</p>", "third")
    far = "".join(f"<p>{escape(line)}</p>" for line in how_far(content))
    page.section("How far", far + _shrunk(content), "third")
    noise = noise_words(content["noise"])
    body = f"<p>{escape(noise[0].upper() + noise[1:])}.</p><h3>One doubt</h3>"
    page.section("Noise", body + f'<p class="warn">{escape(doubt(content))}</p>', "third")


def _joint_shares(content: dict[str, Any]) -> str:
    if not content["adopted"]:
        return ""
    joints = sorted(content["where"]["joints"], key=lambda item: int(item["joint"]))
    values = np.array([item["share"] for item in joints])
    names = [f"A{item['joint']}" for item in joints]
    bars = [Series("", values, values / PERCENT)]
    return bar_chart(names, bars, "% of what is explained", size=_CARD)


def _places(diagnosis: Diagnosis) -> str:
    """Return the rows in space, the worse the darker."""
    before, _ = _sizes(diagnosis)
    rows = np.flatnonzero(diagnosis.kept)
    some = slice(None, None, max(1, len(rows) // _MOST_DOTS))
    points, size = diagnosis.problem.measured[rows[some]] / MM, before[some]
    ids = diagnosis.problem.measurements.ids
    titles = [f"{ids[k]}: {v:.3f} mm" for k, v in zip(rows[some], size, strict=True)]
    return shaded_view(points, size, titles, _CARD)


def _shrunk(content: dict[str, Any]) -> str:
    total, sigma = content.get("before", content["shrinkage"]), content["noise"]["sigma_mm"]
    if not (content["adopted"] or content["serving"] or "before" in content):
        return ""
    sizes = np.array([total["rms_before_mm"], total["rms_after_mm"]])
    levels = [] if sigma is None else [("noise", 3.0**0.5 * sigma)]
    bars = [Series("", sizes, sizes)]
    return bar_chart(["before", "after"], bars, "3D rms [mm]", levels, size=_CARD)


def _effects(content: dict[str, Any]) -> str:
    rows = []
    for item in content["effects"]:
        known = item["shrinkage"] is not None
        interval = item["shrinkage_ci"]
        rows.append(
            (
                item["name"],
                "adopted" if item["adopted"] else item.get("reason", ""),
                f"{item['probability']:.3f}",
                f"{item['rms_before_mm']:.4f}" if known else "-",
                f"{item['rms_after_mm']:.4f}" if known else "-",
                _percent(item["shrinkage"]) if known else "-",
                f"{_percent(interval[0])} to {_percent(interval[1])}" if interval else "-",
                ", ".join(item["confounded_with"]) or "-",
            )
        )
    rows += [
        (item["name"], f"not testable: needs {', '.join(item['needs'])}", *["-"] * 6)
        for item in content["not_testable"]
    ]
    head = (
        *("effect", "verdict", "probability", "before [mm]", "after [mm]"),
        *("shrinkage", "90 % interval", "cannot be told from"),
    )
    return table(head, rows)


def _percent(value: float) -> str:
    return f"{value / PERCENT:.1f} %"


def _before_after(diagnosis: Diagnosis) -> str:
    before, after = _sizes(diagnosis)
    edges = np.linspace(0.0, float(np.quantile(before, 0.995)) + 1e-9, 31)
    middle = 0.5 * (edges[1:] + edges[:-1])
    lines = [
        Series(name, middle, np.histogram(values, edges)[0].astype(np.float64))
        for name, values in (("before", before), ("after", after))
    ]
    return line_chart(lines, "distance from the simulated point [mm]", "rows")


def _sizes(diagnosis: Diagnosis) -> tuple[FloatArray, FloatArray]:
    """Return the gap and the residual (n,) of the rows kept [mm]."""
    kept = diagnosis.kept
    gap = diagnosis.problem.measured - diagnosis.baseline
    before = np.linalg.norm(gap, axis=1)[kept] / MM
    return before, np.linalg.norm(diagnosis.residual, axis=1)[kept] / MM


def _along(diagnosis: Diagnosis) -> str:
    before, after = _sizes(diagnosis)
    time = diagnosis.problem.samples.time
    axis = np.flatnonzero(diagnosis.kept) if time is None else time[diagnosis.kept]
    order = np.argsort(axis, kind="stable")[:: max(1, len(axis) // _MOST_POINTS)]
    x = np.asarray(axis[order], dtype=np.float64)
    label = "row" if time is None else "time [s]"
    noise = 3.0**0.5 * diagnosis.noise / MM
    return line_chart(
        [Series("before", x, before[order]), Series("after", x, after[order])],
        label,
        "distance [mm]",
        [("noise", noise)],
        size=_CARD,
    )


def _space(page: Page, diagnosis: Diagnosis, drawing: Drawing | None) -> None:
    """Add the rows in space: where they were measured, how far off, and what is left."""
    before, after = _sizes(diagnosis)
    rows = np.flatnonzero(diagnosis.kept)
    some = slice(None, None, max(1, len(rows) // _MOST_POINTS))
    picked = rows[some]
    gap = (diagnosis.problem.measured - diagnosis.baseline)[picked]
    columns = [
        TagColumn("gap", "gap", "mm", before[some], "high"),
        TagColumn("left", "left", "mm", after[some], "high"),
        *(TagColumn(f"d{axis}", f"d{axis}", "mm", gap[:, k] / MM) for k, axis in enumerate("xyz")),
    ]
    ids = diagnosis.problem.measurements.ids
    view = RowsView(
        "row",
        [str(ids[row]) for row in picked],
        diagnosis.problem.measured[picked],
        columns,
        diagnosis.problem.samples.q[picked],
        gap,
    )
    add_rows(page, "Where: the gap over the workspace", view, drawing)


def _program(diagnosis: Diagnosis, content: dict[str, Any], path: Along) -> str:
    """Return the gap over the way along the program, and its worst stretches."""
    before, after = _sizes(diagnosis)
    on = path.on[diagnosis.kept]
    way = path.way[diagnosis.kept][on] / MM
    order = np.argsort(way, kind="stable")
    lines = [
        Series(name, way[order], values[on][order], marks=True)
        for name, values in (("before", before), ("after", after))
    ]
    chart = line_chart(lines, "way along the program [mm]", "distance [mm]", size=(1120, 260))
    entry = content["where"]["program"]
    worst = sorted(entry["stretches"], key=lambda s: (-s["rms_mm"], s["from_mm"]))[:12]
    rows = [
        (
            item["operation"] or "-",
            f"{item['from_mm']:.0f} to {item['to_mm']:.0f}",
            item["line"],
            item["n"],
            f"{item['rms_mm']:.3f}",
            f"{item['max_mm']:.3f}",
            f"{item['left_rms_mm']:.3f}",
        )
        for item in worst
    ]
    beside = f"<p>{entry['rows_beside']} rows do not lie on it.</p>" if entry["rows_beside"] else ""
    head = (
        *("worst stretches: operation", "way [mm]", "line", "rows"),
        *("rms [mm]", "largest [mm]", "left [mm]"),
    )
    return chart + beside + table(head, rows)


def _where(content: dict[str, Any]) -> str:
    where = content["where"]
    axis = ", ".join(f"{v:.2f}" for v in where["direction"]["axis"])
    text = (
        f"<p>Mostly along ({escape(axis)}) in the robot root:"
        f" {_percent(where['direction']['share'])} of it.</p>"
    )
    rows = [(item["name"], _percent(item["share"])) for item in where["conditions"][:10]]
    cells = [
        (
            " to ".join("/".join(f"{v:.0f}" for v in cell[k]) for k in ("min_mm", "max_mm")),
            cell["n"],
            f"{cell['rms_mm']:.3f}",
        )
        for cell in where["cells"][:6]
    ]
    return (
        text
        + table(("condition", "share of the gap"), rows)
        + table(("worst cells x/y/z [mm]", "rows", "rms [mm]"), cells)
    )


def _against(diagnosis: Diagnosis, part: Part) -> str:
    """Return measured against explained, with everything else that was adopted taken out."""
    kept = diagnosis.kept
    own = part.moved[kept]
    seen = own + diagnosis.residual[kept]
    size = np.linalg.norm(own, axis=1)
    along = np.einsum("ni,ni->n", seen, own / (size[:, None] + 1e-15))
    x, name = _cause(diagnosis.problem.samples, part, kept, size)
    cuts = np.unique(np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1)))
    if len(cuts) < 3:
        return "<p>The cause has too few levels to draw.</p>"
    index = np.clip(np.searchsorted(cuts, x, side="right") - 1, 0, len(cuts) - 2)
    bins = [np.flatnonzero(index == k) for k in range(len(cuts) - 1)]
    bins = [rows for rows in bins if len(rows)]
    middle = np.array([float(np.mean(x[rows])) for rows in bins])
    measured = np.array([float(np.mean(along[rows])) for rows in bins]) / MM
    explained = np.array([float(np.mean(size[rows])) for rows in bins]) / MM
    spread = np.array([float(np.std(along[rows]) / np.sqrt(len(rows))) for rows in bins]) / MM
    lines = [
        Series("measured", middle, measured, measured - spread, measured + spread, True),
        Series("this effect", middle, explained),
    ]
    text = f"<p>{escape(effect_of(part.name).title)}.</p>"
    return text + line_chart(lines, name, "along the effect [mm]")


def _cause(
    samples: Samples, part: Part, kept: BoolArray, size: FloatArray
) -> tuple[FloatArray, str]:
    """Return what an effect is drawn over, and its label."""
    effect = effect_of(part.name)
    if "wrench" in effect.needs:
        return np.linalg.norm(samples.column("wrench")[kept, :3], axis=1), "force [N]"
    if "temperature" in effect.needs:
        return samples.column("temperature")[kept], "temperature [degC]"
    if "qd" in effect.needs:
        return np.linalg.norm(samples.column("qd")[kept], axis=1) / DEG, "joint speed [deg/s]"
    energy = np.sum(part.joint_change**2, axis=0)
    if bool(np.any(energy > 0)) and not effect.needs:
        joint = int(np.argmax(energy))
        return samples.q[kept, joint] / DEG, f"A{joint + 1} [deg]"
    return size / MM, "expected size [mm]"


def _tests(content: dict[str, Any]) -> str:
    rows = [
        (d["name"], f"{d['p_value']:.2g}", f"{d['rms_mm']:.4f}")
        for d in content["residual"]["depends_on"]
    ]
    text = "".join(
        f"<p>It {escape(item['title'])}: {escape(item['action'])}.</p>"
        for item in content["residual"]["resembles"]
    )
    head = ("the rest follows", "p-value", "part that follows [mm rms]")
    return text + table(head, rows)


def _numbers(content: dict[str, Any]) -> str:
    rows = []
    for item in content["effects"]:
        if not item["adopted"]:
            continue
        low, high = item["interval_90"]["low"], item["interval_90"]["high"]
        rows += [
            (item["name"], key, _shown(value), _shown(low.get(key)), _shown(high.get(key)))
            for key, value in item["parameters"].items()
        ]
    return table(("effect", "number", "value", "90 % from", "to"), rows)


def _shown(value: Any) -> str:  # noqa: ANN401 - a number or nested lists
    if isinstance(value, list):
        return "[" + ", ".join(_shown(v) for v in value) + "]"
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)


def _next(content: dict[str, Any]) -> str:
    rows = [
        (
            item.get("id", k + 1),
            " ".join(f"{v:.2f}" for v in item["q_deg"]),
            " ".join("-0+"[side + 1] for side in item["approach"]) if "approach" in item else "-",
            " ".join(f"{v:.0f}" for v in item["force_N"]) if "force_N" in item else "-",
            " ".join(f"{v:.1f}" for v in item["expected_mm"]),
            item["why"],
            _separated(item),
        )
        for k, item in enumerate(content["next_measurements"])
    ]
    if not rows:
        if is_ambiguous(content):
            return "<p>No pose of the cell would tell more of what is still open.</p>"
        return "<p>Nothing is ambiguous on these rows.</p>"
    head = (
        *("row", "A1 to A6 [deg]", "approach", "load [N]", "expected at [mm]"),
        *("why", "separation of all [sigma]"),
    )
    return table(head, rows)


def _separated(item: dict[str, Any]) -> str:
    ways = item.get("separation_if_sigma", {})
    return "; ".join(f"{value:g} if {name}" for name, value in ways.items()) or "-"
