"""A cell file with some keys changed: comments, order and all else as its owner wrote them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from postproc.cell.cell import Cell
from postproc.cell.file import cell_toml, parse_cell
from postproc.errors import CellError, SourceRef
from postproc.files import read_bytes
from postproc.toml import Location, edited

_PATHS = ("file", "urdf", "template")
"""Keys whose value is a path that counts from the folder of the cell file."""
_BOM = b"\xef\xbb\xbf"


def edited_cell(cell: Cell, changes: Mapping[Location, object], output: str | Path) -> bytes:
    """Return the text of a cell file with values changed, as it is to stand at ``output``.

    Paths in it that count from its folder are written anew where ``output`` has another one.

    Args:
        cell: as loaded from its file.
        changes: value by place, such as ``("workpiece", "frame", "xyz_mm")``.
        output: where it is to be written; what is there is not read.

    Raises:
        CellError: CEL040 for a cell without a file; as ``load_cell`` if the text is no cell.
        DataError: CEL042 if a value cannot stand there.
    """
    if not Path(cell.path).is_file():
        raise CellError(
            "CEL040", "the cell has no file that could be changed", SourceRef(cell.path)
        )
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
