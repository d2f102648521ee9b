"""The page of a recorded path: where it errs first, then which effect, then how far it shrinks."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.report.parts import Page, Series, escape, line_chart, shaded_view, table
from postproc.trace import PathDiagnosis, summary
from postproc.units import DEG, MM

_MOST_POINTS = 1500
_MOST_DOTS = 1200


def trace_page(found: PathDiagnosis, content: dict[str, Any]) -> bytes:
    """Return the page of the answer to a recording, with its document."""
    lines = summary(content)
    page = Page(f"Gap along the path: {content['verdict'].replace('_', ' ')}", [lines[0]])
    page.section("Path, the worse the darker", _path(found), "half")
    phases = content["where"]["phases"]
    head = ("phase", "share", "rms [mm]", "off the path [mm]", "left [mm]")
    rows = [
        (
            row["phase"],
            f"{row['share']:.0%}",
            *(f"{row[k]:.4f}" for k in ("rms_mm", "contour_rms_mm", "left_rms_mm")),
        )
        for row in phases
    ]
    page.section("Where: phases", table(head, rows), "half")
    page.section("ISO 9283", _iso(content["iso9283"]), "half")
    words = "".join(f"<p>{escape(line)}</p>" for line in lines)
    page.section("In words", words)
    page.section("Effects, on rows that were not fitted", _effects(content))
    page.section("Gap before and after", _before_after(found), "half")
    page.section("Spectrum of the gap", _spectrum(found), "half")
    if content["where"]["lines"]:
        worst = [
            (r["line"], f"{r['rms_mm']:.4f}", f"{r['max_mm']:.4f}", f"{r['contour_max_mm']:.4f}")
            for r in content["where"]["lines"]
        ]
        page.section("Worst lines", table(("line", "rms [mm]", "max [mm]", "off [mm]"), worst))
    for stage in found.stages:
        if stage.in_joints:
            for joint, row in enumerate(stage.gap):
                page.section(f"A{joint + 1}, {stage.name}", _axis(found, row), "half")
    if "torque" in content:
        heads = list(content["torque"]["joints"][0]) if content["torque"]["joints"] else ["joint"]
        torque = [[*map(str, row.values())] for row in content["torque"]["joints"]]
        page.section("Torque of the joints, beside rigid links", table(heads, torque))
    if content["unexplained"]:
        rest = [(r["class"], r["of"], f"{r['rms_mm']:.4f}") for r in content["unexplained"]]
        page.section("What the rest follows", table(("class", "of", "rms [mm]"), rest))
    return page.render()


def _iso(told: dict[str, Any]) -> str:
    names = (("AT_p_mm", "AT_p, mean of the runs off the path"), ("RT_p_mm", "RT_p, the runs"))
    rows = [(name, f"{told[key]:.4f}") for key, name in names if told[key] is not None]
    for row in told.get("corners", ()):
        rows.append((f"CR, line {row['line']}", f"{row['CR_mm']:.4f}"))
        rows.append((f"CO, line {row['line']}", f"{row['CO_mm']:.4f}"))
    few = f"{told['runs']} of the {told['runs_of_the_standard']} runs that the standard asks for"
    return table(("figure", "mm"), rows) + f"<p>{few}</p>"


def _some(count: int, most: int) -> slice:
    return slice(None, None, max(1, count // most))


def _path(found: PathDiagnosis) -> str:
    some = _some(len(found.contour), _MOST_DOTS)
    size = found.contour[some] / MM
    titles = [f"{v:.4f} mm off the path" for v in size]
    return shaded_view(found.scene.points[some] / MM, size, titles)


def _effects(content: dict[str, Any]) -> str:
    rows = [
        (
            row["name"],
            row["stage"],
            f"{row['probability']:.3f}",
            "yes" if row["adopted"] else "no",
            f"{row['rms_before_mm']:.4f}",
            f"{row['rms_after_mm']:.4f}",
            f"{row['shrinkage']:.0%}",
            ", ".join(f"{key} {value}" for key, value in row["parameters"].items()),
            row["action"],
        )
        for row in content["effects"]
    ]
    head = ("effect", "stage", "probability", "adopted", "before [mm]", "after [mm]", "shrinks by")
    return table((*head, "parameters", "what to do"), rows)


def _before_after(found: PathDiagnosis) -> str:
    some = _some(len(found.gap), _MOST_POINTS)
    time = np.arange(len(found.gap))[some].astype(np.float64)
    sizes = [np.linalg.norm(v, axis=1)[some] / MM for v in (found.gap, found.rest)]
    series = [Series(n, time, s) for n, s in zip(("gap", "left"), sizes, strict=True)]
    return line_chart(series, "row", "mm")


def _spectrum(found: PathDiagnosis) -> str:
    rows = max(found.scene.stretches, key=lambda part: part.stop - part.start)
    cycle = max(found.recording.cycle, 1e-6)
    charts = []
    for name, values in (("gap", found.gap[rows]), ("left", found.rest[rows])):
        centred = (values - values.mean(axis=0)) * np.hanning(len(values))[:, None]
        power = np.abs(np.fft.rfft(centred, axis=0)) * 4.0 / len(values)
        size = np.asarray(np.linalg.norm(power, axis=1) / MM, dtype=np.float64)
        some = _some(len(size), _MOST_POINTS)
        hertz = np.asarray(np.fft.rfftfreq(len(values), cycle)[some], dtype=np.float64)
        charts.append(Series(name, hertz, size[some]))
    return line_chart(charts, "Hz", "mm")


def _axis(found: PathDiagnosis, row: FloatArray) -> str:
    some = _some(len(row), _MOST_POINTS)
    time = np.arange(len(row))[some].astype(np.float64)
    return line_chart([Series("difference", time, row[some] / DEG)], "row", "deg")
