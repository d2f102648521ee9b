"""``postproc inspect``: what was read from a CAM file, before any robot is involved."""

from __future__ import annotations

from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc inspect part.cls --json
""")
@click.argument("source", metavar="INPUT", type=click.Path())
@cli.option("--cell CELL.toml", "Cell whose [import] says how files are read.")
@cli.reading_options
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Show what was read from INPUT: points, arcs, holes, tools, feeds, axes, box, lengths.

    Words that convert would refuse are listed with their lines; nothing is written.
    """
    from postproc.jobs.inspect import inspect

    found = inspect(options["source"], options["cell"], **cli.reading(options))
    if session.json:
        session.document(found.document)
    else:
        for line in found.summary:
            session.show(line)
    session.findings(found.findings)
    return cli.answer(True)
