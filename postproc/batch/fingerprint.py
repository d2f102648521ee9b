"""What a result depends on, as hashes: input, cell with its meshes, model, options, versions."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, fields
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.errors import PostprocError
from postproc.files import read_bytes
from postproc.registry import foreign
from postproc.version import __version__

if TYPE_CHECKING:
    from postproc.batch.jobs import Job
    from postproc.model import ToolPath

UNREADABLE = "-"
"""In place of the hash of what cannot be read; never current."""
_SILENT = {"path", "name", "line", "words", "unknown_words", "warnings", "recovered"}
"""Columns of a toolpath that no program of a section shows."""


def digest(content: bytes) -> str:
    """Return the SHA-256 of some bytes in hex."""
    return hashlib.sha256(content).hexdigest()


def fingerprint(job: Job) -> dict[str, str]:
    """Return the hashes that decide whether a job's result is still good.

    An unreadable input or cell gets the hash ``-``: the job then runs and says what is wrong.
    """
    request = job.request
    options = {
        k: v for k, v in asdict(request).items() if k not in {"source", "cell", "model", "keep"}
    }
    return {
        "input": _file(request.source) if job.toolpath is None else content_hash(job.toolpath),
        "cell": _cell(request.cell),
        "model": _file(request.model) if request.model else "",
        **({"keep": _old(request.keep)} if request.keep else {}),
        "options": digest(json.dumps(options, sort_keys=True).encode()),
        "version": "; ".join((__version__, *foreign())),
    }


def content_hash(path: ToolPath) -> str:
    """Hash all that a section's program is made of; where it stood in the file does not count."""
    seen = hashlib.sha256()
    for column in fields(path):
        if column.name not in _SILENT:
            seen.update(f"|{column.name}:".encode())
            _update(seen, getattr(path, column.name))
    return seen.hexdigest()


def _update(seen: Any, value: Any) -> None:  # noqa: ANN401 - hashlib's type has no name
    """Feed a column or table to a hash; lines of the file are left out."""
    if hasattr(value, "tobytes"):
        seen.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif hasattr(value, "__dataclass_fields__"):
        for item in fields(value):
            if item.name not in {"line", "lines"}:
                _update(seen, getattr(value, item.name))
    elif isinstance(value, dict):
        for key in sorted(value):
            seen.update(repr(key).encode())
            _update(seen, value[key])
    elif isinstance(value, tuple) and value and not isinstance(value[0], str):
        seen.update(b"(%d" % len(value))
        for item in value:
            _update(seen, item)
    else:
        seen.update(f"{value!r};".encode("utf-8", "surrogateescape"))


@lru_cache(maxsize=256)
def _file(path: str) -> str:
    try:
        return digest(read_bytes(path))
    except PostprocError:
        return UNREADABLE


@lru_cache(maxsize=4)
def _old(path: str) -> str:
    from postproc.jobs.kept import digest_of

    try:
        return digest_of(path)
    except (OSError, PostprocError):
        return UNREADABLE


@lru_cache(maxsize=64)
def _cell(path: str) -> str:
    from postproc.cell import cell_files, shared_cell

    try:
        cell = shared_cell(path)
    except PostprocError:
        return UNREADABLE
    return digest("".join(_file(str(p)) for p in [Path(path), *cell_files(cell)]).encode())


def forget() -> None:
    """Forget cached hashes (files may have changed since)."""
    _file.cache_clear()
    _cell.cache_clear()
    _old.cache_clear()
