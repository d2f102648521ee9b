"""The certificate on the page of a diagnosis: what a metrologist reads before signing."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.measurement import Remark
from postproc.report.parts import Page, Series, escape, line_chart, table

_STATED = {
    "instrument": "instrument",
    "serial": "serial number",
    "calibrated": "calibration",
    "operator": "measured by",
    "date": "date of the measurement",
}
_MOST_ROWS = 40


def add_certificate(page: Page, content: dict[str, Any]) -> None:
    """Add the certificate of a diagnosis' document to a page."""
    told = content["certificate"]
    page.section("Certificate: subject and instrument", _subject(told), "half")
    page.section("Certificate: conditions", _conditions(told), "half")
    page.section("Certificate: rows", _rows(content), "half")
    page.section("Certificate: uncertainty and validity", _uncertainty(content), "half")
    page.section("Certificate: held-out rows, before and after", _held(told["held_out"]), "half")
    page.section("Certificate: ISO 9283", _iso(told["iso9283"]), "half")
    page.section("Certificate: signatures", _signatures(told["stated"]), "half")


def _subject(told: dict[str, Any]) -> str:
    rows = [("robot", told["robot"]), ("tool", told["tool"])]
    rows += [(words, told["stated"].get(key, "not stated")) for key, words in _STATED.items()]
    return table(("", ""), rows)


def _conditions(told: dict[str, Any]) -> str:
    rows = [(c["name"], f"{c['from']:g}", f"{c['to']:g}") for c in told["conditions"]]
    if not rows:
        return "<p>No condition was logged.</p>"
    return table(("logged", "from", "to"), rows)


def _rows(content: dict[str, Any]) -> str:
    rows = content["certificate"]["rows"]
    text = f"<p>{rows['used']} of {rows['total']} rows are used.</p>"
    said = [Remark(**item).line() for item in content["remarks"]]
    text += "".join(f"<p>{escape(line)}</p>" for line in said)
    gone = rows["not_used"]
    if not gone:
        return text
    shown = [(item["id"], f"{item['off_mm']:.3f}") for item in gone[:_MOST_ROWS]]
    more = f"<p>And {len(gone) - _MOST_ROWS} more.</p>" if len(gone) > _MOST_ROWS else ""
    return text + table(("not used: a measuring fault", "off [mm]"), shown) + more


def _uncertainty(content: dict[str, Any]) -> str:
    told = content["certificate"]
    sure, valid = told["uncertainty"], told["validity"]
    reading = sure["reading_mm"]
    known = "not known" if reading is None else f"{reading:.4f} mm"
    rows = [
        ("of a reading, per axis", known),
        (
            "of the tool point by the model, per axis, on rows held out",
            f"{sure['model_mm']:.4f} mm",
        ),
    ]
    joints = [
        (f"A{k}", f"{low:.2f}", f"{high:.2f}")
        for k, (low, high) in enumerate(valid["joints_deg"], start=1)
    ]
    low, high = valid["box_mm"]
    box = [(axis, f"{low[k]:.1f}", f"{high[k]:.1f}") for k, axis in enumerate("xyz")]
    return (
        table((f"expanded uncertainty, k = {sure['k']:g}", ""), rows)
        + "<p>Valid where the rows were taken; nothing is shown outside.</p>"
        + table(("joint", "from [deg]", "to [deg]"), joints)
        + table(("tool point", "from [mm]", "to [mm]"), box)
    )


def _iso(told: dict[str, Any]) -> str:
    if not told["poses"]:
        return (
            "<p>No pose was read often enough from one side and under one load to tell its"
            " repeatability.</p>"
        )
    rows = [
        (item["pose"], item["readings"], f"{item['ap_mm']:.4f}", f"{item['rp_mm']:.4f}")
        for item in told["poses"][:_MOST_ROWS]
    ]
    fewest = min(item["readings"] for item in told["poses"])
    text = (
        "" if fewest >= 30 else f"<p>From {fewest} readings of a pose on; ISO 9283 asks for 30.</p>"
    )
    drift = told["drift_ap_mm"]
    late = "" if drift is None else f"<p>Largest change of a pose's accuracy: {drift:.4f} mm.</p>"
    return text + table(("pose, first row", "readings", "AP [mm]", "RP [mm]"), rows) + late


def _held(told: dict[str, Any]) -> str:
    edges = np.array(told["edges_mm"])
    middle = 0.5 * (edges[1:] + edges[:-1])
    lines = [
        Series(name, middle, np.array(told[name], dtype=np.float64)) for name in ("before", "after")
    ]
    rows = [
        (name, f"{told['rms_mm'][k]:.4f}", f"{told['p95_mm'][k]:.4f}")
        for k, name in enumerate(("before", "after"))
    ]
    text = f"<p>Each of {told['rows']} rows by fits that have not seen its place or its time.</p>"
    chart = line_chart(lines, "distance from the simulated point [mm]", "rows")
    return text + chart + table(("", "rms [mm]", "95 % within [mm]"), rows)


def _signatures(stated: dict[str, str]) -> str:
    rows = [("measured by", escape(stated.get("operator", "")), "", ""), ("checked by", "", "", "")]
    return table(("", "name", "date", "signature"), rows)
