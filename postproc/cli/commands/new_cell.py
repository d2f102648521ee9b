"""``postproc new-cell``: write a commented cell file."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import click

from postproc.cli import completion
from postproc.cli.common import (
    NUMBER,
    Session,
    answer,
    standard_options,
)
from postproc.cli.questions import AXES, STARTS, ask
from postproc.errors import CellError, SourceRef, UsageError

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
_OF_BACKUP = (
    "urdf", "tip", "tool_xyz", "tool_abc", "tool_axis", "tool_mass", "workpiece_xyz",
    "workpiece_abc", "tool_number", "base_number", "home", "spindle", "spindle_rpm", "feed",
    "input", "tool_mesh", "workpiece_mesh",
)  # fmt: skip
"""Options that do not go with a backup: it says them, or the cell is edited."""


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
@click.option("--tool-abc", type=_TRIPLE, metavar="A B C", help="Turn of the TCP frame [deg].")
@click.option("--tool-axis", type=click.Choice(AXES), help="TCP axis that points into the part.")
@click.option("--tool-mass", type=NUMBER, metavar="KG", help="Mass of the tool [kg].")
@click.option("--tool-number", type=int, metavar="N", help="TOOL number; default: 1.")
@click.option(
    "--tool-mesh", multiple=True, metavar="FILE", help="Solid of the tool, in the flange."
)
@click.option("--workpiece-xyz", type=_TRIPLE, metavar="X Y Z", help="CAM origin in robroot [mm].")
@click.option("--workpiece-abc", type=_TRIPLE, metavar="A B C", help="Turn of CAM axes [deg].")
@click.option("--base-number", type=int, metavar="N", help="BASE number; default: 1.")
@click.option("--workpiece-mesh", multiple=True, metavar="FILE", help="Solid, in CAM coordinates.")
@click.option(
    "--home",
    type=_SIX,
    metavar="A1 .. A6|none",
    help="Posture to begin and end in [deg]; default: a free one is proposed.",
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
    place: dict[str, Any] = {}

    def propose() -> bool:
        try:
            place.update(_propose(options, output))
        except CellError as problem:
            session.say(f"{problem.code}: {problem.message}")
            return False
        _tell(session, place)
        return True

    options["home"] = () if options["no_home"] else options["home"]
    if sys.stdin.isatty() and not (session.json or session.quiet):
        ask(options, propose, lambda: _free_home(options, output) or "-")
    files = _urdf_files(options, output)
    if options["input"] and options["workpiece_xyz"] is None:
        place.update(_propose(options, output))
        _tell(session, place)
    if not files:
        _must_load(cell_text(_values(options, Path(output.name))))
    remarks = {} if options["home"] is not None else {"motion": _home_remark(options, output)}
    text = cell_text(_values(options, output), remarks)
    write_files({**files, output: text.encode("utf-8")})
    robot = options["robot"] or options["urdf"]
    facts = {"file": str(output), "robot": robot} | ({"place": place} if place else {})
    session.document({"schema": "postproc.new_cell/1", **facts})
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

    given = [key for key in _OF_BACKUP if options[key] not in (None, ())]
    if given:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError("CLI012", f"{option} does not go with --backup; edit the cell instead")
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


def _propose(options: dict[str, Any], output: Path) -> dict[str, Any]:
    """Put a place of the workpiece for the CAM file into the options; return what it is for JSON.

    Raises:
        CellError: CEL016 if there is none.
        ReadError: if the file cannot be read.
    """
    from postproc.cell import cell_text, parse_cell
    from postproc.jobs.workpiece_place import workpiece_place
    from postproc.readers import ReadOptions, read
    from postproc.units import DEG

    text = cell_text(_values(options, output)).encode("utf-8")
    cell = parse_cell(text, output)
    axis = tuple(float(v) for v in cell.tool.axis)
    toolpath = read(options["input"], "auto", ReadOptions(units=options["units"], tool_axis=axis))
    place = workpiece_place(toolpath, cell, options["workpiece_abc"])
    options["workpiece_xyz"], options["workpiece_abc"] = place.xyz_mm, place.abc_deg
    return {
        "xyz_mm": list(place.xyz_mm),
        "abc_deg": list(place.abc_deg),
        "margin_deg": round(place.margin / DEG, 3),
        "tags": place.tags,
    }


def _free_home(options: dict[str, Any], output: Path) -> str:
    """Return six angles [deg] of a home that is free of collision in the cell, empty without."""
    from postproc.cell import cell_text, parse_cell
    from postproc.errors import PostprocError
    from postproc.planning import free_posture
    from postproc.units import DEG

    try:
        free = free_posture(parse_cell(cell_text(_values(options, output)).encode(), output))
    except PostprocError:
        return ""  # the cell says why when it is used
    return "" if free is None else " ".join(f"{angle / DEG:.0f}" for angle in free)


def _home_remark(options: dict[str, Any], output: Path) -> list[str]:
    """Return the comment that proposes a home, where one is found."""
    free = _free_home(options, output)
    angles = ", ".join(free.split())
    return [f"home_deg = [{angles}] is free of collision: begin and end there?"] if free else []


def _tell(session: Session, place: dict[str, Any]) -> None:
    xyz, abc = (" ".join(f"{v:g}" for v in place[key]) for key in ("xyz_mm", "abc_deg"))
    session.say(
        f"workpiece at X Y Z {xyz} mm, A B C {abc} deg: all {place['tags']} distinct tags are "
        f"reached, {place['margin_deg']:.1f} deg or more beyond the margins, also where the part "
        "is 50 mm off; collisions are for convert to find"
    )


def _values(options: dict[str, Any], output: Path) -> dict[str, Any]:
    """Return what the call says, nested as in the file."""
    tool: dict[str, Any] = {"axis": options["tool_axis"] or "+z"}
    tool["frame"] = _frame(options["tool_xyz"], options["tool_abc"])
    workpiece: dict[str, Any] = {
        "frame": _frame(options["workpiece_xyz"], options["workpiece_abc"])
    }
    motion: dict[str, Any] = {}
    process: dict[str, Any] = {}
    given = (
        (tool, "mass_kg", options["tool_mass"]),
        (tool, "number", options["tool_number"]),
        (tool, "meshes", _meshes(options["tool_mesh"], output)),
        (workpiece, "number", options["base_number"]),
        (workpiece, "meshes", _meshes(options["workpiece_mesh"], output)),
        (motion, "home_deg", list(options["home"] or ()) or None),
        (motion, "feed_mm_min", options["feed"]),
        (process, "spindle", options["spindle"]),
        (process, "spindle_rpm", options["spindle_rpm"]),
    )
    for table, key, value in given:
        if value is not None:
            table[key] = value
    return {
        "name": options["name"] or output.stem,
        "robot": _robot_values(options, output),
        "tool": tool,
        "workpiece": workpiece,
        **({"motion": motion} if motion else {}),
        **({"process": process} if process else {}),
    }


def _robot_values(options: dict[str, Any], output: Path) -> dict[str, str]:
    if (options["robot"] is None) == (options["urdf"] is None):
        raise UsageError("CLI012", "expected one of --robot NAME and --urdf FILE")
    if options["urdf"] is None:
        return {"model": _known_robot(options["robot"])}
    robot = {"urdf": Path(os.path.relpath(options["urdf"], output.parent)).as_posix()}
    if options["tip"] is not None:
        robot["tip"] = options["tip"]
    return robot


def _meshes(names: tuple[str, ...] | None, output: Path) -> list[dict[str, str]] | None:
    """Return the entries of mesh files, relative to the cell; None without any.

    Raises:
        CellError: COL001 to COL009 for a file that cannot be read.
    """
    from postproc.collision import load_mesh
    from postproc.units import MM

    for name in names or ():
        load_mesh(Path(name), MM)  # what convert would refuse is no solid of a new cell
    paths = (Path(os.path.relpath(name, output.parent)).as_posix() for name in names or ())
    return [{"file": path} for path in paths] or None


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

    own = "cell.toml"
    try:
        parse_cell(text.encode("utf-8"), own)
    except CellError as problem:
        if problem.code == "CEL032" or (problem.source is not None and problem.source.path != own):
            raise
        raise UsageError("CLI013", problem.message, hint=problem.hint) from None
