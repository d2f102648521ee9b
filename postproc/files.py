"""Reading with clear errors, and output files that appear whole or not at all."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from postproc.errors import ReadError, SourceRef

_TEMPORARY = re.compile(r"\..+\.[a-z0-9_]{8}\.part")


def read_bytes(path: str | Path) -> bytes:
    """Return the content of an input file.

    Raises:
        ReadError: IO001 if it is missing, IO002 if it is a folder or unreadable.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise ReadError("IO001", "no such file", SourceRef(str(path))) from None
    except OSError as problem:
        reason = problem.strerror or type(problem).__name__
        raise ReadError("IO002", f"cannot be read: {reason}", SourceRef(str(path))) from None


@contextmanager
def open_input(path: str | Path) -> Iterator[BinaryIO]:
    """Give an input file opened for reading bytes, and close it.

    Raises:
        ReadError: IO001 if it is missing, IO002 if it is a folder or unreadable, also when that
            shows only while it is read.
    """
    try:
        with Path(path).open("rb") as stream:
            yield stream
    except FileNotFoundError:
        raise ReadError("IO001", "no such file", SourceRef(str(path))) from None
    except OSError as problem:
        reason = problem.strerror or type(problem).__name__
        raise ReadError("IO002", f"cannot be read: {reason}", SourceRef(str(path))) from None


def write_files(contents: Mapping[Path, bytes], *, durable: bool = False) -> None:
    """Write all files or none: each beside its target first, then renamed.

    Missing folders are made. On any failure the temporary files are removed and no target that
    was not yet renamed has changed. ``durable``: the content is on the disk before the name is, so
    that a power loss leaves the old file or the new one.

    Raises:
        ReadError: IO003 if a file cannot be written.
    """
    staged: list[tuple[Path, Path]] = []
    target = Path()
    try:
        for target, content in contents.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            if target.is_dir():
                raise IsADirectoryError(21, "is a folder")
            staged.append((_stage(target, content, durable=durable), target))
        for temporary, target in staged:
            temporary.replace(target)
    except OSError as problem:
        reason = problem.strerror or type(problem).__name__
        raise ReadError("IO003", f"cannot be written: {reason}", SourceRef(str(target))) from None
    finally:
        for temporary, _ in staged:
            temporary.unlink(missing_ok=True)


def remove_files(paths: Iterable[Path]) -> None:
    """Remove files, those that are gone already included.

    Raises:
        ReadError: IO003 if one cannot be removed.
    """
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as problem:
            reason = problem.strerror or type(problem).__name__
            raise ReadError("IO003", f"cannot be removed: {reason}", SourceRef(str(path))) from None


def leftovers(folder: Path) -> list[Path]:
    """Return the temporary files that killed writers have left in a folder."""
    return [p for p in sorted(folder.glob(".*.part")) if _TEMPORARY.fullmatch(p.name)]


def _stage(target: Path, content: bytes, *, durable: bool) -> Path:
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            if durable:
                stream.flush()
                os.fsync(stream.fileno())
        temporary.chmod(0o644)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    return temporary
