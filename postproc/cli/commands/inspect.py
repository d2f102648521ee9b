"""``postproc inspect``: what was read from a CAM file, before any robot is involved."""

from __future__ import annotations

from dataclasses import replace

import click

from postproc.cli.common import Session, answer, standard_options


@click.command(
    epilog="Example: postproc inspect part.cls --json",
    short_help="What was read from a CAM file, before any robot.",
)
@click.argument("source", metavar="INPUT", type=click.Path())
@click.option("--format", "format_", default="auto", show_default=True,
              help="auto, apt, csv or delmia.")  # fmt: skip
@click.option("--units", type=click.Choice(["mm", "inch", "m"]),
              help="Unit of length where the file does not say.")  # fmt: skip
@click.option("--dialect", help="APT dialect: nx, solidworks, creo, catia, camworks, apt.")
@click.option("--columns", help="Columns of a CSV file in order, such as id,x,y,z,a,b,c; - = none.")
@click.option("--task", help="DELMIA task to read instead of all that no other one calls.")
@click.option(
    "--cycle-words",
    metavar="WORDS",
    help="Meaning of the numbers of a positional drill cycle, such as depth,clearance,feed.",
)
@click.option("--recover", is_flag=True, help="Fix what has one possible meaning and list it.")
@standard_options
def command(
    session: Session,
    source: str,
    format_: str,
    units: str | None,
    dialect: str | None,
    columns: str | None,
    task: str | None,
    cycle_words: str | None,
    recover: bool,
) -> int:
    """Show what was read from INPUT: points, arcs, holes, tools, feeds, axes, box, lengths.

    Words that the reader does not know are listed with their count; nothing is written.
    """
    from postproc.readers import ReadOptions, read
    from postproc.report.inspection import inspection, text_lines

    options = ReadOptions(
        units=units,
        dialect=dialect,
        columns=columns,
        task=task,
        recover=recover,
        points_only=True,
    )
    if cycle_words is not None:
        options = replace(options, cycle_words=tuple(cycle_words.split(",")))
    toolpath = read(source, format_, options)
    if session.json:
        session.document(inspection(toolpath))
    else:
        for line in text_lines(toolpath):
            session.show(line)
    session.findings([*toolpath.warnings, *toolpath.recovered])
    return answer(True)
