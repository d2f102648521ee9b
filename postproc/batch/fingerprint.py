"""What a result depends on, as hashes: input, cell with its meshes, model, options, version."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from postproc import __version__
from postproc.errors import PostprocError
from postproc.files import read_bytes

if TYPE_CHECKING:
    from postproc.batch.jobs import Job
    from postproc.model.cell import Cell
    from postproc.model.toolpath import ToolPath


def digest(content: bytes) -> str:
    """Return the SHA-256 of some bytes in hex."""
    return hashlib.sha256(content).hexdigest()


def fingerprint(job: Job) -> dict[str, str]:
    """Return the hashes that decide whether a job's result is still good.

    An unreadable input or cell gets the hash ``-``: the job then runs and says what is wrong.
    """
    request = job.request
    options = {k: v for k, v in asdict(request).items() if k not in {"source", "cell", "model"}}
    return {
        "input": _file(request.source) if job.toolpath is None else _content(job.toolpath),
        "cell": _cell(request.cell),
        "model": _file(request.model) if request.model else "",
        "options": digest(json.dumps(options, sort_keys=True).encode()),
        "version": __version__,
    }


def _content(path: ToolPath) -> str:
    """Hash what a program is made of; line numbers do not count, names do."""
    columns = (path.points, path.axes, path.kind, path.feed, path.cycle, path.operation)
    seen = hashlib.sha256()
    for column in columns:
        seen.update(column.tobytes())
    seen.update(repr((path.cycles, [o.name for o in path.operations], path.names)).encode())
    return seen.hexdigest()


@lru_cache(maxsize=256)
def _file(path: str) -> str:
    try:
        return digest(read_bytes(path))
    except PostprocError:
        return "-"


@lru_cache(maxsize=64)
def _cell(path: str) -> str:
    from postproc.model.cellfile import load_cell

    try:
        cell = load_cell(path)
    except PostprocError:
        return "-"
    return digest("".join(_file(str(p)) for p in [Path(path), *cell_files(cell)]).encode())


def cell_files(cell: Cell) -> Iterator[Path]:
    """Yield the files that a cell names, in a fixed order."""
    geometry = cell.robot.geometry
    urdf = getattr(geometry, "path", None)
    if urdf is not None:
        yield Path(urdf)
    solids = [*(mesh for _, mesh in cell.robot.link_meshes), *cell.tool.meshes]
    solids += [*cell.workpiece.meshes, *cell.obstacles]
    for solid in solids:
        if solid.file is not None:
            yield solid.file
    template = Path(cell.path).parent / cell.krl.template
    if template.is_dir():
        yield from sorted(p for p in template.rglob("*") if p.is_file())


def forget() -> None:
    """Forget cached hashes (files may have changed since)."""
    _file.cache_clear()
    _cell.cache_clear()
