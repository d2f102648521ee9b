"""One job in a worker process: never raises, returns the program's bytes or what went wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from postproc.errors import PostprocError, Severity

if TYPE_CHECKING:
    from postproc.batch.jobs import Job


@dataclass(frozen=True, slots=True)
class JobResult:
    """The outcome of one job.

    ``status``: ``ok``; ``failed`` (tags fail, nothing written); ``error`` (wrong input);
    ``timeout``, ``memory``, ``crash`` (the worker died). ``errors``: one line each.
    """

    key: str
    status: str
    name: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    errors: tuple[str, ...] = ()
    tags: int = 0
    cycle_time: float = 0.0


def run_job(job: Job) -> JobResult:
    """Convert one input."""
    try:
        return _convert(job)
    except PostprocError as error:
        return JobResult(job.key, "error", errors=(str(error),))
    except MemoryError:
        line = f"{job.request.source}:1: error BAT020: needs more memory than the limit"
        return JobResult(job.key, "memory", errors=(line,))
    except Exception as bug:  # noqa: BLE001 - one input must never stop the others
        kind = f"{type(bug).__name__}: {bug}"
        line = f"{job.request.source}:1: error BAT070: fault of postproc, please report: {kind}"
        return JobResult(job.key, "crash", errors=(" ".join(line.split()),))


def _convert(job: Job) -> JobResult:
    import numpy as np

    from postproc.pipeline.convert import convert

    conversion = convert(job.request, toolpath=job.toolpath)
    errors = tuple(str(i) for i in conversion.issues if i.severity is Severity.ERROR)
    return JobResult(
        key=job.key,
        status="failed" if errors else "ok",
        name=conversion.name,
        files=dict(conversion.files),
        errors=errors,
        tags=len(conversion.toolpath),
        cycle_time=float(np.round(np.nansum(conversion.plan.duration), 3)),
    )


def limit_memory(gigabytes: float | None) -> None:
    """Bound this process's memory where the system can (the worker's initializer)."""
    if gigabytes is None:
        return
    import resource

    limit = int(gigabytes * 1024**3)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
