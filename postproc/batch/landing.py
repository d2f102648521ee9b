"""How results come into the output folder: whole, noted, and never one over another's files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from postproc.batch.jobs import source_of
from postproc.batch.manifest import Manifest
from postproc.batch.worker import JobResult
from postproc.emitters import Former, former_parts
from postproc.errors import PostprocError
from postproc.files import write_files


class Landing:
    """Puts results in place, one at a time, whatever the order in which they come.

    A program belongs to the first job, in the order of the batch, that makes a program of this
    name in any case: a later job fails, although it may have come first.

    Args:
        manifest: of the folder.
        keys: of all jobs, in order.
        owned: files of programs that do not belong to this batch, with the key of each.
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

        Returns:
            The result, or an error: BAT013 if another job has a program of this name, IO003 if the
            files cannot be written.
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
