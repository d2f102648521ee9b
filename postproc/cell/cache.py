"""Cells that many conversions of one process share: read once, until one of their files changes.

With the same cell object, the kinematics and the collision scene behind it are shared too, which is
most of what a small input costs.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path

from postproc.cell.cell import Cell
from postproc.cell.file import load_cell
from postproc.records import dataclass

_KEPT = 8
_Mark = tuple[int, int, int, int] | None


@dataclass(frozen=True, slots=True)
class _Entry:
    cell: Cell
    marks: tuple[tuple[str, _Mark], ...]


_CACHE: OrderedDict[tuple[str, str], _Entry] = OrderedDict()


def shared_cell(path: str) -> Cell:
    """Return the cell of a file; the same object as long as none of its files changes."""
    key = (path, str(Path(path).absolute()))
    entry = _CACHE.get(key)
    if entry is None or entry.marks != _marks(path, entry.cell):
        before = _mark(Path(path))
        cell = load_cell(path)
        marks = _marks(path, cell)
        entry = _Entry(cell, marks)
        if before is None or marks[0][1] != before:  # changed while it was read
            return cell
        _CACHE[key] = entry
    _CACHE.move_to_end(key)
    while len(_CACHE) > _KEPT:
        _CACHE.popitem(last=False)
    return entry.cell


def cell_files(cell: Cell) -> Iterator[Path]:
    """Yield the files that a cell names, in a fixed order."""
    geometry = cell.robot.geometry
    urdf = getattr(geometry, "path", None)
    if urdf is not None:
        yield Path(urdf)
    solids = [*(mesh for _, mesh in cell.robot.link_meshes), *cell.solids]
    for solid in solids:
        if solid.file is not None:
            yield solid.file
    template = Path(cell.path).parent / cell.krl.template
    if template.is_dir():
        yield from sorted(p for p in template.rglob("*") if p.is_file())


def _marks(path: str, cell: Cell) -> tuple[tuple[str, _Mark], ...]:
    return tuple((str(file), _mark(file)) for file in (Path(path), *cell_files(cell)))


def _mark(path: Path) -> _Mark:
    """Return what changes with every change of a file; None if there is none."""
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_mtime_ns, state.st_ctime_ns, state.st_size, state.st_ino
