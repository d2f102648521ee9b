"""``manifest.json``: what was made from what, so that a second run redoes only what changed.

While a batch runs every result is appended to a journal; the manifest is written from both at the
end (and at the start of a run that finds a journal left by one that was killed). Neither holds a
time or a duration: the same inputs give the same manifest. One batch at a time holds the folder; a
killed one leaves no lasting lock.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from postproc.batch.child import JobResult
from postproc.batch.fingerprint import UNREADABLE, digest
from postproc.batch.jobs import source_of
from postproc.emitters import Former, former_parts
from postproc.errors import DataError, PostprocError, SourceRef
from postproc.files import leftovers, write_files
from postproc.records import dataclass

SCHEMA = "postproc.manifest/1"
NAME = "manifest.json"
JOURNAL = ".postproc-journal"
LOCK = ".postproc-lock"
_OF_THE_RUN = re.compile(r"error (BAT\d+|IO00\d|PLG\d+):")
"""Errors of what was around an input, such as an extra that is missing, not of the input."""
_KEYS = {"status", "program", "tags", "cycle_time_s", "files", "errors", "fingerprint"}


@dataclass(slots=True)
class Manifest:
    """Entries by job key; each: fingerprint, status, program, files with hashes, tags, findings."""

    folder: Path
    entries: dict[str, dict[str, Any]] = field(default_factory=dict)

    @classmethod
    def load(cls, folder: Path) -> Manifest:
        """Read the manifest of a folder and the journal of a run that was cut off."""
        manifest = cls(folder)
        path = folder / NAME
        if path.exists():
            manifest.entries = _entries(path)
        manifest._replay()
        return manifest

    def begin(self) -> None:
        """Clear away what a run that was cut off has left: its journal and temporary files."""
        if (self.folder / JOURNAL).exists():
            self.save()  # a new line must not be written behind a torn one
        for path in leftovers(self.folder):
            path.unlink(missing_ok=True)

    def _replay(self) -> None:
        path = self.folder / JOURNAL
        if not path.exists():
            return
        for line in path.read_bytes().split(b"\n"):
            # the last line of a killed run may be cut off: it never counted
            with suppress(ValueError, KeyError, TypeError):
                entry = json.loads(line)
                if _is_entry(entry["entry"]):
                    self.entries[entry["key"]] = entry["entry"]

    @property
    def programs(self) -> dict[str, str]:
        """Names of the programs in the folder by job key."""
        return {key: entry["program"] for key, entry in self.entries.items() if entry["files"]}

    def is_current(self, key: str, marks: Mapping[str, str]) -> bool:
        """Return whether a job would end as it did: made from the same, and still in place."""
        entry = self.entries.get(key)
        if entry is None or not _is_final(entry) or entry["fingerprint"] != dict(marks):
            return False
        if UNREADABLE in marks.values():
            return False
        return all(_hash(self.folder / name) == want for name, want in entry["files"].items())

    def record(
        self, result: JobResult, marks: Mapping[str, str], files: Mapping[str, bytes]
    ) -> None:
        """Note a result in memory and in the journal; the files must be in place already."""
        entry = {
            "status": result.status,
            "program": result.name,
            "tags": result.tags,
            "cycle_time_s": result.cycle_time,
            "files": {name: digest(content) for name, content in sorted(files.items())},
            "errors": list(result.errors),
            "warnings": list(result.warnings) if result.status == "ok" else [],
            "fingerprint": dict(marks),
            **{name: dict(known) for name, known in result.about.items()},
        }
        self.entries[result.key] = entry
        self._append(json.dumps({"key": result.key, "entry": entry}).encode() + b"\n")

    def _append(self, line: bytes) -> None:
        """Add a line to the journal; on a full disk none, then a killed run redoes this result."""
        with suppress(OSError), (self.folder / JOURNAL).open("ab", 0) as stream:
            before = stream.tell()
            try:
                if stream.write(line) == len(line):
                    os.fsync(stream.fileno())
                else:
                    stream.truncate(before)
            except OSError:
                stream.truncate(before)

    def save(self) -> None:
        """Write the manifest whole and drop the journal."""
        write_files({self.folder / NAME: self.to_bytes()}, durable=True)
        (self.folder / JOURNAL).unlink(missing_ok=True)

    def to_bytes(self) -> bytes:
        """Return the manifest's text, keys in order."""
        document = {"schema": SCHEMA, "entries": self.entries}
        # a file name may hold bytes that are no text: only ASCII can say so
        return (json.dumps(document, indent=1, sort_keys=True) + "\n").encode()


def _is_final(entry: Mapping[str, Any]) -> bool:
    """Return whether a result follows from input and options alone; a limit or a crash does not."""
    if entry["status"] not in ("ok", "failed", "error"):
        return False
    return not any(_OF_THE_RUN.search(line) for line in entry["errors"])


def _hash(path: Path) -> str:
    try:
        return digest(path.read_bytes())
    except OSError:
        return ""


