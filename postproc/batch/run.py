"""A batch from start to end: what is current is kept, the rest is redone, results land whole."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from postproc.batch.child import JobResult
from postproc.batch.executors import run_dask, run_local
from postproc.batch.fingerprint import digest, fingerprint, forget
from postproc.batch.jobs import (
    Job,
    Overrides,
    find_inputs,
    load_overrides,
    make_jobs,
    source_of,
    uniquely_named,
)
from postproc.batch.manifest import Landing, Manifest, folder_lock
from postproc.batch.sections import Caller, Work, caller_program, expand, parse_rule
from postproc.errors import PostprocError, UsageError
from postproc.files import write_files
from postproc.jobs.convert import ConvertRequest
from postproc.records import dataclass

Progress = Callable[[int, int, int], None]
"""Called with (done, of how many, how many of them failed)."""
_MARK = 8
"""Characters that tell pages of inputs of one name apart."""
_CODE = re.compile(r"warning ([\w-]+):")


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """How a batch runs; None means no limit, and a worker for each core.

    ``pages``: the folder of a page for each input, which ``page_file`` names; None: no pages.
    """

    workers: int | None = None
    dask: str | None = None
    force: bool = False
    prune: bool = False
    timeout: float | None = None
    memory: float | None = None
    split: str | None = None
    pages: Path | None = None


@dataclass(slots=True)
class BatchOutcome:
    """What a batch did, by job key.

    ``vanished``: outputs whose input is gone; ``removed``: files that earlier programs of inputs
    of this batch have left; ``unsaved``: why the manifest could not be written.
    """

    manifest: Manifest
    keys: list[str]
    done: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    vanished: list[str] = field(default_factory=list)
    pruned: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    unsaved: str = ""

    @property
    def bad(self) -> list[str]:
        """Keys of this batch whose last result is not good."""
        entries = self.manifest.entries
        return [key for key in self.keys if entries[key]["status"] != "ok"]

    @property
    def converted(self) -> list[str]:
        """Keys whose program was made anew and is good."""
        bad = set(self.bad)
        return [key for key in self.done if key not in bad]

    @property
    def unchanged(self) -> list[str]:
        """Keys whose good program stays: neither input nor options have changed."""
        bad = set(self.bad)
        return [key for key in self.kept if key not in bad]

    @property
    def good(self) -> bool:
        """Whether every input of this batch has a good program, and the manifest says so."""
        return not self.bad and not self.unsaved

    def warnings(self) -> list[str]:
        """Return one line for each kind of warning: the first, and how many programs have it."""
        first: dict[str, str] = {}
        count: Counter[str] = Counter()
        for key in self.keys:
            lines = self.manifest.entries[key].get("warnings", ())
            kinds = {_kind(line): line for line in reversed(lines)}
            first = kinds | first
            count.update(list(kinds))
        more = {kind: f"\n    in {n} programs" if n > 1 else "" for kind, n in count.items()}
        return [first[kind] + more[kind] for kind in sorted(first)]

    def document(self) -> dict[str, Any]:
        """Return the ``postproc.batch_result/1`` document."""
        return {
            "schema": "postproc.batch_result/1",
            "inputs": len(self.keys),
            "done": len(self.done),
            "converted": len(self.converted),
            "kept": len(self.unchanged),
            "not_retried": len(self.kept) - len(self.unchanged),
            "failed": self.bad,
            "vanished": self.vanished,
            "pruned": self.pruned,
            "removed": self.removed,
            "entries": {key: self.manifest.entries[key] for key in self.keys},
        }


def run_batch(
    jobs: Sequence[Job], folder: Path, options: BatchOptions, progress: Progress | None = None
) -> BatchOutcome:
    """Bring a folder up to date with its jobs; the manifest and all good programs are in place.

    ``progress`` is called with (done, total, failed).
    """
    with folder_lock(folder):
        forget()
        manifest = Manifest.load(folder)
        manifest.begin()
        work = expand(uniquely_named(jobs, manifest.programs), options.split)
        outcome = BatchOutcome(manifest, work.keys)
        landing = Landing(manifest, work.keys, _owned(manifest, work))
        _convert(work, landing, outcome, options, progress or (lambda *_: None))
        for caller in work.callers:
            _land_caller(landing, caller, outcome)
        _sweep(outcome, options.prune)
        outcome.removed = sorted({*outcome.removed, *landing.removed})
        try:
            manifest.save()
        except PostprocError as problem:  # the journal still holds what was done
            outcome.unsaved = str(problem)
    return outcome


def _convert(
    work: Work, landing: Landing, outcome: BatchOutcome, options: BatchOptions, progress: Progress
) -> None:
    """Do all jobs that are not current."""
    manifest = landing.manifest
    marks = {job.key: fingerprint(job) for job in work.jobs}
    if not options.force:
        outcome.kept = [key for key in marks if manifest.is_current(key, marks[key])]
    landing.keep(outcome.kept)
    for result in work.broken:
        landing.land(result, {})
    kept = set(outcome.kept)
    redo = [job for job in work.jobs if job.key not in kept]
    total, failed = len(redo) + len(work.broken), len(work.broken)
    redo = [replace(job, paged=options.pages is not None) for job in redo]
    for result in execute(redo, options):
        if options.pages and result.page:
            write_files({page_file(options.pages, result.key): result.page})
        failed += landing.land(result, marks[result.key]).status != "ok"
        outcome.done.append(result.key)
        progress(len(outcome.done) + len(work.broken), total, failed)


def page_file(folder: Path, key: str) -> Path:
    """Return the file of the page of an input."""
    return folder / f"{Path(source_of(key)).stem}-{digest(key.encode())[:_MARK]}.html"


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def execute(jobs: list[Job], options: BatchOptions) -> Iterator[JobResult]:
    """Return the results of jobs as they come."""
    if not jobs:
        return iter(())
    if options.dask:
        return run_dask(jobs, options.dask, options.timeout, options.memory)
    workers = options.workers or cores()
    return run_local(jobs, workers, options.timeout, options.memory)


def called(caller: Caller, programs: list[str]) -> JobResult:
    """Return the program that calls the sections' programs; "" stands for one that failed."""
    missing = programs.count("")
    source = caller.job.request.source
    if missing:
        line = f"{source}:1: error BAT015: {missing} of {len(programs)} sections failed"
        return JobResult(caller.job.key, "failed", errors=(f"{line}: no program calls them",))
    name = str(caller.job.request.name)
    files = caller_program(caller.job.request, programs).files
    return JobResult(caller.job.key, "ok", name, files)


