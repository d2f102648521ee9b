"""A cell file from what a call says: its text, the URDF beside it, a proposed place and home."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from postproc.backup import cell_values, read_backup
from postproc.cell import (
    cell_text,
    expanded,
    find_robot,
    find_urdf,
    is_xacro,
    load_robot,
    parse_cell,
    read_urdf_robot,
)
from postproc.collision import load_mesh
from postproc.errors import CellError, PostprocError, SourceRef, UsageError
from postproc.files import write_files
from postproc.jobs.workpiece_place import workpiece_place
from postproc.planning import free_posture
from postproc.readers import ReadOptions, read
from postproc.records import dataclass
from postproc.units import DEG, MM

OPTIONS: Mapping[str, Any] = dict.fromkeys(
    (
        "robot", "urdf", "tip", "name", "tool_xyz", "tool_abc", "tool_axis", "tool_mass",
        "tool_number", "tool_mesh", "workpiece_xyz", "workpiece_abc", "base_number",
        "workpiece_mesh", "home", "spindle", "spindle_rpm", "feed", "input", "units",
    )
)  # fmt: skip
"""What a call may say, each None where it does not: the options of ``new-cell``."""
_BESIDE_BACKUP = ("name", "robot", "units")
"""Options that go with a backup."""


@dataclass(frozen=True, slots=True)
class CellDraft:
    """A new cell: files by path, the cell's own last; nothing is on disk before ``write``.

    ``facts``: what was found, as the place of a workpiece or the tools of a controller.
    """

    files: Mapping[Path, bytes]
    robot: str
    facts: Mapping[str, Any]

    @property
    def place(self) -> Mapping[str, Any]:
        """Where the workpiece was proposed, empty without."""
        found: Mapping[str, Any] = self.facts.get("place", {})
        return found

    @property
    def path(self) -> Path:
        """Where the cell file is to be."""
        return list(self.files)[-1]

    @property
    def text(self) -> str:
        """The text of the cell file, every key with its meaning."""
        return self.files[self.path].decode("utf-8")

    @property
    def document(self) -> dict[str, Any]:
        """The ``postproc.new_cell/1`` document, as ``new-cell --json`` prints it."""
        facts = {"file": str(self.path), "robot": self.robot, **self.facts}
        return {"schema": "postproc.new_cell/1", **facts}

    def write(self) -> Path:
        """Write the files whole or not at all, and return the path of the cell file.

        Raises:
            ReadError: if the folder cannot be written.
        """
        write_files(self.files)
        return self.path


def draft_cell(options: dict[str, Any], output: Path, place: dict[str, Any]) -> CellDraft:
    """Return the cell that options of ``new-cell`` describe, to stand at ``output``.

    What is found for options is put in; ``place``: of the workpiece, where one was proposed before.
    """
    files = _urdf_files(options, output)
    if options["input"] and options["workpiece_xyz"] is None:
        place = propose_place(options, output)
    if not files:
        must_load(cell_text(_values(options, Path(output.name))))
    remarks = {} if options["home"] is not None else {"motion": _home_remark(options, output)}
    text = cell_text(_values(options, output), remarks).encode("utf-8")
    robot = options["robot"] or options["urdf"]
    return CellDraft({**files, output: text}, robot, {"place": dict(place)} if place else {})


def draft_from_backup(archive: str | Path, options: Mapping[str, Any], output: Path) -> CellDraft:
    """Return the cell of a controller."""
    given = [key for key in OPTIONS if options[key] not in (None, ()) and key not in _BESIDE_BACKUP]
    if given:
        option = f"--{given[0].replace('_', '-')}"
        raise UsageError("CLI012", f"{option} does not go with --backup; edit the cell instead")
    controller, robot = read_backup(archive), options["robot"]
    values, remarks = cell_values(controller, load_robot(robot) if robot else None)
    text = cell_text({"name": options["name"] or output.stem, **values}, remarks)
    must_load(text)
    facts = {
        "notes": [*controller.notes, *remarks["robot"][:1]],
        "software": controller.software or None,
        "trafoname": controller.machine.trafoname or None,
        "tools": [tool["number"] for tool in values["tools"]],
        "bases": [base["number"] for base in values["bases"]],
    }
    arm = values["robot"].get("model") or values["robot"]["name"]
    return CellDraft({output: text.encode("utf-8")}, arm, facts)


def require_free(output: Path, force: bool) -> None:
    """Refuse to write over a file: CLI011."""
    if output.exists() and not force:
        raise UsageError(
            "CLI011", "is there already", SourceRef(str(output)), "--force overwrites it"
        )


def _urdf_files(options: dict[str, Any], output: Path) -> dict[Path, bytes]:
    """Return the URDF to write beside the cell where it is made from macros."""
    if options["urdf"] is None:
        return {}
    source = find_urdf(Path(options["urdf"]))
    options["urdf"] = str(source)
    if not source.is_file() or not is_xacro(source):
        return {}
    target = output.parent / f"{source.name.split('.')[0]}.urdf"
    require_free(target, options["force"])
    text = expanded(source, output.parent)
    _must_be_an_arm(text, source, options["tip"])
    options["urdf"] = str(target)
    return {target: text}


def _must_be_an_arm(text: bytes, source: Path, tip: str | None) -> None:
    """Refuse URDF text that no cell could use, before anything is written."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / source.name.split(".")[0]
        file.write_bytes(text)
        read_urdf_robot(file, tip, SourceRef(str(source)))


