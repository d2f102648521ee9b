"""``postproc new-cell``: write a commented cell file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli
from postproc.errors import CellError, UsageError

STARTS = ("program", "unit", "hand")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


def ask(options: dict[str, Any], propose: Callable[[], bool], free_home: Callable[[], str]) -> None:
    """Ask for what the call does not say, and put the answers into its options.

    ``propose`` puts a place of the workpiece in, made from ``options["input"]``; False where the
    file or the arm allows none. ``free_home`` returns six angles [deg] of a home that is free of
    collision, "-" where none is found.
    """
    if options["robot"] is None and options["urdf"] is None:
        click.echo("Name of the arm as on its plate; `postproc robots` lists all.", err=True)
        _put(options, "robot", "Robot", "KR 500 R2830", _robot_name)
    _put(options, "tool_xyz", "TCP in the flange, X Y Z [mm]", "0 0 0", numbers(3))
    _put(options, "tool_abc", "Rotation of the TCP frame, A B C [deg]", "0 0 0", numbers(3))
    if options["tool_axis"] is None:
        choice = click.Choice(AXES)
        question = "TCP axis that points out of the tool into the part"
        options["tool_axis"] = click.prompt(question, "+z", type=choice, err=True)
    if options["tool_mass"] is None:
        text = "Mass of the tool [kg], 0 = not known"
        mass = click.prompt(text, 0.0, type=cli.NOT_NEGATIVE, err=True)
        options["tool_mass"] = mass or None
    _put(options, "tool_number", "TOOL number on the controller", "1", int)
    _files(options, "tool_mesh", "Mesh of the tool in the flange")
    if options["workpiece_xyz"] is None and options["input"] is None:
        question = "CAM file to place the workpiece for, empty = none"
        _put(options, "input", question, "", _existing)
    if options["input"] and options["workpiece_xyz"] is None:
        propose()
    if options["workpiece_xyz"] is None:
        question = "CAM origin in the robot root, X Y Z [mm]"
        _put(options, "workpiece_xyz", question, "1500 0 600", numbers(3))
        question = "Rotation of the CAM axes, A B C [deg]"
        _put(options, "workpiece_abc", question, "0 0 0", numbers(3))
    _put(options, "base_number", "BASE number on the controller", "1", int)
    _files(options, "workpiece_mesh", "Mesh of the workpiece in CAM coordinates")
    if options["home"] is None:
        _put(options, "home", "Home, A1 to A6 [deg], - = none", free_home(), _home)
    if options["spindle"] is None:
        question = "Who starts the spindle: the program, the end effector (unit), or a person"
        choice = click.Choice(STARTS)
        options["spindle"] = click.prompt(question, "program", type=choice, err=True)
    if options["spindle"] == "program":
        question = "Its speed where the CAM file gives none [1/min], empty = such files are refused"
        _put(options, "spindle_rpm", question, "", _feed)
    question = "Feed where the CAM file gives none [mm/min], empty = such files are refused"
    _put(options, "feed", question, "", _feed)


def _put(
    options: dict[str, Any], key: str, question: str, default: str, of: Callable[[str], Any]
) -> None:
    if options[key] is None:
        shown = bool(default)
        value = click.prompt(question, default, value_proc=of, err=True, show_default=shown)
        options[key] = value


def _files(options: dict[str, Any], key: str, question: str) -> None:
    """Ask for mesh files until an empty answer."""
    while not options[key]:
        name = click.prompt(
            f"{question}, empty = none", "", value_proc=_existing, err=True, show_default=False
        )
        if name is None:
            break
        options[key] = (name,)


def numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    """Return the reader of an answer of so many numbers."""

    def read(text: str) -> tuple[float, ...]:
        try:
            words = text.replace(",", " ").split()
            values = [cli.NUMBER.convert(word, None, None) for word in words]
        except click.BadParameter:
            values = []
        if len(values) != count:
            raise click.BadParameter(f"expected {({3: 'three', 6: 'six'})[count]} numbers")
        return tuple(values)

    return read


def _home(text: str) -> tuple[float, ...]:
    return () if text.strip() == "-" else numbers(6)(text)


def _feed(text: str) -> float | None:
    if not text.strip():
        return None
    return cli.POSITIVE.convert(text, None, None)


def _existing(text: str) -> str | None:
    if not text.strip():
        return None
    if not Path(text).is_file():
        raise click.BadParameter(f"no such file {text!r}")
    return text


def _robot_name(text: str) -> str:
    from postproc.cell import find_robot

    try:
        return find_robot(text)
    except CellError as problem:
        raise click.BadParameter(problem.message) from None


class _NewCell(click.Command):
    """Takes ``--home none`` beside six numbers."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        at = args.index("--home") if "--home" in args else len(args)
        if args[at + 1 : at + 2] == ["none"]:
            args = [*args[:at], "--no-home", *args[at + 2 :]]
        return super().parse_args(ctx, args)


