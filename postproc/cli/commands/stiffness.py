"""``postproc stiffness``: stiffness over the rotation about the tool axis."""

from __future__ import annotations

from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc stiffness holes.csv --cell cell.toml -o stiffness.html
  postproc stiffness part.cls --cell cell.toml --model model.toml --json
""")
@click.argument("source", metavar="INPUT")
@cli.CELL
@cli.option("-o, --output FILE.html", "Write a page with the curves.")
@cli.option("--model MODEL.toml", "Joint stiffness of this model.")
@cli.option("--tags NAME,NAME,...", "Names of tags; default: the key tags.")
@cli.option("--most", "Key tags shown.", click.IntRange(1, 500), default=24)
@cli.option("--step", "Step [deg]; default: the cell's.", cli.NumberRange(0.1, 90.0))
@cli.reading_options
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Show the stiffness index over the rotation about the tool axis, per key tag.

    True stiffness along the tool axis, across the path and across the tool axis, and the paper's
    indices kx, ky, kz, kv beside them. The best rotation is free of collision, with the whole
    stroke of a hole. Exit code 1 if a tag cannot be run at any rotation, or if the file asks for
    what convert refuses.
    """
    from postproc.cell import load_cell
    from postproc.jobs.stiffness import stiffness

    cell, tags = load_cell(options["cell"]), options["tags"]
    found = stiffness(
        cli.read_cam(options["source"], options, cell),
        cell,
        model=options["model"],
        tags=None if tags is None else [name.strip() for name in tags.split(",") if name.strip()],
        step_deg=options["step"],
        most=options["most"],
    )
    session.findings(found.findings)
    if options["output"]:
        found.report(options["output"])
    content = found.document
    session.document(content)
    for tag in content["tags"]:
        best = tag["best"]["axial"]
        value = (
            "cannot be run"
            if best is None
            else (f"axial {best['N_per_mm']:.0f} N/mm at {best['spin_deg']:+.0f} deg")
        )
        several = f"  tool {tag['tool']}" if len(set(found.curves.tools)) > 1 else ""
        session.show(f"{tag['name']:>12}{several}  {value}")
    if content["coaxial"]:
        session.say("the tool axis is axis 6: spin does not change the stiffness")
    return cli.answer(found.good)