def propose_place(options: dict[str, Any], output: Path) -> dict[str, Any]:
    """Put a place of the workpiece for the CAM file into the options; return it for JSON."""
    text = cell_text(_values(options, output)).encode("utf-8")
    cell = parse_cell(text, output)
    axis = tuple(float(v) for v in cell.tool.axis)
    toolpath = read(options["input"], ReadOptions(units=options["units"], tool_axis=axis))
    place = workpiece_place(toolpath, cell, options["workpiece_abc"])
    options["workpiece_xyz"], options["workpiece_abc"] = place["xyz_mm"], place["abc_deg"]
    return place


def free_home(options: dict[str, Any], output: Path) -> str:
    """Return six angles [deg] of a home that is free of collision in the cell, empty without."""
    try:
        free = free_posture(parse_cell(cell_text(_values(options, output)).encode(), output))
    except PostprocError:
        return ""  # the cell says why when it is used
    return "" if free is None else " ".join(f"{angle / DEG:.0f}" for angle in free)


def _home_remark(options: dict[str, Any], output: Path) -> list[str]:
    """Return the comment that proposes a home, where one is found."""
    free = free_home(options, output)
    angles = ", ".join(free.split())
    return [f"home_deg = [{angles}] is free of collision: begin and end there?"] if free else []


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
        (motion, "home_deg", [float(v) for v in options["home"] or ()] or None),
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
    """Return the entries of mesh files, relative to the cell; None without any."""
    for name in names or ():
        load_mesh(Path(name), MM)  # what convert would refuse is no solid of a new cell
    paths = (Path(os.path.relpath(name, output.parent)).as_posix() for name in names or ())
    return [{"file": path} for path in paths] or None


def _known_robot(name: str) -> str:
    try:
        return find_robot(name)
    except CellError as problem:
        raise UsageError("CLI013", problem.message, hint=problem.hint) from None


def _frame(xyz: tuple[float, ...] | None, abc: tuple[float, ...] | None) -> dict[str, list[float]]:
    return {
        key: [float(v) for v in values or (0.0, 0.0, 0.0)]
        for key, values in (("xyz_mm", xyz), ("abc_deg", abc))
    }


def must_load(text: str) -> None:
    """Refuse what would not load from the current folder, before anything is written."""
    own = "cell.toml"
    try:
        parse_cell(text.encode("utf-8"), own)
    except CellError as problem:
        if problem.code == "CEL032" or (problem.source is not None and problem.source.path != own):
            raise
        raise UsageError("CLI013", problem.message, hint=problem.hint) from None
