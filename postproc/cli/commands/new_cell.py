"""``postproc new-cell``: write a commented cell file."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import click

from postproc.cli import completion
from postproc.cli.common import Session, answer, standard_options
from postproc.errors import CellError, SourceRef, UsageError

EPILOG = """\b
Examples:
  postproc new-cell -o cell.toml --robot kuka_kr500_r2830 --tool-xyz 107 0 362 --tool-axis +x
  postproc new-cell --backup ARCHIVE.zip -o cell.toml
  postproc new-cell --urdf kuka_quantec_support --tip tool0 -o cell.toml
  postproc new-cell -o cell.toml
  postproc new-cell --keys
"""
_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
_TRIPLE = (float, float, float)
_OF_BACKUP = (
    "urdf", "tip", "tool_xyz", "tool_abc", "tool_axis", "tool_mass", "workpiece_xyz",
    "workpiece_abc",
)  # fmt: skip
"""Options that say what a backup says."""


@click.command(epilog=EPILOG)
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
@click.option("--tool-abc", type=_TRIPLE, metavar="A B C", help="Turn of the TCP frame [deg].")
@click.option("--tool-axis", type=click.Choice(_AXES), help="TCP axis that points into the part.")
@click.option("--tool-mass", type=float, metavar="KG", help="Mass of the tool [kg].")
@click.option("--workpiece-xyz", type=_TRIPLE, metavar="X Y Z", help="CAM origin in robroot [mm].")
@click.option("--workpiece-abc", type=_TRIPLE, metavar="A B C", help="Turn of CAM axes [deg].")
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--keys", is_flag=True, help="Print the reference of all keys instead.")
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Write a cell file with every key, its default and its meaning.

    With --backup it takes over the arm, soft limits, tools, bases, loads and home of a controller.
    On a terminal it asks for robot, tool and workpiece where the call does not say them; in a pipe
    the robot must be named and the rest takes its defaults, to be edited.
    """
    from postproc.cell import cell_reference, cell_text
    from postproc.files import write_files

    if options["keys"]:
        page = cell_reference()
        session.document({"schema": "postproc.new_cell/1", "reference": page})
        session.show(page)
        return answer(good=True)
    output = _output(options)
    if options["backup"]:
        return _from_backup(session, options, output)
    if sys.stdin.isatty() and not (session.json or session.quiet):
        _ask(options)
    files = _urdf_files(options, output)
    if not files:
        _must_load(cell_text(_values(options, Path(output.name))))
    write_files({**files, output: cell_text(_values(options, output)).encode("utf-8")})
    robot = options["robot"] or options["urdf"]
    session.document({"schema": "postproc.new_cell/1", "file": str(output), "robot": robot})
    session.show(f"{output}: cell with {robot}; edit it, then: postproc check {output}")
    return answer(good=True)


def _urdf_files(options: dict[str, Any], output: Path) -> dict[Path, bytes]:
    """Return the URDF to write beside the cell where it is made from macros.

    The options name the file then, and a flange that was asked for on a terminal.
    """
    from postproc.cell import expanded, find_urdf, is_xacro

    if options["urdf"] is None:
        return {}
    source = find_urdf(Path(options["urdf"]))
    options["urdf"] = str(source)
    if not source.is_file() or not is_xacro(source):
        return {}
    target = output.parent / f"{source.name.split('.')[0]}.urdf"
    if target.exists() and not options["force"]:
        raise UsageError(
            "CLI011", "is there already", SourceRef(str(target)), "--force overwrites it"
        )
    text = expanded(source, output.parent)
    _must_be_an_arm(text, source, options["tip"])
    options["urdf"] = str(target)
    return {target: text}


def _must_be_an_arm(text: bytes, source: Path, tip: str | None) -> None:
    """Refuse URDF text that no cell could use, before anything is written."""
    import tempfile

    from postproc.cell import read_urdf_robot

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / source.name.split(".")[0]
        file.write_bytes(text)
        read_urdf_robot(file, tip, SourceRef(str(source)))