def _entries(path: Path) -> dict[str, dict[str, Any]]:
    try:
        document = json.loads(path.read_bytes())
    except ValueError:
        document = None
    entries = document.get("entries") if isinstance(document, dict) else None
    if not isinstance(entries, dict) or document.get("schema") != SCHEMA:
        raise DataError("BAT010", "not a manifest of a batch", SourceRef(str(path)))
    for key, entry in entries.items():
        if not _is_entry(entry):
            raise DataError("BAT010", f"the entry of {key!r} is damaged", SourceRef(str(path)))
    return entries


def _is_entry(entry: Any) -> bool:  # noqa: ANN401 - whatever the file holds
    """Return whether this can be an entry; its files are in the folder and nowhere else."""
    if not isinstance(entry, dict) or not entry.keys() >= _KEYS:
        return False
    files = entry["files"]
    return isinstance(files, dict) and all(
        name not in {"", ".."} and Path(name).name == name for name in files
    )


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Hold the folder for this process, or raise BAT011, BAT012.

    The lock is the system's own on an open file, so it ends with the process however that ends.
    """
    path = folder / LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, blocking=False).acquire().lock
    except Timeout:
        text = f"a batch already runs here: {_owner(path)}"
        raise DataError("BAT011", text, SourceRef(str(folder))) from None
    except OSError as problem:
        text = f"cannot be written: {problem.strerror}"
        raise DataError("BAT012", text, SourceRef(str(folder))) from None
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


class Landing:
    """Puts results in place, one at a time, whatever the order in which they come.

    A program belongs to the first job, in the order of the batch, that makes a program of this name
    in any case: a later job fails, although it may have come first. ``owned``: files of programs
    that do not belong to this batch, with the key of each.
    """

    def __init__(self, manifest: Manifest, keys: Sequence[str], owned: Mapping[str, str]) -> None:
        self.manifest = manifest
        self.removed: list[str] = []
        """Files that an earlier result or program has left, and that are no more."""
        self._order = {key: number for number, key in enumerate(keys)}
        self._claims: dict[str, set[str]] = {}
        for name, key in owned.items():
            self._claims.setdefault(name.upper(), set()).add(key)

    def keep(self, keys: Iterable[str]) -> None:
        """Count the files of entries that are current."""
        for key in keys:
            self._claim(key, self.manifest.entries[key]["files"])

    def land(self, result: JobResult, marks: Mapping[str, str]) -> JobResult:
        """Put a result's files in place, or remove those of an earlier result, and note it.

        Returns the result, or an error: BAT013 if another job has a program of this name, IO003 if
        the files cannot be written.
        """
        key, number = result.key, self._order[result.key]
        rivals = self._claim(key, result.files)
        first = min(rivals, key=self._number, default=key)
        if self._number(first) < number:
            result = _clash(result, result.name, first)
        for rival in sorted(rivals, key=self._number):
            if self._number(rival) > number and self.manifest.entries[rival]["files"]:
                self._displace(rival, key)
        before = self.manifest.entries.get(key, {}).get("files", {})
        folder = self.manifest.folder
        former = Former()
        try:
            former = former_parts(folder, result.name, result.files)
            write_files({folder / name: content for name, content in result.files.items()})
        except PostprocError as problem:
            result = replace(result, status="error", files={}, errors=(str(problem),))
            former = Former()
        stay = tuple(str(finding) for finding in former.findings(folder))
        result = replace(result, warnings=(*result.warnings, *stay))
        gone = {*before, *former.ours} - {*result.files, *former.foreign}
        self._drop(key, gone)
        self.manifest.record(result, marks, result.files)
        return result

    def _claim(self, key: str, files: Iterable[str]) -> set[str]:
        """Note who makes files of these names; return the others that do."""
        rivals: set[str] = set()
        for name in files:
            claims = self._claims.setdefault(name.upper(), set())
            rivals |= claims
            claims.add(key)
        return rivals - {key}

    def _number(self, key: str) -> int:
        """Return a job's place; what does not belong to this batch was there before all."""
        return self._order.get(key, -1)

    def _displace(self, key: str, winner: str) -> None:
        entry = self.manifest.entries[key]
        lost = _clash(JobResult(key, "error", tags=entry["tags"]), entry["program"], winner)
        self._drop(key, entry["files"])
        self.manifest.record(lost, entry["fingerprint"], {})

    def _drop(self, key: str, names: Iterable[str]) -> None:
        """Remove files that no other entry has now."""
        entries = self.manifest.entries
        for name in sorted(names):
            others = self._claims.get(name.upper(), set()) - {key}
            if not any(name in entries.get(other, {"files": ()})["files"] for other in others):
                path = self.manifest.folder / name
                self.removed += [name] if path.exists() else []
                path.unlink(missing_ok=True)


def _clash(result: JobResult, program: str, first: str) -> JobResult:
    what = f"its program {program} has the name of a program of {first}"
    line = f"{source_of(result.key)}:1: error BAT013: {what}"
    hint = "give one of them another name in a batch.toml"
    return replace(
        result, status="error", name="", files={}, errors=(f"{line}\n    hint: {hint}",),
        cycle_time=0.0, about={},
    )  # fmt: skip
