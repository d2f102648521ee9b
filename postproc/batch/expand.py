"""From inputs to jobs: each whole, or cut into sections with a program that calls them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

from postproc.batch.jobs import Job
from postproc.batch.sections import parse_rule, split_job
from postproc.batch.worker import JobResult, attempt
from postproc.cell import shared_cell
from postproc.emitters import Program, emitter_of, with_emitter
from postproc.errors import DataError, SourceRef
from postproc.jobs.convert import ConvertRequest
from postproc.records import dataclass


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
    """Return jobs as they are, or cut into sections.

    Raises:
        DataError: BAT040 if the rule is none.
    """
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
    """Return the program that runs those of the sections in order.

    Raises:
        DataError: BAT042 if the emitter has no such program.
    """
    cell = with_emitter(shared_cell(request.cell), request.emitter)
    program = emitter_of(cell).caller(str(request.name), sections)
    if program is None:
        raise DataError(
            "BAT042",
            f"the emitter {cell.krl.emitter!r} has no program that runs others, needed by --split",
            SourceRef(cell.path),
        )
    return program


def _sections(job: Job, rule: tuple[str, float], taken: set[str]) -> list[Job]:
    from postproc.jobs.convert import read_toolpath
    from postproc.process import as_served

    caller_program(job.request, ())  # before hours of work
    cell = shared_cell(job.request.cell)
    path = as_served(read_toolpath(job.request, cell), cell)
    return split_job(job, path, rule, taken)
