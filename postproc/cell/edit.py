"""A cell file with some keys changed: comments, order and all else as its owner wrote them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.cell import Cell, MeshPlacement, Tool
from postproc.cell.file import CUTTER, cell_toml, cutter_solid, parse_cell
from postproc.errors import CellError, SourceRef
from postproc.files import read_bytes
from postproc.geometry import axis_name, kuka_from_transform
from postproc.toml import Location, edited
from postproc.units import DEG, MM

_PATHS = ("file", "urdf", "template")
"""Keys whose value is a path that counts from the folder of the cell file."""
_BOM = b"\xef\xbb\xbf"
XYZ_DIGITS = 6
"""Decimals of mm and ..."""
ABC_DIGITS = 8
"""... of degrees of a frame that is written: 1e-6 mm at a distance of 6 m."""
_DIGITS = 9
_LIMITS = {"joint_margin_deg": DEG, "singularity_deg": DEG, "clearance_mm": MM}


def edited_cell(cell: Cell, changes: Mapping[Location, object], output: str | Path) -> bytes:
    """Return the text of a cell file with values changed, as it is to stand at ``output``.

    Paths in it that count from its folder are written anew where ``output`` has another one; what
    is there is not read. ``changes``: value by place, such as ``("workpiece", "frame", "xyz_mm")``.
    CEL040 for a cell without a file, CEL042 if a value cannot stand there.
    """
    if not Path(cell.path).is_file():
        message = "the cell was not read from a file, so none can be changed"
        raise CellError("CEL040", message, SourceRef(cell.path))
    raw = read_bytes(cell.path)
    toml = cell_toml(cell)
    text = edited("\n".join(toml.text), {**_moved(cell, toml.data, Path(output)), **changes})
    if b"\r\n" in raw:
        text = text.replace("\n", "\r\n")
    content = (_BOM if raw.startswith(_BOM) else b"") + text.encode("utf-8")
    parse_cell(content, output)
    return content


def base_location(cell: Cell, index: int) -> Location:
    """Return where the setup at ``index`` of ``cell.bases`` stands in the cell file."""
    return ("bases", index) if "bases" in cell_toml(cell).data else ("workpiece",)


def cell_changes(before: Cell, after: Cell) -> dict[Location, object]:
    """Return what ``edited_cell`` has to write into the file of a cell for it to be another one.

    Compared are frames, tool axes, places and scales of solids, limits, range of the spin
    and the unit of the input; nothing else can have changed.
    """
    tables = cell_toml(before).data
    old, new = _values(before, tables), _values(after, tables)
    return {key: value for key, value in new.items() if old.get(key, value) != value}


def _values(cell: Cell, tables: Mapping[str, Any]) -> dict[Location, object]:
    """Return what may change of a cell, by its place in a file that has some tables."""
    robot = cell.robot
    limits = [_degrees(pair) for pair in zip(robot.q_min, robot.q_max, strict=True)]
    found: dict[Location, object] = {
        ("robot", "base"): frame_document(robot.T_world_robroot),
        ("robot", "limits_deg"): limits,
        ("import", "units"): cell.reading.units,
        ("optimize", "range_deg"): _degrees(cell.optimize.range),
    }
    for name in tables["robot"].get("cable", {}):
        found["robot", "cable", name] = limits[int(name[1:]) - 1]
    for key, unit in _LIMITS.items():
        value = getattr(cell.limits, key.rpartition("_")[0])
        found["limits", key] = round(value / unit, _DIGITS)
    for k, base in enumerate(cell.bases):
        at = base_location(cell, k)
        found[*at, "frame"] = frame_document(base.T_robroot_base)
        found |= _solids((*at, "meshes"), base.meshes)
    for k, tool in enumerate(cell.tools):
        at = ("tools", k) if "tools" in tables else ("tool",)
        found[*at, "frame"] = frame_document(tool.T_flange_tcp)
        found[*at, "axis"] = None if tool.known_axis is None else axis_name(tool.known_axis)
        found |= _solids((*at, "meshes"), tool.meshes)
        for solid in tool.meshes:
            if _is_cutter(tool, solid):  # its place follows tip and axis
                found[*at, CUTTER, "length_mm"] = round(solid.length / MM, XYZ_DIGITS)
    return found | _solids(("obstacles",), cell.obstacles)


def _is_cutter(tool: Tool, solid: MeshPlacement) -> bool:
    return solid.cutting and solid.name == CUTTER and bool(np.isfinite(tool.diameter))


def _solids(at: Location, solids: Sequence[MeshPlacement]) -> dict[Location, object]:
    found: dict[Location, object] = {}
    for k, solid in enumerate(solids):
        if solid.cutting and solid.name == CUTTER:
            continue
        # one that is gone leaves the others at other places: the number tells them apart
        for key, value in frame_document(solid.T_owner_mesh).items():
            found[*at, k, key] = value
        if solid.file is not None:
            found[*at, k, "scale"] = round(solid.scale / MM, _DIGITS)
    return found


def refitted(tool: Tool, T_flange_tcp: FloatArray, axis: FloatArray, longer: float = 0.0) -> Tool:
    """Return a tool with another tip (4, 4) and axis (3,), as its file would have it.

    ``longer``: how much longer the solid of its key ``cutter`` is [m].
    """
    meshes = tuple(
        cutter_solid(tool.diameter, solid.length + longer, T_flange_tcp, axis)
        if _is_cutter(tool, solid)
        else solid
        for solid in tool.meshes
    )
    return replace(tool, T_flange_tcp=T_flange_tcp, known_axis=axis, meshes=meshes)


def frame_document(T: FloatArray) -> dict[str, list[float]]:
    """Return a frame (4, 4) in the units of a cell file."""
    xyz, abc = kuka_from_transform(T)
    return {
        "xyz_mm": [round(float(v), XYZ_DIGITS) + 0.0 for v in xyz],
        "abc_deg": [round(float(v), ABC_DIGITS) + 0.0 for v in abc],
    }


def _degrees(values: Iterable[float]) -> list[float]:
    return [round(float(v) / DEG, _DIGITS) for v in values]


def _moved(cell: Cell, data: object, output: Path) -> Mapping[Location, object]:
    """Return the relative paths of the file, written from the folder of ``output``."""
    here, there = (path.absolute().parent for path in (Path(cell.path), output))
    if here.resolve() == there.resolve():
        return {}
    found = {}
    for location, value in _texts(data, ()):
        built_in = location == ("krl", "template") and not Path(cell.krl.template).is_absolute()
        is_path = location[-1] in _PATHS and not Path(value).is_absolute() and not built_in
        if is_path and (here / value).exists():
            found[location] = Path(os.path.relpath(here / value, there)).as_posix()
    return found


def _texts(data: object, at: Location) -> Iterator[tuple[Location, str]]:
    if isinstance(data, str):
        yield at, data
        return
    if isinstance(data, dict):
        entries: Iterator[tuple[str | int, object]] = iter(data.items())
    else:
        entries = enumerate(data) if isinstance(data, list) else iter(())
    for part, value in entries:
        yield from _texts(value, (*at, part))
