"""What ``new-cell`` asks on a terminal."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from postproc.cli.common import NOT_NEGATIVE, NUMBER, POSITIVE
from postproc.errors import CellError

STARTS = ("program", "unit", "hand")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


def ask(options: dict[str, Any], propose: Callable[[], bool], free_home: Callable[[], str]) -> None:
    """Ask for what the call does not say.

    Args:
        options: of the call; the answers are put in.
        propose: puts a place of the workpiece in, made from ``options["input"]``; False where the
            file or the arm allows none.
        free_home: six angles [deg] of a home that is free of collision, "-" where none is found.
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
        mass = click.prompt(
            "Mass of the tool [kg], 0 = not known", 0.0, type=NOT_NEGATIVE, err=True
        )
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
            values = [NUMBER.convert(word, None, None) for word in words]
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
    return POSITIVE.convert(text, None, None)


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
