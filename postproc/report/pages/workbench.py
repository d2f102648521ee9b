"""The page of the workbench: a program's, with a map to edit, a job tree, the part's place."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.model import Plan
from postproc.planning import SpinClass, SpinMap, TagPose
from postproc.report.pages.program import motion_sections
from postproc.report.parts import CLASS_COLOURS, CLASS_WORDS, Page, escape, packed
from postproc.units import DEG, MM, N_PER_MM


def workbench_page(cell: str, source: str) -> bytes:
    """Return the page without a plan, which it asks for; by the names of cell and input."""
    page = Page(f"{source} in {cell}", ["", ""])
    page.script = "workbench.js"
    page.data |= {
        "colours": [CLASS_COLOURS[kind] for kind in SpinClass],
        "words": [CLASS_WORDS[kind] for kind in SpinClass],
    }
    page.section("Plan", _STATUS_HTML)
    page.section("Spin about the tool axis by tag", _MAP_HTML, "wide")
    page.section("Job", '<div class="scroll" id="tree"></div>', "third")
    motion_sections(page, [], "Tags", spins=True)
    page.section("Place of part, tool, fixture", _PLACE_HTML, "half")
    page.findings([])
    return page.render()


def map_data(spins: SpinMap) -> dict[str, Any]:
    """Return a map over the spin for the page's script; spins in degrees."""
    return {
        "spins": np.round(spins.spins / DEG, 6).tolist(),
        "classes": packed(spins.classes, "uint8"),
        "stiffness": packed(spins.stiffness / N_PER_MM),
    }


def pose_answer(pose: TagPose) -> dict[str, Any]:
    """Return a pose of a tag in numbers of files and in words."""
    numbers = {
        "margin_deg": pose.margin / DEG,
        "wrist_deg": pose.wrist / DEG,
        "clearance_mm": pose.clearance / MM,
        "stiffness_N_per_mm": pose.stiffness / N_PER_MM,
    }
    return {
        "class": int(pose.kind),
        "words": CLASS_WORDS[pose.kind] + (f": {' hits '.join(pose.pair)}" if pose.pair else ""),
        "free": pose.kind is SpinClass.FREE,
        "q": None if pose.q is None else pose.q.tolist(),
        "pair": list(pose.pair),
        "point": None if pose.point is None else pose.point.tolist(),
        "turned": pose.turned,
        "frames": [pose.tool, pose.base],
        **{key: round(v, 3) if np.isfinite(v) else None for key, v in numbers.items()},
    }


def reach_data(kind: IntArray, stiffness: FloatArray) -> dict[str, Any]:
    """Return classes (n,) and stiffness (n,) [N/m] of tags, and how many there are of each."""
    counts = np.bincount(kind, minlength=len(SpinClass)).tolist()
    return {
        "classes": packed(kind, "uint8"),
        "stiffness": packed(stiffness / N_PER_MM),
        "words": ", ".join(
            f"{counts[kind]} {CLASS_WORDS[kind]}" for kind in SpinClass if counts[kind]
        ),
    }


def around_data(made: Plan, tags: IndexArray) -> dict[str, Any]:
    """Return a plan of a few tags: which, their spin [deg], whether they stand, and in words."""
    bad = {f.tag_index for f in made.errors if f.tag_index is not None}
    spin = dict(zip(made.tag.tolist(), (made.spin / DEG).tolist(), strict=True))
    first = next((finding.message for finding in made.errors), "")
    count = len(tags) - len(bad)
    return {
        "tags": tags.tolist(),
        "spin_deg": [
            None if k in bad or not np.isfinite(spin.get(k, np.nan)) else round(spin[k], 6)
            for k in range(len(tags))
        ],
        "good": not made.errors,
        "words": first or f"{count} tags around are planned anew; the whole job follows",
    }


def page_json(data: dict[str, Any]) -> bytes:
    """Return data of a page as JSON."""
    return json.dumps(data, allow_nan=False).encode()


def _button(name: str, text: str, title: str) -> str:
    return f'<button id="{name}" title="{escape(title)}">{text}</button>'


_STATUS_HTML = (
    '<div class="bar">'
    + _button("undo", "undo", "Ctrl+Z")
    + _button("redo", "redo", "Ctrl+Y")
    + _button("save", "save", "write pins and cell beside the cell file")
    + _button("reload", "reload", "read cell and input again")
    + _button("why", "why", "why tags fail, and the least that cures it")
    + '<progress id="progress" max="1"></progress><span id="doing" role="status"></span></div>'
    '<p id="error" class="bad" role="alert"></p><p id="saved"></p>'
    '<div id="causes"></div>'
)
_MAP_HTML = (
    '<canvas id="map" height="300" tabindex="0" aria-label="spin by tag: arrows move, Enter pins">'
    '</canvas><div class="bar"><label>tag <input id="find" size="12" list="names"></label>'
    '<datalist id="names"></datalist>'
    '<label>spin <input id="spin_deg" type="number" step="1" min="-360" max="360"> deg</label>'
    + _button("pin", "pin", "Enter")
    + _button("unpin", "unpin", "Delete")
    + _button("all", "whole job", "0")
    + '<span id="legend_map"></span></div><p id="pose" class="soft" role="status">drag the '
    "line of a tag; the wheel zooms</p>"
)
_PLACE_HTML = (
    '<div class="bar"><label>move <select id="thing"></select></label>'
    + _button("turn", "turn", "the handle in the 3D view moves or turns")
    + "".join(
        f'<label>{name} <input class="place" type="number" step="{step}" size="7"></label>'
        for name, step in (("X", 10), ("Y", 10), ("Z", 10), ("A", 1), ("B", 1), ("C", 1))
    )
    + _button("move", "plan here", "plan with the part at this place")
    + _button("back", "back", "the place of the plan")
    + _button("place", "best place", "look for the best place of the part, and move it there")
    + '<a id="places" href="place" target="_blank" rel="noopener" hidden>how good each place is</a>'
    + '</div><p id="reach" class="soft" role="status">mm and deg as the cell file has them: parts '
    "in the robot root, tools on the flange, fixtures in the world; the handle in the 3D view does "
    "the same</p>"
)
