"""``postproc inspect``: what was read from a CAM file, before any robot is involved."""

from __future__ import annotations

from typing import Any

import click

from postproc.cli.common import Session, answer, reading, reading_options, standard_options


@click.command(
    epilog="Example: postproc inspect part.cls --json",
    short_help="What was read from a CAM file, before any robot.",
)
@click.argument("source", metavar="INPUT", type=click.Path())
@click.option("--cell", metavar="CELL.toml", help="Cell whose [import] says how files are read.")
@reading_options
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Show what was read from INPUT: points, arcs, holes, tools, feeds, axes, box, lengths.

    Words that convert would refuse are listed with their lines; nothing is written.
    """
    from postproc.process import looks, word_findings
    from postproc.readers import ReadOptions, read
    from postproc.report.inspection import cell_tables, inspection, text_lines

    given = reading(options)
    if options["cell"]:
        given = _with_habits(given, options["cell"])
    form = given.pop("format") or "auto"
    toolpath = read(options["source"], form, ReadOptions(points_only=True, **given))
    if session.json:
        session.document(inspection(toolpath))
    else:
        for line in text_lines(toolpath):
            session.show(line)
        if tables := cell_tables(toolpath):
            session.show(f"\nfor the cell, to be filled in:\n\n{tables}")
    session.findings(
        [*word_findings(toolpath), *looks(toolpath), *toolpath.warnings, *toolpath.recovered]
    )
    return answer(True)


def _with_habits(given: dict[str, Any], path: str) -> dict[str, Any]:
    """Return the options of a call, those of the cell where the call does not say."""
    from postproc.cell import load_cell
    from postproc.readers import ReadOptions

    habits = load_cell(path).reading
    words = ReadOptions(accept_words=given["accept_words"]).accepted_words
    filled = {key: value or getattr(habits, key, None) for key, value in given.items()}
    return {**filled, "accept_words": (*habits.accept_words, *words)}
