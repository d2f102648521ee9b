"""One batch per output folder at a time; a killed batch leaves no lasting lock."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from postproc.errors import DataError, SourceRef

NAME = ".postproc-lock"


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Hold the folder for this process.

    The lock is the system's own on an open file, so it ends with the process however that ends.

    Raises:
        DataError: BAT011 if another batch holds it (with its pid and start), BAT012 if the folder
            cannot be written.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, blocking=False).acquire().lock
    except Timeout:
        raise DataError(
            "BAT011", f"a batch already runs here: {_owner(path)}", SourceRef(str(folder))
        ) from None
    except OSError as problem:
        raise DataError(
            "BAT012", f"cannot be written: {problem.strerror}", SourceRef(str(folder))
        ) from None
    with suppress(OSError):  # some systems let nobody write a locked file
        path.write_text(f"pid {os.getpid()}, since {time.strftime('%Y-%m-%d %H:%M:%S')}\n", "ascii")
    try:
        yield
    finally:
        with suppress(OSError):  # some systems keep a file that is open
            path.unlink()
        lock.release()


def _owner(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip() or "another process"
    except OSError:
        return "another process"
