"""``postproc check``: what a cell file is and what is wrong with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from postproc.cli.common import Session, answer, standard_options

if TYPE_CHECKING:
    from postproc.errors import Finding

EPILOG = """\b
Examples:
  postproc check cell.toml
  postproc check cell.toml --json
  postproc check cell.toml --report cell.html
"""


@click.command(epilog=EPILOG)
@click.argument("cell", metavar="CELL.toml")
@click.option("--report", metavar="FILE.html", help="Write a page that draws the cell.")
@standard_options
def command(session: Session, /, cell: str, report: str | None) -> int:
    """Load a cell, say what it is and what is wrong with it.

    Errors make the exit code 1: home in collision, a tool heavier than the payload, an objective
    that cannot work. Warnings and notes do not.
    """
    from postproc.cell import load_cell
    from postproc.jobs.check_cell import check_cell

    checked = check_cell(load_cell(cell))
    if report:
        from pathlib import Path

        from postproc.files import write_files
        from postproc.jobs.pages import page_of_cell

        write_files({Path(report): page_of_cell(checked)})
    findings = [_entry(finding) for finding in checked.findings]
    session.document(
        {"schema": "postproc.check/1", "ok": checked.is_good, **checked.facts, "findings": findings}
    )
    session.show(_summary(checked.facts))
    session.findings(checked.findings)
    return answer(checked.is_good)


def _entry(finding: Finding) -> dict[str, Any]:
    return {
        "severity": str(finding.severity),
        "code": finding.code,
        "line": finding.source.line if finding.source else None,
        "text": finding.message,
    }


def _summary(facts: dict[str, Any]) -> str:
    tool, part = facts["tool"], facts["workpiece"]
    stiffness = facts["joint_stiffness_Nmm_per_rad"]
    along = ", ".join(part["reachable_along"]) or "nothing"
    lines = [
        f"cell       {facts['name']}",
        f"robot      {facts['robot']}"
        + ("" if facts["closed_form"] else ", inverse kinematics numeric"),
        f"tool       {tool['number']} {tool['name']}: {_place(tool)}, axis {tool['axis']}, "
        + ("mass unknown" if tool["mass_kg"] is None else f"{tool['mass_kg']:g} kg")
        + f", {_count(tool['solids'])}",
        f"workpiece  {part['number']}: {_place(part)}, {_count(part['solids'])}; "
        f"origin reachable with the tool along {along}",
        f"obstacles  {', '.join(facts['obstacles']) or 'none'}",
        "stiffness  " + (" ".join(f"{k:g}" for k in stiffness) if stiffness else "none"),
    ]
    if facts["external_axes"]:
        lines.append(f"external   {', '.join(facts['external_axes'])}")
    return "\n".join(lines)


def _place(frame: dict[str, Any]) -> str:
    xyz = " ".join(f"{value:g}" for value in frame["xyz_mm"])
    abc = " ".join(f"{value:g}" for value in frame["abc_deg"])
    return f"X Y Z {xyz} mm, A B C {abc} deg"


def _count(solids: int) -> str:
    return "1 solid" if solids == 1 else f"{solids} solids"
