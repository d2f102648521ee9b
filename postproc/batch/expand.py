"""From inputs to jobs: each whole, or cut into sections with a program that calls them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from postproc.batch.jobs import Job
from postproc.batch.sections import parse_rule, split_job
from postproc.batch.worker import JobResult, attempt


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


def _sections(job: Job, rule: tuple[str, float], taken: set[str]) -> list[Job]:
    from postproc.cell import shared_cell
    from postproc.jobs.convert import read_toolpath
    from postproc.process import as_served

    cell = shared_cell(job.request.cell)
    path = as_served(read_toolpath(job.request, cell), cell)
    return split_job(job, path, rule, taken)
