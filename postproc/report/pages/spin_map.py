"""The page of a spin map: the picture, what is under the pointer, the tags that need care."""

from __future__ import annotations

import base64

import numpy as np

from postproc.planning import CLOSE, NEAR, Grade, SpinClass, SpinMap
from postproc.report.parts import CLASS_WORDS, Page, Picture, draw, first_rows, packed, table
from postproc.units import DEG, N_PER_MM, PERCENT

_MOST_ROWS = 500
_COSTLY = 5.0 * PERCENT
"""Tags that lose more stiffness than this against their best free spin are listed."""


def spin_map_page(spins: SpinMap, cell_name: str) -> bytes:
    """Return the page of a map as one self-contained HTML file."""
    picture = draw(spins)
    page = Page(f"Spin map of {spins.plan.name}: {cell_name}", _lead(spins, picture))
    page.script = "spin_map.js"
    page.data |= _data(spins, picture)
    code = base64.b64encode(picture.png).decode("ascii")
    page.section(
        "Spin about the tool axis by tag",
        f'<img id="map" alt="spin map" style="max-width:100%;height:auto" '
        f'width="{picture.size[0]}" height="{picture.size[1]}" src="data:image/png;base64,{code}">'
        '<p id="under" class="soft">point at a cell to read it</p>',
    )
    page.section("Cells", _cells(spins), "half")
    page.section("Tags", _grades(spins), "half")
    page.section("Tags that need care", _care(spins))
    return page.render()


def _lead(spins: SpinMap, picture: Picture) -> list[str]:
    n = len(spins)
    blocked = int((spins.classes != SpinClass.FREE).all(axis=1).sum())
    through = spins.spins[(spins.classes == SpinClass.FREE).all(axis=0)] / DEG
    lead = [f"{blocked} of {n} tags have no free spin." if blocked else f"All {n} tags can be run."]
    if len(through):
        names = ", ".join(f"{value:+.0f}" for value in through.tolist())
        lead.append(f"Free at every tag, in some posture: {names} deg.")
    elif not blocked:
        lead.append("No single spin is free at every tag.")
    size = int(picture.columns.last[0] - picture.columns.first[0]) + 1
    if size > 1:
        lead.append(
            f"{len(picture.columns)} columns of {size} tags each: a column shows the hardest class "
            "and the least stiffness of its tags. The CSV has every tag."
        )
    lead.append(
        "A cell is checked in every posture, strokes included; motions between tags are not part "
        "of it. The stiffness is that of the best free posture along the objective."
    )
    return lead


def _data(spins: SpinMap, picture: Picture) -> dict[str, object]:
    columns, path = picture.columns, spins.plan.toolpath
    return {
        "box": list(picture.box),
        "width": picture.size[0],
        "spins": [float(v) for v in np.round(spins.spins / DEG, 6)],
        "words": [CLASS_WORDS[kind] for kind in SpinClass],
        "names": [
            [path.tag_name(int(a)), path.tag_name(int(b))]
            for a, b in zip(columns.first, columns.last, strict=True)
        ],
        "lines": packed(path.line[columns.first], "int32"),
        "classes": packed(columns.classes, "uint8"),
        "stiffness": packed(columns.stiffness / N_PER_MM),
        "chosen": packed(columns.low / DEG),
    }


def _cells(spins: SpinMap) -> str:
    count = np.bincount(spins.classes.ravel(), minlength=len(SpinClass))
    rows = [
        (CLASS_WORDS[kind], int(count[kind]), f"{100.0 * count[kind] / count.sum():.1f} %")
        for kind in SpinClass
    ]
    return table(("class", "cells", "share"), rows)


def _grades(spins: SpinMap) -> str:
    count = np.bincount(spins.grade, minlength=len(Grade))
    near, close = f"{NEAR / DEG:.0f} deg", f"{CLOSE / DEG:.0f} deg"
    words = {
        Grade.GOOD: f"{near} or more",
        Grade.ACCEPTABLE: f"less than {near}",
        Grade.CRITICAL: f"less than {close}",
        Grade.INVALID: "cannot be run",
    }
    rows = [(grade.name.lower(), int(count[grade]), words[grade]) for grade in Grade]
    head = ("class", "tags", "distance beyond the margins")
    return (
        table(head, rows) + "<p>of every joint from its limit, and of the wrist from straight</p>"
    )


def _care(spins: SpinMap) -> str:
    path, loss = spins.plan.toolpath, spins.loss
    costly = np.nan_to_num(loss) > _COSTLY
    tags = np.flatnonzero((spins.grade != Grade.GOOD) | costly)
    order = np.lexsort((tags, -np.nan_to_num(loss[tags]), -spins.grade[tags]))
    free = (spins.classes == SpinClass.FREE).sum(axis=1)
    rows = []
    for tag in tags[order][:_MOST_ROWS].tolist():
        filled = np.nan_to_num(spins.stiffness[tag], nan=-1.0)
        best = spins.spins[int(filled.argmax())] / DEG if filled.max() > 0.0 else np.nan
        rows.append(
            (
                path.tag_name(tag),
                int(path.line[tag]),
                Grade(int(spins.grade[tag])).name.lower(),
                int(free[tag]),
                _number(spins.chosen[tag] / DEG, "+.1f"),
                _number(best, "+.0f"),
                _number(100.0 * loss[tag], ".1f"),
            )
        )
    if not rows:
        return '<p class="good">none</p>'
    head = ("tag", "CAM line", "class", "free spins", "chosen [deg]", "stiffest free [deg]")
    return first_rows((*head, "loss [%]"), rows, len(tags) - len(rows), "; the CSV has every tag")


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"
