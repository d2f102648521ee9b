"""One batch per output folder at a time; a killed batch leaves no lasting lock."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
        stream = path.open("a+", encoding="ascii")
    except OSError as problem:
        raise DataError(
            "BAT012", f"cannot be written: {problem.strerror}", SourceRef(str(folder))
        ) from None
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            stream.seek(0)
            owner = stream.read().strip() or "another process"
            raise DataError(
                "BAT011", f"a batch already runs here: {owner}", SourceRef(str(folder))
            ) from None
        stream.truncate(0)
        stream.write(f"pid {os.getpid()}, since {time.strftime('%Y-%m-%d %H:%M:%S')}\n")
        stream.flush()
        try:
            yield
        finally:
            path.unlink(missing_ok=True)
