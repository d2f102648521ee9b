"""The page of a plan for a diagnosis: what it will be able to tell, before anything is measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.report.parts import Drawing, Page, RowsView, TagColumn, add_rows, table
from postproc.units import DEG, PERCENT


def diagnosis_plan_page(
    content: dict[str, Any], names: list[str], q: FloatArray, points: FloatArray, drawing: Drawing
) -> bytes:
    """Return the page of a plan; names, q (n, 6) [rad] and points (n, 3) [m] of its readings."""
    shown = [one for one in content["effects"] if _is_told(one)]
    hidden = [one["name"] for one in content["effects"] if not _is_told(one)]
    share = f"{content['power'] / PERCENT:.0f} %"
    lead = [
        f"{content['readings']} readings at {content['postures']} postures tell {len(shown)} of"
        f" {len(content['effects'])} causes where they are of usual size, in {share} of all cases,"
        f" at a noise of {content['sigma_mm']:.3f} mm per axis."
    ]
    promise = content["promise"]
    lead.append(
        f"A model of them will miss fresh readings by {promise['rms_left_mm']:.3f} mm rms, noise"
        " included, on an arm that has nothing but what is in the list."
    )
    if promise["at_the_job_mm"] is not None:
        lead.append(f"At the tags of the job {promise['at_the_job_mm']:.3f} mm rms will be left.")
    if hidden:
        lead.append(f"Of usual size it will not tell: {_words(hidden)}.")
    page = Page("Plan for a diagnosis", lead)
    page.section(f"Smallest gap of each cause that is told in {share}", _told(content), "half")
    page.section("What cannot be told apart", _twins(content), "half")
    page.section("Classes, where no cause of the list is there", _classes(content), "half")
    page.section("Not testable", _missing(content), "half")
    columns = [TagColumn("order", "order", "no.", np.arange(1.0, len(q) + 1.0))]
    columns += [TagColumn(f"a{j + 1}", f"A{j + 1}", "deg", q[:, j] / DEG) for j in range(6)]
    add_rows(page, "Readings", RowsView("reading", names, points, columns, q), drawing)
    return page.render()


def _is_told(one: dict[str, Any]) -> bool:
    return one["smallest_mm"] is not None and one["smallest_mm"] <= one["usual_mm"]


def _words(names: list[str]) -> str:
    return ", ".join(name.replace("_", " ") for name in names)


def _size(value: float | None) -> str:
    return "not by this plan" if value is None else f"{value:.3f}"


def _told(content: dict[str, Any]) -> str:
    rows = [
        (
            one["name"].replace("_", " "),
            _size(one["smallest_mm"]),
            f"{one['usual_mm']:.3f}",
            "yes" if _is_told(one) else "no",
        )
        for one in content["effects"]
    ]
    return table(("cause", "told from [mm rms]", "usual [mm rms]", "told where usual"), rows)


def _twins(content: dict[str, Any]) -> str:
    rows = [
        (_words(pair["effects"][:1]), _words(pair["effects"][1:]), _size(pair["from_mm"]))
        for pair in content["cannot_separate"]
    ]
    if not rows:
        return "<p>All pairs of causes of usual size are told apart.</p>"
    text = "<p>Of usual size these stay one set: either may be named, neither alone.</p>"
    return text + table(("cause", "and", "told apart from [mm rms]"), rows)


def _classes(content: dict[str, Any]) -> str:
    rows = [(one["class"], _size(one["smallest_mm"])) for one in content["classes"]]
    return table(("the gap follows", "told from [mm rms]"), rows)


def _missing(content: dict[str, Any]) -> str:
    rows = [(_words([one["name"]]), ", ".join(one["needs"])) for one in content["not_testable"]]
    if not rows:
        return "<p>All causes of the list are tested.</p>"
    return "<p>The plan does not have what these need.</p>" + table(("cause", "needs"), rows)