@cli.command(
    """
  postproc new-cell -o cell.toml --robot kuka_kr500_r2830 --tool-xyz 107 0 362 --tool-axis +x
  postproc new-cell --backup ARCHIVE.zip -o cell.toml
  postproc new-cell --urdf kuka_quantec_support --tip tool0 -o cell.toml
  postproc new-cell -o cell.toml --robot kuka_kr500_r2830 --tool-xyz 107 0 362 --tool-axis +x \\
      --input part.cls --tool-number 7 --base-number 3 --home 0 -90 90 0 45 0 --feed 600 \\
      --spindle program --spindle-rpm 3000
  postproc new-cell -o cell.toml
  postproc new-cell --keys
""",
    _NewCell,
)
@cli.option("-o, --output CELL.toml", "File to write.")
@cli.option(
    "--robot NAME", "Built-in robot, see postproc robots.", shell_complete=cli.complete_robots
)
@cli.option("--backup ARCHIVE", "Backup of a KRC controller: ZIP or folder.")
@cli.option("--urdf FILE", "URDF or xacro file, or a folder with one robot.")
@cli.option("--tip LINK", "Flange link of the URDF.")
@cli.option("--name TEXT", "Name of the cell; default: that of the file.")
@cli.option("--tool-xyz X Y Z", "TCP in the flange [mm].", cli.NUMBER)
@cli.option("--tool-abc A B C", "Rotation of the TCP frame [deg].", cli.NUMBER)
@cli.option("--tool-axis", "TCP axis that points into the part.", AXES)
@cli.option("--tool-mass KG", "Mass of the tool [kg].", cli.NUMBER)
@cli.option("--tool-number N", "TOOL number; default: 1.", int)
@cli.option("--tool-mesh FILE", "Solid of the tool, in the flange.", multiple=True)
@cli.option("--workpiece-xyz X Y Z", "CAM origin in robroot [mm].", cli.NUMBER)
@cli.option("--workpiece-abc A B C", "Rotation of CAM axes [deg].", cli.NUMBER)
@cli.option("--base-number N", "BASE number; default: 1.", int)
@cli.option("--workpiece-mesh FILE", "Solid of the part, in CAM coordinates.", multiple=True)
@cli.option(
    "--home A1 .. A6|none",
    "Posture to begin and end in [deg]; default: a clear one is proposed.",
    cli.NUMBER,
    nargs=6,
)
@cli.option("--no-home", hidden=True)
@cli.option("--spindle", "Who starts the spindle.", STARTS)
@cli.option(
    "--spindle-rpm 1/MIN",
    "Speed that the program starts it with where the CAM file gives none.",
    cli.NUMBER,
)
@cli.option("--feed MM/MIN", "Feed where the CAM file gives none.", cli.NUMBER)
@cli.option(
    "--input INPUT", "CAM file: propose a place of the workpiece where the arm reaches all of it."
)
@cli.option("--units", "Of the CAM file.", ("mm", "inch", "m"))
@cli.option("--force", "Overwrite an existing file.")
@cli.option("--keys", "Print the reference of all keys instead.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
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
        return cli.answer(good=True)
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
    return cli.answer(good=True)


def _from_backup(session: cli.Session, options: dict[str, Any], output: Path) -> int:
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
    return cli.answer(good=True)


def _output(options: dict[str, Any]) -> Path:
    from postproc.jobs.new_cell import require_free

    if not (options["output"] or options["backup"] or options["urdf"]):
        raise UsageError("CLI010", "no file to write, expected -o CELL.toml")
    output = Path(options["output"] or "cell.toml")
    require_free(output, options["force"])
    return output


def _tell(session: cli.Session, place: Mapping[str, Any]) -> None:
    xyz, abc = (" ".join(f"{v:g}" for v in place[key]) for key in ("xyz_mm", "abc_deg"))
    session.say(
        f"workpiece at X Y Z {xyz} mm, A B C {abc} deg: all {place['tags']} tags are "
        f"reached, {place['margin_deg']:.1f} deg or more beyond the margins, also where the part "
        "is 50 mm off; collisions are checked by convert"
    )
