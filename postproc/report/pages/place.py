"""The page of a search for the best place: how good each place is, and the cell at the best."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import apply, inverse
from postproc.planning import Rank
from postproc.report.parts import Drawing, Page, RowsView, TagColumn, add_rows
from postproc.units import DEG, MM, N_PER_MM, PERCENT

_Point = tuple[float, float, float, float]


def place_page(
    drawing: Drawing,
    q: FloatArray,
    reach: Mapping[_Point, float],
    ranked: Mapping[_Point, Rank],
    document: Mapping[str, Any],
) -> bytes:
    """Return the page of ``postproc.place/1`` as one self-contained HTML file.

    ``q`` (6,) [rad]: how the arm stands in the cell with the best place; ``reach``: share of the
    tags in reach at each place X, Y, Z [mm], turn [deg]; ``ranked``: those tried with solids.
    """
    best = max(ranked.values(), key=lambda rank: rank.key, default=None)
    order = sorted(reach, key=lambda at: (ranked[at].key if at in ranked else (), reach[at]))
    points = np.array(order[::-1])
    ranks = [ranked.get(at) for at in order[::-1]]
    known = {
        "free": ("can be run", "%", [r and r.free / PERCENT for r in ranks]),
        "stiffness": ("stiffness", "N/mm", [r and r.stiffness / N_PER_MM for r in ranks]),
        "clearance": ("clearance", "mm", [r and r.clearance / MM for r in ranks]),
        "margin": ("margin", "deg", [r and r.margin / DEG for r in ranks]),
    }
    share = np.array([reach[at] for at in order[::-1]]) / PERCENT
    columns = [
        TagColumn("reach", "in reach", "%", share, "low"),
        *(
            TagColumn(key, label, unit, np.array(values, dtype=np.float64), "low")
            for key, (label, unit, values) in known.items()
        ),
        TagColumn("turn", "turn", "deg", points[:, 3]),
    ]
    part = document["move"] == "part"
    places = points[:, :3] * MM
    if not part:
        places = apply(inverse(drawing.cell.robot.T_world_robroot), places)
    names = [" ".join(f"{v:g}" for v in at[:3]) for at in points.tolist()]
    page = Page(f"Place in {drawing.cell.name}", _lead(document, best), good=document["good"])
    rows = np.tile(q, (len(points), 1))
    view = RowsView("place", names, places, columns, rows)
    add_rows(page, "How good each place is", view, drawing, with_part=True)
    return page.render()


def _lead(document: Mapping[str, Any], best: Rank | None) -> list[str]:
    """Return the sentences that the page leads with, the verdict first."""
    xyz, abc = (" ".join(f"{v:g}" for v in document["frame"][k]) for k in ("xyz_mm", "abc_deg"))
    stiff, clear, searched = (
        document[key] for key in ("stiffness_mean_N_per_mm", "clearance_mm", "searched")
    )
    told = "" if clear is None else f" Smallest clearance {clear:.1f} mm."
    told += "" if best is None else f" Margin beyond the cell's {best.margin / DEG:.1f} deg."
    told += "" if stiff is None else f" Mean stiffness {stiff:.0f} N/mm."
    good = document["good"]
    head = "Good, as the full plan proves:" if good else "No good place was found: at the best one"
    counts = f"{document['tags_good']} of {document['tags']} tags can be run"
    return [
        f"{head} {counts} with the {document['move']} at X Y Z {xyz} mm, A B C {abc} deg.{told}",
        f"{searched['places']} places looked at, {searched['in_reach']} of them within reach; "
        f"{searched['with_solids']} tried with solids, {searched['plans']} planned in full.",
    ]