def _from_backup(session: Session, options: dict[str, Any], output: Path) -> int:
    """Write the cell of a controller."""
    from postproc.files import write_files
    from postproc.jobs.controller_backup import cell_from_backup

    given = [key for key in _OF_BACKUP if options[key] is not None]
    if given:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError("CLI012", f"{option} does not go with --backup, which says it")
    made = cell_from_backup(options["backup"], options["name"] or output.stem, options["robot"])
    _must_load(made.text)
    write_files({output: made.text.encode("utf-8")})
    for note in made.notes:
        session.say(f"note: {note}")
    facts = {"file": str(output), "robot": made.robot, "notes": list(made.notes), **made.facts}
    session.document({"schema": "postproc.new_cell/1", **facts})
    counts = f"{len(made.facts['tools'])} tools, {len(made.facts['bases'])} bases"
    session.show(
        f"{output}: cell with {made.robot}, {counts}; give the tools their axis, then: "
        f"postproc check {output} --backup {options['backup']}"
    )
    return answer(good=True)


def _output(options: dict[str, Any]) -> Path:
    if not (options["output"] or options["backup"] or options["urdf"]):
        raise UsageError("CLI010", "no file to write, expected -o CELL.toml")
    output = Path(options["output"] or "cell.toml")
    if output.exists() and not options["force"]:
        raise UsageError(
            "CLI011", "is there already", SourceRef(str(output)), "--force overwrites it"
        )
    return output


def _ask(options: dict[str, Any]) -> None:
    """Ask for what the call does not say."""
    if options["robot"] is None and options["urdf"] is None:
        click.echo("Name of the arm as on its plate; `postproc robots` lists all.", err=True)
        options["robot"] = click.prompt("Robot", "KR 500 R2830", value_proc=_robot_name, err=True)
    questions = {
        "tool_xyz": ("TCP in the flange, X Y Z [mm]", "0 0 0"),
        "tool_abc": ("Turn of the TCP frame, A B C [deg]", "0 0 0"),
        "workpiece_xyz": ("CAM origin in the robot root, X Y Z [mm]", "1500 0 600"),
        "workpiece_abc": ("Turn of the CAM axes, A B C [deg]", "0 0 0"),
    }
    for key, (question, default) in questions.items():
        if options[key] is None:
            options[key] = click.prompt(question, default, value_proc=_triple, err=True)
    if options["tool_axis"] is None:
        choice = click.Choice(_AXES)
        question = "TCP axis that points out of the tool into the part"
        options["tool_axis"] = click.prompt(question, "+z", type=choice, err=True)
    if options["tool_mass"] is None:
        mass = click.prompt("Mass of the tool [kg], 0 = not known", 0.0, type=float, err=True)
        options["tool_mass"] = mass or None


def _robot_name(text: str) -> str:
    from postproc.cell import find_robot

    try:
        return find_robot(text)
    except CellError as problem:
        raise click.BadParameter(problem.message) from None


def _triple(text: str) -> tuple[float, ...]:
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != len(_TRIPLE):
        raise click.BadParameter("expected three numbers")
    return tuple(values)


def _values(options: dict[str, Any], output: Path) -> dict[str, Any]:
    """Return what the call says, nested as in the file."""
    if (options["robot"] is None) == (options["urdf"] is None):
        raise UsageError("CLI012", "expected one of --robot NAME and --urdf FILE")
    robot: dict[str, str] = {}
    if options["urdf"] is not None:
        robot["urdf"] = Path(os.path.relpath(options["urdf"], output.parent)).as_posix()
        if options["tip"] is not None:
            robot["tip"] = options["tip"]
    else:
        robot["model"] = _known_robot(options["robot"])
    tool: dict[str, Any] = {"axis": options["tool_axis"] or "+z"}
    tool["frame"] = _frame(options["tool_xyz"], options["tool_abc"])
    if options["tool_mass"] is not None:
        tool["mass_kg"] = options["tool_mass"]
    workpiece = {"frame": _frame(options["workpiece_xyz"], options["workpiece_abc"])}
    return {
        "name": options["name"] or output.stem,
        "robot": robot,
        "tool": tool,
        "workpiece": workpiece,
    }


def _known_robot(name: str) -> str:
    from postproc.cell import find_robot

    try:
        return find_robot(name)
    except CellError as problem:
        raise UsageError("CLI013", problem.message, hint=problem.hint) from None


def _frame(xyz: tuple[float, ...] | None, abc: tuple[float, ...] | None) -> dict[str, list[float]]:
    return {"xyz_mm": list(xyz or (0.0, 0.0, 0.0)), "abc_deg": list(abc or (0.0, 0.0, 0.0))}


def _must_load(text: str) -> None:
    """Refuse what would not load from the current folder, before anything is written."""
    from postproc.cell import parse_cell

    try:
        parse_cell(text.encode("utf-8"), "cell.toml")
    except CellError as problem:
        if problem.code == "CEL032":
            raise
        raise UsageError("CLI013", problem.message, hint=problem.hint) from None