def _land_caller(landing: Landing, caller: Caller, outcome: BatchOutcome) -> None:
    entries = [landing.manifest.entries[key] for key in caller.sections]
    programs = [entry["program"] if entry["status"] == "ok" else "" for entry in entries]
    marks = {"sections": digest("\n".join([str(caller.job.request.name), *programs]).encode())}
    key = caller.job.key
    if landing.manifest.is_current(key, marks):
        landing.keep([key])
        outcome.kept.append(key)
        return
    landing.land(called(caller, programs), marks)
    outcome.done.append(key)


def _owned(manifest: Manifest, work: Work) -> dict[str, str]:
    """Return files of inputs that are not of this batch but still there, with their keys."""
    mine, given = set(work.keys), _places(work.keys)
    others = [key for key in manifest.entries if key not in mine and not _is_gone(key, given)]
    return {name: key for key in others for name in manifest.entries[key]["files"]}


def _places(keys: Sequence[str]) -> set[str]:
    return {os.path.abspath(source_of(key)) for key in keys}  # noqa: PTH100 - links stay links


def _is_gone(key: str, given: set[str]) -> bool:
    """Return whether an entry's input is gone, or is in this batch under another key."""
    place = os.path.abspath(source_of(key))  # noqa: PTH100 - links stay links
    return place in given or not os.path.lexists(place)


def vanished(manifest: Manifest, keys: Sequence[str]) -> dict[str, list[str]]:
    """Return entries whose input is gone, each with those of its files that no job makes now."""
    keep = {f for key in keys for f in manifest.entries.get(key, {"files": ()})["files"]}
    mine, given = set(keys), _places(keys)
    gone = sorted(k for k in manifest.entries if k not in mine and _is_gone(k, given))
    return {key: [f for f in manifest.entries[key]["files"] if f not in keep] for key in gone}


def _kind(line: str) -> str:
    """Return the code of a line of warning."""
    found = _CODE.search(line)
    return found[1] if found else line


def _sweep(outcome: BatchOutcome, prune: bool) -> None:
    """Remove what inputs of this batch made under keys that they no longer have (sections)."""
    manifest, given = outcome.manifest, _places(outcome.keys)
    for key, files in vanished(manifest, outcome.keys).items():
        is_ours = os.path.abspath(source_of(key)) in given  # noqa: PTH100 - links stay links
        (outcome.removed if is_ours else outcome.vanished).extend(files)
        if prune or is_ours:
            for name in files:
                with suppress(OSError):
                    (manifest.folder / name).unlink(missing_ok=True)
            outcome.pruned += [] if is_ours else files
            del manifest.entries[key]


def call_of(
    inputs: Sequence[str], base: ConvertRequest, options: BatchOptions, config: str | None = None
) -> tuple[list[Job], list[str]]:
    """Return the jobs of a call that can give programs, and remarks on its options.

    ``inputs``: files, folders, globs, ``@LIST``; ``base``: cell and options of all of them.
    """
    overrides = load_overrides(config) if config else Overrides({})
    sources = find_inputs(inputs)
    jobs = make_jobs(sources, base, overrides)
    if options.split:
        parse_rule(options.split)
    require_call(jobs)
    unused = overrides.unused(sources)
    return jobs, [f"{config}:1: warning BAT005: match = {p!r}: no such input" for p in unused]


def require_call(jobs: Sequence[Job]) -> None:
    """Look at the cells, models and options of all jobs.

    What is wrong for every input is raised; else the inputs concerned fail by themselves.
    """
    calls = {}
    for job in jobs:
        request = job.request
        if not request.cell:
            text = f"no cell for {request.source}, give --cell or set it in --config"
            raise UsageError("BAT004", text)
        calls[request.cell, *sorted(request.keys.items()), request.model] = job
    problem: PostprocError | None = None
    for job in calls.values():
        try:
            _try(job)
        except PostprocError as error:
            problem = problem or error
        else:
            return
    if problem:
        raise problem


def _try(job: Job) -> None:
    from postproc.planning import settle

    request = job.request
    settle(request.cell_with_keys())
    if request.model:
        from postproc.model import load_model

        load_model(request.model)
