"""A call that cannot give any program is refused before anything in the folder changes."""

from __future__ import annotations

from collections.abc import Sequence

from postproc.batch.jobs import Job, Overrides, find_inputs, load_overrides, make_jobs
from postproc.batch.run import BatchOptions
from postproc.batch.sections import parse_rule
from postproc.errors import PostprocError, UsageError
from postproc.jobs.convert import ConvertRequest


def call_of(
    inputs: Sequence[str], base: ConvertRequest, options: BatchOptions, config: str | None = None
) -> tuple[list[Job], list[str]]:
    """Return the jobs of a call that can give programs, and remarks on its options.

    Args:
        inputs: files, folders, globs, ``@LIST``.
        base: cell and options of all inputs.
        options: of the run.
        config: ``batch.toml``.

    Raises:
        DataError: BAT001 to BAT006 if inputs or options are wrong.
        UsageError: as ``require_call``.
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

    Raises:
        UsageError: BAT004 if an input has no cell.
        PostprocError: what is wrong with cell, model or options, if it is so for every input; else
            the inputs concerned fail by themselves.
    """
    calls = {}
    for job in jobs:
        request = job.request
        if not request.cell:
            text = f"no cell for {request.source}, give --cell or set it in --config"
            raise UsageError("BAT004", text)
        wishes = request.strategy, request.objective, request.preset
        calls[request.cell, *wishes, request.model] = job
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
    from postproc.cell import shared_cell
    from postproc.planning import PlanOptions, settle

    request = job.request
    options = PlanOptions(
        strategy=request.strategy, objective=request.objective, preset=request.preset
    )
    settle(shared_cell(request.cell), options)
    if request.model:
        from postproc.model import load_model

        load_model(request.model)
