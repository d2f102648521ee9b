"""``postproc new-cell``: write a commented cell file."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from postproc.cli import completion
from postproc.cli.common import NUMBER, Session, answer, standard_options
from postproc.cli.questions import AXES, STARTS, ask
from postproc.errors import CellError, UsageError

EPILOG = """\b
Examples:
  postproc new-cell -o cell.toml --robot kuka_kr500_r2830 --tool-xyz 107 0 362 --tool-axis +x
  postproc new-cell --backup ARCHIVE.zip -o cell.toml
  postproc new-cell --urdf kuka_quantec_support --tip tool0 -o cell.toml
  postproc new-cell -o cell.toml --robot kuka_kr500_r2830 --tool-xyz 107 0 362 --tool-axis +x \\
      --input part.cls --tool-number 7 --base-number 3 --home 0 -90 90 0 45 0 --feed 600 \\
      --spindle program --spindle-rpm 3000
  postproc new-cell -o cell.toml
  postproc new-cell --keys
"""
_TRIPLE = (NUMBER, NUMBER, NUMBER)
_SIX = (NUMBER,) * 6


class _NewCell(click.Command):
    """Takes ``--home none`` beside six numbers."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        at = args.index("--home") if "--home" in args else len(args)
        if args[at + 1 : at + 2] == ["none"]:
            args = [*args[:at], "--no-home", *args[at + 2 :]]
        return super().parse_args(ctx, args)


@click.command(cls=_NewCell, epilog=EPILOG)
@click.option("-o", "--output", metavar="CELL.toml", help="File to write.")
@click.option(
    "--robot",
    metavar="NAME",
    shell_complete=completion.robots,
    help="Built-in robot, see postproc robots.",
)
@click.option("--backup", metavar="ARCHIVE", help="Backup of a KRC controller: ZIP or folder.")
@click.option("--urdf", metavar="FILE", help="URDF or xacro file, or a folder with one robot.")
@click.option("--tip", metavar="LINK", help="Flange link of the URDF.")
@click.option("--name", help="Name of the cell; default: that of the file.")
@click.option("--tool-xyz", type=_TRIPLE, metavar="X Y Z", help="TCP in the flange [mm].")
@click.option("--tool-abc", type=_TRIPLE, metavar="A B C", help="Rotation of the TCP frame [deg].")
@click.option("--tool-axis", type=click.Choice(AXES), help="TCP axis that points into the part.")
@click.option("--tool-mass", type=NUMBER, metavar="KG", help="Mass of the tool [kg].")
@click.option("--tool-number", type=int, metavar="N", help="TOOL number; default: 1.")
@click.option(
    "--tool-mesh", multiple=True, metavar="FILE", help="Solid of the tool, in the flange."
)
@click.option("--workpiece-xyz", type=_TRIPLE, metavar="X Y Z", help="CAM origin in robroot [mm].")
@click.option("--workpiece-abc", type=_TRIPLE, metavar="A B C", help="Rotation of CAM axes [deg].")
@click.option("--base-number", type=int, metavar="N", help="BASE number; default: 1.")
@click.option(
    "--workpiece-mesh", multiple=True, metavar="FILE", help="Solid of the part, in CAM coordinates."
)
@click.option(
    "--home",
    type=_SIX,
    metavar="A1 .. A6|none",
    help="Posture to begin and end in [deg]; default: a clear one is proposed.",
)
@click.option("--no-home", is_flag=True, hidden=True)
@click.option("--spindle", type=click.Choice(STARTS), help="Who starts the spindle.")
@click.option(
    "--spindle-rpm",
    type=NUMBER,
    metavar="1/MIN",
    help="Speed that the program starts it with where the CAM file gives none.",
)
@click.option("--feed", type=NUMBER, metavar="MM/MIN", help="Feed where the CAM file gives none.")
@click.option(
    "--input",
    metavar="INPUT",
    help="CAM file: propose a place of the workpiece where the arm reaches all of it.",
)
@click.option("--units", type=click.Choice(["mm", "inch", "m"]), help="Of the CAM file.")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--keys", is_flag=True, help="Print the reference of all keys instead.")
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Write a cell file with every key, its default and its meaning.

    With --backup it takes over the arm, soft limits, tools, bases, loads and home of a controller.
    On a terminal it asks for robot, tool and workpiece where the call does not say them; in a pipe
    the robot must be named and the rest takes its defaults, to be edited. With --input the place of
    the workpiece is one where the arm reaches every tag of the CAM file, with room to spare.
    """
    from postproc.cell import cell_reference

    if options["keys"]:
        page = cell_reference()
        session.document({"schema": "postproc.new_cell/1", "reference": page})
        session.show(page)
        return answer(good=True)
    output = _output(options)
    if options["backup"]:
        return _from_backup(session, options, output)
    from postproc.jobs.new_cell import draft_cell, free_home, propose_place

    place: dict[str, Any] = {}

    def propose() -> bool:
        try:
            place.update(propose_place(options, output))
        except CellError as problem:
            session.say(f"{problem.code}: {problem.message}")
            return False
        _tell(session, place)
        return True

    options["home"] = () if options["no_home"] else options["home"]
    if sys.stdin.isatty() and not (session.json or session.quiet):
        ask(options, propose, lambda: free_home(options, output) or "-")
    draft = draft_cell(options, output, place)
    if draft.place and not place:
        _tell(session, draft.place)
    draft.write()
    session.document(draft.document)
    session.show(f"{output}: cell with {draft.robot}; edit it, then: postproc check {output}")
    return answer(good=True)


def _from_backup(session: Session, options: dict[str, Any], output: Path) -> int:
    """Write the cell of a controller."""
    from postproc.jobs.new_cell import draft_from_backup

    draft = draft_from_backup(options["backup"], options, output)
    draft.write()
    for note in draft.facts["notes"]:
        session.say(f"note: {note}")
    session.document(draft.document)
    counts = f"{len(draft.facts['tools'])} tools, {len(draft.facts['bases'])} bases"
    session.show(
        f"{output}: cell with {draft.robot}, {counts}; give the tools their axis, then: "
        f"postproc check {output} --backup {options['backup']}"
    )
    return answer(good=True)


def _output(options: dict[str, Any]) -> Path:
    from postproc.jobs.new_cell import require_free

    if not (options["output"] or options["backup"] or options["urdf"]):
        raise UsageError("CLI010", "no file to write, expected -o CELL.toml")
    output = Path(options["output"] or "cell.toml")
    require_free(output, options["force"])
    return output


def _tell(session: Session, place: Mapping[str, Any]) -> None:
    xyz, abc = (" ".join(f"{v:g}" for v in place[key]) for key in ("xyz_mm", "abc_deg"))
    session.say(
        f"workpiece at X Y Z {xyz} mm, A B C {abc} deg: all {place['tags']} tags are "
        f"reached, {place['margin_deg']:.1f} deg or more beyond the margins, also where the part "
        "is 50 mm off; collisions are checked by convert"
    )
