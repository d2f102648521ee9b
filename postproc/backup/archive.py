"""The files of a controller backup: a ZIP or a folder, wherever the user points, hostile or not.

Files are found by the tail of their path whatever its case, so an archive of the controller, the
unpacked one, a KrcDiag, a WorkVisual folder and R1 alone are read the same way. Nothing is ever
unpacked to the disk; what is read has a budget.
"""

from __future__ import annotations

import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path, PurePosixPath

from postproc.errors import ReadError, SourceRef
from postproc.records import dataclass

MOST_FILES = 200_000
MOST_BYTES = 8 * 1024 * 1024
"""Of one file; the largest data list seen has half a megabyte."""
MOST_BYTES_IN_ALL = 64 * 1024 * 1024
MOST_RATIO = 300
"""Largest size of a file by its packed size; text of controllers has 10 to 30."""
_SMALL = 1024 * 1024
_BROKEN = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, RuntimeError,
    ValueError, OSError,
)  # fmt: skip


@dataclass(slots=True)
class Archive:
    """The files of a backup by their path with ``/``; ``read`` keeps the budget."""

    path: Path
    sizes: Mapping[str, int]
    _zip: zipfile.ZipFile | None = None
    _packed: Mapping[str, zipfile.ZipInfo] = field(default_factory=dict)
    _read: dict[str, bytes] = field(default_factory=dict)

    def names(self, *tail: str) -> list[str]:
        """Return the files whose path ends with these parts, whatever their case."""
        wanted = [part.lower() for part in tail]
        return [
            name
            for name in self.sizes
            if [part.lower() for part in PurePosixPath(name).parts[-len(wanted) :]] == wanted
        ]

    def place(self, name: str) -> str:
        """Return the path of a file as messages name it."""
        return f"{self.path}/{name}"

    def read(self, name: str) -> bytes:
        """Return the content of a file that is not too large to be of a controller."""
        if name not in self._read:
            left = MOST_BYTES_IN_ALL - sum(map(len, self._read.values()))
            most = min(MOST_BYTES, left)
            content = self._content(name, most + 1)
            if len(content) > most:
                raise ReadError("BAK003", self._too_large(), SourceRef(self.place(name)))
            self._read[name] = content
        return self._read[name]

    def _content(self, name: str, most: int) -> bytes:
        try:
            if self._zip is None:
                with (self.path.parent / name).open("rb") as stream:
                    return stream.read(most)
            with self._zip.open(self._packed[name]) as stream:
                return stream.read(most)
        except _BROKEN as problem:
            reason = " ".join(str(problem).split()) or type(problem).__name__
            text = f"cannot be unpacked: {reason}, expected a whole archive"
            raise ReadError("BAK004", text, SourceRef(self.place(name))) from None

    def _too_large(self) -> str:
        return (
            f"more than {MOST_BYTES >> 20} MB in a file or {MOST_BYTES_IN_ALL >> 20} MB in all: "
            "not a controller backup"
        )


def open_archive(path: str | Path) -> Archive:
    """Return the files of a ZIP or folder; BAK001 to BAK004 for one that cannot be trusted."""
    place = Path(path)
    if place.is_dir():
        return Archive(place.absolute(), dict(_files_of(place.absolute())))
    if not place.exists():
        raise ReadError("IO001", "no such file or folder", SourceRef(str(path)))
    return _open_zip(place)


def _files_of(folder: Path) -> Iterator[tuple[str, int]]:
    """Yield path and size of every file below a folder, the name of the folder in front."""
    count = 0
    for root, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            file = Path(root) / name
            state = file.lstat()
            count += 1
            if count > MOST_FILES:
                text = f"more than {MOST_FILES} files: not the folder of one backup"
                raise ReadError("BAK003", text, SourceRef(str(folder)))
            if stat.S_ISREG(state.st_mode):  # no links: they may lead anywhere
                yield file.relative_to(folder.parent).as_posix(), state.st_size


def _open_zip(path: Path) -> Archive:
    source = SourceRef(str(path))
    try:
        opened = zipfile.ZipFile(path)
        entries = opened.infolist()
    except _BROKEN as problem:
        reason = " ".join(str(problem).split()) or type(problem).__name__
        text = f"neither a folder nor a whole ZIP archive: {reason}"
        raise ReadError("BAK001", text, source) from None
    if len(entries) > MOST_FILES:
        raise ReadError("BAK003", f"{len(entries)} files: not a controller backup", source)
    packed: dict[str, zipfile.ZipInfo] = {}
    for entry in entries:
        if not entry.is_dir():
            name = _safe_name(entry, source)
            if name in packed:
                raise ReadError("BAK002", f"two files are named {_shown(name)}", source)
            packed[name] = entry
    sizes = {name: entry.file_size for name, entry in packed.items()}
    return Archive(path, sizes, opened, packed)


def _safe_name(entry: zipfile.ZipInfo, source: SourceRef) -> str:
    name, shown = entry.filename.replace("\\", "/"), _shown(entry.filename)
    parts = PurePosixPath(name).parts
    if ".." in parts or name.startswith("/") or (parts and parts[0].endswith(":")):
        raise ReadError("BAK002", f"the path {shown} leads out of the archive", source)
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise ReadError("BAK002", f"{shown} is a link, expected files", source)
    if entry.file_size > _SMALL and entry.file_size > MOST_RATIO * max(entry.compress_size, 1):
        text = f"{shown} unpacks to {entry.file_size} bytes, {MOST_RATIO} times its size and more"
        raise ReadError("BAK003", f"{text}: not a controller backup", source)
    return "/".join(parts)  # without the ./ that some tools write in front


def _shown(name: str) -> str:
    return repr(name if len(name) <= 80 else f"{name[:77]}...")
