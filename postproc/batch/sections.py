"""Large point clouds in several programs: by region of the part, by operation, or by count.

Names depend on where a section lies, not on how many came before, so that one more hole changes
the program of its own region only (``count`` cannot promise that).
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace

import numpy as np

from postproc.arrays import IndexArray, IntArray
from postproc.batch.child import JobResult, attempt
from postproc.batch.jobs import Job, unique_name
from postproc.emitters import Program, emitter_of
from postproc.errors import DataError, SourceRef
from postproc.jobs.convert import ConvertRequest
from postproc.krl import legal_name
from postproc.model import CUTS, Event, EventKind, MotionKind, ToolPath
from postproc.records import dataclass
from postproc.units import MM

_FREE = (MotionKind.RAPID, MotionKind.HOLE, MotionKind.JOINT)
"""Motions that do not need to begin where the one before ended."""
_STATES = (
    (EventKind.TOOL_CHANGE,),
    (EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF),
    (EventKind.COOLANT_ON, EventKind.COOLANT_OFF),
)
_OFF = (EventKind.SPINDLE_OFF, EventKind.COOLANT_OFF)
_NAME, _LABEL = 20, 13
"""Longest name and label: room for the numbers of sub-programs behind it, a stem before it."""


def parse_rule(text: str) -> tuple[str, float]:
    """Return (kind, size) of ``region:MM``, ``count:N`` or ``operation``."""
    match = re.fullmatch(r"(region):(\d+(?:\.\d+)?)|(count):(\d+)|operation", text, re.ASCII)
    size = float(match[2] or match[4] or 1.0) if match else 0.0
    if not match or size <= 0:
        raise DataError(
            "BAT040",
            f"--split {text!r}, expected region:MM, count:N or operation",
            SourceRef("postproc"),
        )
    return match[1] or match[3] or "operation", size


def subset(path: ToolPath, rows: IndexArray) -> ToolPath:
    """Return the tags ``rows`` (k,), ascending, of a toolpath, with the tables that they use.

    Each section begins with the tool, spindle and coolant as they were on its first row in the
    input, and ends with their switching off where that follows its last row. What was found when
    the input was read is left out: it belongs to no section.
    """
    part = path.rows(rows)
    operation, used = _compact(part.operation)
    cycle, cycles = _compact(part.cycle)
    arc, arcs = _compact(part.arc)
    return replace(
        part,
        operation=operation,
        operations=tuple(path.operations[i] for i in used),
        cycle=cycle,
        cycles=tuple(path.cycles[i] for i in cycles),
        arc=arc,
        arcs=path.arcs.rows(arcs),
        events=tuple(_events(path, rows)),
        unknown_words={},
        words={},
        warnings=(),
        recovered=(),
    )


def _compact(index: IntArray) -> tuple[IntArray, IntArray]:
    """Return an index column (k,) into only those table rows that it uses, and these rows."""
    used, place = np.unique(index[index >= 0], return_inverse=True)
    result = np.full(len(index), -1, dtype=np.int32)
    result[index >= 0] = place
    return result, used


def _events(path: ToolPath, rows: IndexArray) -> Iterator[Event]:
    first, last, end = int(rows[0]), int(rows[-1]), len(path)
    for kinds in _STATES:
        past = [event for event in path.events if event.kind in kinds and event.index <= first]
        if past and past[-1].index < first and past[-1].kind not in _OFF:
            yield replace(past[-1], index=0)
    for event in path.events:
        place = int(np.searchsorted(rows, event.index))
        if place < len(rows) and int(rows[place]) == event.index:
            yield replace(event, index=place)
        elif event.index == end or (event.index == last + 1 and event.kind in _OFF):
            yield replace(event, index=len(rows))


def section_labels(path: ToolPath, rule: tuple[str, float]) -> list[tuple[str, IndexArray]]:
    """Return (label, rows) per section, in an order that one more hole does not change.

    Operations and counts stand as in the input, regions line by line, back and forth. BAT041 if the
    input, as it is served, is more than holes, which cannot be cut by region.
    """
    kind, size = rule
    key = {"region": _regions, "count": _counts, "operation": _operations}[kind](path, size)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    grouped = np.argsort(inverse.ravel(), kind="stable")
    pieces = np.split(grouped, np.cumsum(np.bincount(inverse.ravel()))[:-1])
    order = _in_snakes(key[first]) if kind == "region" else np.argsort(first, kind="stable")
    labels = _distinct(_label(kind, key[first[g]], path) for g in order)
    return [(label, pieces[g]) for label, g in zip(labels, order, strict=True)]


def _regions(path: ToolPath, size: float) -> IndexArray:
    """Return the cube (n, 3) of every tag."""
    inner = [event for event in path.events if 0 < event.index < len(path)]
    if inner or not bool((path.kind == MotionKind.HOLE).all()):
        what = "has events between its holes" if inner else "is more than a list of holes"
        text = f"{what}, expected holes only for a split by region; use operation or count"
        raise DataError("BAT041", text, SourceRef(path.path, inner[0].line if inner else 1))
    # 300 mm is not exactly 3 times 100 mm in metres
    return np.floor(np.round(path.points / (size * MM), 9)).astype(np.int64)


def _in_snakes(cubes: IndexArray) -> IndexArray:
    """Return the order (k,) of cubes (k, 3): by layers, in them by lines, back and forth."""
    x, y, z = cubes.T
    return np.lexsort((np.where(y % 2 == 0, x, -x), y, z))


def _counts(path: ToolPath, size: float) -> IndexArray:
    """Return the number (n, 1) of the section of every tag; cuts are never cut in two."""
    starts = np.flatnonzero(np.isin(path.kind, _FREE))
    wanted = np.arange(int(size), len(path), int(size))
    place = np.searchsorted(starts, wanted)
    breaks = starts[place[place < len(starts)]]
    number: IndexArray = np.zeros(len(path), dtype=np.int64)
    number[np.unique(breaks)] = 1
    return np.cumsum(number)[:, None]


def _operations(path: ToolPath, _size: float) -> IndexArray:
    """Return the operation (n, 1) of every tag; a cut belongs to that in which it begins."""
    begins = np.isin(path.kind, _FREE)
    begins[:1] = True
    first = np.maximum.accumulate(np.where(begins, np.arange(len(path)), 0))
    return path.operation[first, None].astype(np.int64)


def _label(kind: str, key: IndexArray, path: ToolPath) -> str:
    if kind == "count":
        return f"{int(key[0]) + 1:03d}"
    if kind == "operation":
        index = int(key[0])
        name = path.operations[index].name if index >= 0 else "REST"
        label = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").upper() or "REST"
    else:
        label = "".join(
            f"{axis}{'N' if value < 0 else ''}{abs(int(value))}"
            for axis, value in zip("XYZ", key, strict=True)
        )
    return label if len(label) <= _LABEL else f"{label[: _LABEL - 5].rstrip('_')}_{_mark(label)}"


def _distinct(labels: Iterable[str]) -> Iterator[str]:
    """Yield labels; the second of two alike gets a number."""
    seen: dict[str, int] = {}
    taken: set[str] = set()
    for label in labels:
        name = label
        while name in taken:
            seen[label] = seen.get(label, 1) + 1
            name = f"{label}_{seen[label]}"
        taken.add(name)
        yield name


def _mark(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:4].upper()


def _section_name(stem: str, label: str) -> str:
    """Return stem and label; of a long stem the beginning and a mark made from all of it."""
    if len(stem) + len(label) >= _NAME:
        stem = f"{stem[: max(1, _NAME - len(label) - 6)].rstrip('_')}_{_mark(stem)}"
    return legal_name(f"{stem}_{label}")


def split_job(job: Job, path: ToolPath, rule: tuple[str, float], taken: set[str]) -> list[Job]:
    """Return one job per section of a job's toolpath, as it is served, named after the section.

    ``taken``: upper-case names of other programs; the sections' are added.
    """
    stem = str(job.request.name)
    jobs = []
    for label, rows in section_labels(path, rule):
        key = f"{job.key}#{label}"
        name = unique_name(_section_name(stem, label), key, taken)
        part = subset(path, _with_way_out(path, rows))
        jobs.append(Job(key, replace(job.request, name=name), part))
    return jobs


def _with_way_out(path: ToolPath, rows: IndexArray) -> IndexArray:
    """Return the rows with the rapid behind them where they end in a cut: it leads out of it."""
    last = int(rows[-1])
    ends_in_cut = path.kind[last] in CUTS and last + 1 < len(path)
    if ends_in_cut and path.kind[last + 1] == MotionKind.RAPID:
        return np.append(rows, last + 1)
    return rows


@dataclass(frozen=True, slots=True)
class Caller:
    """A program to make from the results of sections: the job of the whole input, their keys."""

    job: Job
    sections: list[str]


@dataclass(frozen=True, slots=True)
class Work:
    """What a batch has to do; ``broken``: results of inputs that could not be cut."""

    jobs: list[Job] = field(default_factory=list)
    broken: list[JobResult] = field(default_factory=list)
    callers: list[Caller] = field(default_factory=list)

    @property
    def keys(self) -> list[str]:
        """Keys of all that gets an entry, in a fixed order."""
        callers = [caller.job.key for caller in self.callers]
        return [*callers, *(job.key for job in self.jobs), *(r.key for r in self.broken)]


def expand(jobs: Sequence[Job], split: str | None) -> Work:
    """Return jobs as they are, or cut into sections."""
    if split is None:
        return Work(list(jobs))
    rule = parse_rule(split)
    work = Work()
    taken = {str(job.request.name).upper() for job in jobs}
    for job in jobs:
        sections = attempt(job, lambda job=job: _sections(job, rule, taken))  # type: ignore[misc]
        if isinstance(sections, JobResult):
            work.broken.append(sections)
        else:
            work.jobs.extend(sections)
            work.callers.append(Caller(job, [section.key for section in sections]))
    return work


def caller_program(request: ConvertRequest, sections: Sequence[str]) -> Program:
    """Return the program that runs those of the sections in order."""
    cell = request.cell_with_keys()
    program = emitter_of(cell).caller(str(request.name), sections)
    if program is None:
        text = (
            f"the emitter {cell.krl.emitter!r} has no program that runs others, needed by --split"
        )
        raise DataError("BAT042", text, SourceRef(cell.path))
    return program


def _sections(job: Job, rule: tuple[str, float], taken: set[str]) -> list[Job]:
    from postproc.jobs.convert import read_toolpath
    from postproc.process import as_served

    caller_program(job.request, ())  # before hours of work
    cell = job.request.cell_with_keys()
    path = as_served(read_toolpath(job.request, cell), cell)
    return split_job(job, path, rule, taken)
