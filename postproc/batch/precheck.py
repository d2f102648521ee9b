"""A call that cannot give any program is refused before anything in the folder changes."""

from __future__ import annotations

from collections.abc import Sequence

from postproc.batch.jobs import Job
from postproc.errors import PostprocError, UsageError


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
