"""Reading with clear errors, and output files that appear whole or not at all."""

from __future__ import annotations

import io
import os
import re
import select
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from postproc.errors import DataError, PostprocError, ReadError, SourceRef

PIPE_SILENCE = 60.0
"""Longest time [s] for which a pipe is waited for without a byte."""
MOST_PIPED = 1 << 29
"""No more bytes are taken from a pipe: they are kept in memory."""
_SPOOLED: dict[str, bytes] = {}
"""Contents of the pipes that are being read, by path."""
_TEMPORARY = re.compile(r"\..+\.[a-z0-9_]{8}\.part")


def read_bytes(path: str | Path) -> bytes:
    """Return the content of an input file; errors as ``open_input``."""
    with open_input(path) as stream:
        return stream.read()


def text_of(raw: bytes, path: str | Path, code: str, error: type[PostprocError] = DataError) -> str:
    """Return the text of a file in UTF-8, a byte order mark left out; ``error`` if it is none."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = raw[: problem.start].count(b"\n") + 1
        raise error(code, "not a text file in UTF-8", SourceRef(str(path), line)) from None


@contextmanager
def open_input(path: str | Path) -> Iterator[BinaryIO]:
    """Give an input file opened for reading bytes, and close it.

    IO001 if it is missing, IO002 if it is a folder or unreadable, also when that shows only while
    it is read; IO016 for a pipe that says nothing or does not end.
    """
    try:
        if str(path) in _SPOOLED or _is_pipe(path):
            yield io.BytesIO(_SPOOLED.get(str(path)) or _piped(path))
        else:
            with Path(path).open("rb") as stream:
                yield stream
    except FileNotFoundError:
        raise ReadError("IO001", "no such file", SourceRef(str(path))) from None
    except OSError as problem:
        reason = problem.strerror or type(problem).__name__
        raise ReadError("IO002", f"cannot be read: {reason}", SourceRef(str(path))) from None


@contextmanager
def spooled(path: str | Path) -> Iterator[None]:
    """Let a pipe be opened several times within the block: what it says is kept till its end."""
    if str(path) not in _SPOOLED:
        with open_input(path) as stream:
            if isinstance(stream, io.BytesIO):
                _SPOOLED[str(path)] = stream.getvalue()
    try:
        yield
    finally:
        _SPOOLED.pop(str(path), None)


def _is_pipe(path: str | Path) -> bool:
    """Return whether a path is neither a file nor a folder: a pipe, a terminal, a device."""
    mode = os.stat(path).st_mode  # noqa: PTH116 - the path stays as it was given
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _piped(path: str | Path) -> bytes:
    """Return all that a pipe says until it is closed."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    parts: list[bytes] = []
    size = 0
    try:
        while True:
            if not select.select([handle], [], [], PIPE_SILENCE)[0]:
                text = f"a pipe from which nothing came for {PIPE_SILENCE:g} s"
                raise ReadError("IO016", text, SourceRef(str(path)))
            part = os.read(handle, 1 << 20)
            if not part:
                return b"".join(parts)
            parts.append(part)
            size += len(part)
            if size > MOST_PIPED:
                text = f"a pipe that says more than {MOST_PIPED} bytes"
                raise ReadError("IO016", text, SourceRef(str(path)))
    finally:
        os.close(handle)


def write_files(contents: Mapping[Path, bytes], *, durable: bool = False) -> None:
    """Write all files or none: each beside its target first, then renamed.

    Missing folders are made. On any failure (IO003) the temporary files are removed and no target
    that was not yet renamed has changed. ``durable``: the content is on the disk before the name
    is, so that a power loss leaves the old file or the new one.
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
    """Remove files, those that are gone already included; IO003 if one cannot be removed."""
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as problem:
            reason = problem.strerror or type(problem).__name__
            raise ReadError("IO003", f"cannot be removed: {reason}", SourceRef(str(path))) from None


def shown_from(given: str | Path, path: Path) -> str:
    """Return how a message names a file: from where the user stands, as ``given`` was named.

    ``given``: the file that leads to it (the cell); one outside its folder is named whole.
    """
    folder = Path(given).parent
    whole = folder.resolve()
    return str(folder / path.relative_to(whole) if path.is_relative_to(whole) else path)


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
