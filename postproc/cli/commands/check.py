"""``postproc check``: what a cell file is and what is wrong with it."""

from __future__ import annotations

from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc check cell.toml
  postproc check cell.toml --json
  postproc check cell.toml --report cell.html
  postproc check cell.toml --backup ARCHIVE.zip
""")
@click.argument("cell", metavar="CELL.toml")
@cli.option("--report FILE.html", "Write a page that draws the cell.")
@cli.option("--backup ARCHIVE", "Backup of the controller to compare with: ZIP or folder.")
@cli.option("--templates", "Test the cell's own templates without a part.")
def command(
    session: cli.Session, /, cell: str, report: str | None, backup: str | None, templates: bool
) -> int:
    """Load a cell, say what it is and what is wrong with it.

    Errors make the exit code 1: home in collision, a tool heavier than the payload, an objective
    that cannot work, with --backup a number that is another one on the controller. Warnings and
    notes do not.
    """
    from postproc.cell import load_cell
    from postproc.jobs.check_cell import check

    found = check(load_cell(cell), backup=backup, templates=templates)
    if report:
        found.report(report)
    session.document(found.document)
    session.show(_summary(found.facts))
    if backup:
        counted = found.document["backup"]
        counts = (
            f"{counted['compared']} numbers compared, {len(counted['differences'])} differences"
        )
        session.show(f"backup     {counts}")
    session.findings(found.findings)
    return cli.answer(found.good)


def _summary(facts: dict[str, Any]) -> str:
    stiffness = facts["joint_stiffness_Nmm_per_rad"]
    lines = [
        f"cell       {facts['name']}",
        f"robot      {facts['robot']}"
        + ("" if facts["closed_form"] else ", inverse kinematics numeric"),
        *map(_tool, facts["tools"]),
        *map(_base, facts["bases"]),
        f"obstacles  {', '.join(facts['obstacles']) or 'none'}",
        "stiffness  " + (" ".join(f"{k:g}" for k in stiffness) if stiffness else "none"),
    ]
    if facts["external_axes"]:
        lines.append(f"external   {', '.join(facts['external_axes'])}")
    return "\n".join(lines)


def _tool(tool: dict[str, Any]) -> str:
    mass = "mass unknown" if tool["mass_kg"] is None else f"{tool['mass_kg']:g} kg"
    name = f"{tool['number']} {tool['name']}"
    return f"tool       {name}: {_place(tool)}, axis {tool['axis']}, {mass}, {_count(tool)}"


def _base(base: dict[str, Any]) -> str:
    name = f"{base['number']} {base['name']}".strip()
    along = ", ".join(base["reachable_along"]) or "nothing"
    return (
        f"workpiece  {name}: {_place(base)}, {_count(base)}; "
        f"origin reachable with the tool along {along}"
    )


def _place(frame: dict[str, Any]) -> str:
    xyz = " ".join(f"{value:g}" for value in frame["xyz_mm"])
    abc = " ".join(f"{value:g}" for value in frame["abc_deg"])
    return f"X Y Z {xyz} mm, A B C {abc} deg"


def _count(entry: dict[str, Any]) -> str:
    return "1 solid" if entry["solids"] == 1 else f"{entry['solids']} solids"
