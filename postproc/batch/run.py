"""A batch from start to end: what is current is kept, the rest is redone, results land whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.batch.executors import run_dask, run_local
from postproc.batch.fingerprint import fingerprint, forget
from postproc.batch.jobs import Job
from postproc.batch.lock import folder_lock
from postproc.batch.manifest import Manifest
from postproc.batch.sections import caller_program, parse_rule, split_job
from postproc.batch.worker import JobResult
from postproc.errors import PostprocError
from postproc.files import write_files

if TYPE_CHECKING:
    from postproc.verification.diff import DiffReport

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """How a batch runs; None means no limit."""

    workers: int = 1
    dask: str | None = None
    force: bool = False
    prune: bool = False
    timeout: float | None = None
    memory: float | None = None
    split: str | None = None


@dataclass(slots=True)
class BatchOutcome:
    """What a batch did, by job key; ``vanished``: outputs whose input is gone."""

    manifest: Manifest
    keys: list[str]
    done: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    vanished: list[str] = field(default_factory=list)
    pruned: list[str] = field(default_factory=list)

    @property
    def bad(self) -> list[str]:
        """Keys of this batch whose last result is not good."""
        entries = self.manifest.entries
        return [key for key in self.keys if entries[key]["status"] != "ok"]

    @property
    def good(self) -> bool:
        """Whether every input of this batch has a good program."""
        return not self.bad

    def document(self) -> dict[str, Any]:
        """Return the ``postproc.batch/1`` result document."""
        return {
            "schema": "postproc.batch_result/1",
            "inputs": len(self.keys),
            "done": len(self.done),
            "kept": len(self.kept),
            "failed": self.bad,
            "vanished": self.vanished,
            "pruned": self.pruned,
            "entries": {key: self.manifest.entries[key] for key in self.keys},
        }


def run_batch(
    jobs: Sequence[Job],
    folder: Path,
    options: BatchOptions,
    progress: Progress | None = None,
) -> BatchOutcome:
    """Bring a folder up to date with its jobs.

    Args:
        jobs: what shall be there.
        folder: output folder; holds ``manifest.json``.
        options: workers, limits, what to redo.
        progress: called with (done, total, "n failed").

    Returns:
        What was done; the manifest and all good programs are in place.

    Raises:
        DataError: if another batch holds the folder or it cannot be written.
    """
    with folder_lock(folder):
        forget()
        manifest = Manifest.load(folder)
        todo, broken, callers = expand(jobs, options.split)
        marks = {job.key: fingerprint(job) for job in todo}
        outcome = BatchOutcome(manifest, [*(job.key for job in todo), *(r.key for r in broken)])
        outcome.kept = [k for k in marks if not options.force and manifest.is_current(k, marks[k])]
        redo = [job for job in todo if job.key not in set(outcome.kept)]
        for result in broken:
            _land(manifest, result, {})
        failed = len(broken)
        for result in _execute(redo, options):
            _land(manifest, result, marks[result.key])
            outcome.done.append(result.key)
            failed += result.status != "ok"
            if progress:
                progress(len(outcome.done), len(redo), f"{failed} failed")
        _write_callers(manifest, callers)
        _sweep(outcome, options.prune)
        manifest.save()
    return outcome


def expand(
    jobs: Sequence[Job], split: str | None
) -> tuple[list[Job], list[JobResult], dict[str, list[Job]]]:
    """Return jobs cut into sections, results of inputs that cannot be read, and the callers."""
    if split is None:
        return list(jobs), [], {}
    from postproc.model.cellfile import load_cell
    from postproc.pipeline.convert import read_toolpath

    rule = parse_rule(split)
    parts: list[Job] = []
    broken: list[JobResult] = []
    callers: dict[str, list[Job]] = {}
    for job in jobs:
        try:
            path = read_toolpath(job.request, load_cell(job.request.cell))
            sections = split_job(job, path, rule)
        except PostprocError as error:
            broken.append(JobResult(job.key, "error", errors=(str(error),)))
            continue
        parts += sections
        callers[str(job.request.name)] = sections
    return parts, broken, callers


def _execute(jobs: list[Job], options: BatchOptions) -> Iterator[JobResult]:
    if not jobs:
        return iter(())
    if options.dask:
        return run_dask(jobs, options.dask)
    return run_local(jobs, options.workers, options.timeout, options.memory)


def _land(manifest: Manifest, result: JobResult, marks: dict[str, str]) -> None:
    """Put a result's files in place, or remove those of an earlier good result, and note it."""
    folder = manifest.folder
    before = manifest.entries.get(result.key, {}).get("files", {})
    write_files({folder / name: content for name, content in result.files.items()})
    for name in set(before) - set(result.files):
        (folder / name).unlink(missing_ok=True)
    manifest.record(result, marks, result.files)


def _write_callers(manifest: Manifest, callers: dict[str, list[Job]]) -> None:
    contents: dict[Path, bytes] = {}
    for name, sections in callers.items():
        entries = [manifest.entries[job.key] for job in sections]
        if all(entry["status"] == "ok" for entry in entries):
            for file, content in caller_program(name, [e["program"] for e in entries]).items():
                contents[manifest.folder / file] = content
    write_files(contents)


def _sweep(outcome: BatchOutcome, prune: bool) -> None:
    """List outputs whose input is gone; remove them only when asked."""
    manifest = outcome.manifest
    keep = {f for key in outcome.keys for f in manifest.entries[key]["files"]}
    for key in sorted(set(manifest.entries) - set(outcome.keys)):
        files = [f for f in manifest.entries[key]["files"] if f not in keep]
        outcome.vanished += files
        if prune:
            for name in files:
                (manifest.folder / name).unlink(missing_ok=True)
            outcome.pruned += files
            del manifest.entries[key]


def check_batch(
    jobs: Sequence[Job], folder: Path, options: BatchOptions
) -> tuple[dict[str, dict[str, Any]], dict[str, DiffReport]]:
    """Make everything anew in memory and compare it with what stands in the folder.

    Returns:
        Entries by key (status ``ok``, ``different`` or the failure) and the semantic differences
        by program file. Nothing is written.
    """
    from postproc.verification.diff import diff_bytes

    parts, broken, _ = expand(jobs, options.split)
    entries: dict[str, dict[str, Any]] = {}
    reports: dict[str, DiffReport] = {}
    for result in [*broken, *_execute(parts, options)]:
        errors = list(result.errors)
        status = result.status
        for name, content in sorted(result.files.items()):
            path = folder / name
            old = path.read_bytes() if path.is_file() else None
            if old == content:
                continue
            status = "different"
            errors.append(f"{path}:1: {'differs' if old else 'is missing'}")
            if old and name.endswith(".src"):
                reports[name] = diff_bytes(old, content, name)
        entries[result.key] = {"status": status, "errors": errors}
    return entries, reports
