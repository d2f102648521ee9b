"""One batch per output folder at a time; a killed batch leaves no lasting lock."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

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
        stream = _locked(path)
        stream.truncate(0)
        stream.write(f"pid {os.getpid()}, since {time.strftime('%Y-%m-%d %H:%M:%S')}\n")
        stream.flush()
    except BlockingIOError:
        raise DataError(
            "BAT011", f"a batch already runs here: {_owner(path)}", SourceRef(str(folder))
        ) from None
    except OSError as problem:
        raise DataError(
            "BAT012", f"cannot be written: {problem.strerror}", SourceRef(str(folder))
        ) from None
    with stream:
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _locked(path: Path) -> TextIO:
    """Return the lock file, opened and locked."""
    while True:
        stream = path.open("a", encoding="ascii")
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            stream.close()
            raise
        # the batch before may have removed the file between our opening and locking it
        with suppress(FileNotFoundError):
            if os.fstat(stream.fileno()).st_ino == path.stat().st_ino:
                return stream
        stream.close()


def _owner(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip() or "another process"
    except OSError:
        return "another process"
