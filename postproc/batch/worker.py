"""One job in a worker process: never raises, returns the program's bytes or what went wrong."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from postproc.errors import PostprocError, Severity
from postproc.geometry import kuka_from_transform
from postproc.records import dataclass

if TYPE_CHECKING:
    from postproc.arrays import FloatArray
    from postproc.batch.jobs import Job
    from postproc.jobs.convert import Conversion

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class JobResult:
    """The outcome of one job.

    ``status``: ``ok``; ``failed`` (tags fail, nothing written); ``error`` (wrong input);
    ``timeout``, ``memory``, ``crash`` (the worker died). ``errors``, ``warnings``: one line each;
    the latter are of the program. ``about``: see ``_about``. ``page``: the page that shows it.
    """

    key: str
    status: str
    name: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    errors: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    tags: int = 0
    cycle_time: float = 0.0
    about: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    page: bytes = b""


def run_job(job: Job) -> JobResult:
    """Convert one input."""
    return attempt(job, lambda: _convert(job))


def attempt(job: Job, work: Callable[[], T]) -> T | JobResult:
    """Return what ``work`` on a job returns, or a result that says why it could not."""
    source = job.request.source
    try:
        return work()
    except PostprocError as error:
        return JobResult(job.key, "error", errors=(str(error),))
    except MemoryError:
        line = f"{source}:1: error BAT020: needs more memory than the limit"
        return JobResult(job.key, "memory", errors=(line,))
    except Exception as bug:  # noqa: BLE001 - one input must never stop the others
        kind = f"{type(bug).__name__}: {bug}"
        line = f"{source}:1: error BAT070: fault of postproc, please report: {kind}"
        return JobResult(job.key, "crash", errors=(" ".join(line.split()),))


def too_slow(job: Job, timeout: float | None) -> JobResult:
    """Return the result of a job that was ended after ``timeout`` seconds."""
    line = f"{job.request.source}:1: error BAT021: not done after {timeout:g} s"
    return JobResult(job.key, "timeout", errors=(line,))


def died(job: Job) -> JobResult:
    """Return the result of a job whose process died."""
    line = f"{job.request.source}:1: error BAT022: the worker died on this input"
    return JobResult(job.key, "crash", errors=(line,))


def _convert(job: Job) -> JobResult:
    from postproc.jobs.convert import convert
    from postproc.jobs.pages import page_of_conversion

    request = replace(job.request, cam_lines=job.toolpath is None)
    conversion = convert(request, toolpath=job.toolpath)
    errors, warnings = (
        tuple(str(finding) for finding in conversion.findings if finding.severity is severity)
        for severity in (Severity.ERROR, Severity.WARNING)
    )
    return JobResult(
        key=job.key,
        status="failed" if errors else "ok",
        name=conversion.name,
        files=dict(conversion.files),
        errors=errors,
        warnings=warnings,
        tags=len(conversion.toolpath),
        cycle_time=round(conversion.plan.cycle_time, 3),
        about=_about(conversion, has_lines=job.toolpath is None),
        page=page_of_conversion(conversion) if job.paged else b"",
    )


def _about(conversion: Conversion, *, has_lines: bool) -> dict[str, dict[str, Any]]:
    """Return what a reviewer of a program wants to know and its text does not hold.

    ``tools``, ``bases``: frames X, Y, Z [mm], A, B, C [deg] in flange and robot root by number;
    ``ids`` of the tags by the CAM line that the program names.
    """
    cell, path = conversion.cell, conversion.toolpath
    names: dict[str, set[str]] = {}
    if has_lines and path.names is not None:
        for line, name in zip(path.line.tolist(), path.names, strict=True):
            names.setdefault(str(line), set()).add(name)
    return {
        "tools": {str(tool.number): _frame(tool.T_flange_tcp) for tool in cell.tools},
        "bases": {str(base.number): _frame(base.T_robroot_base) for base in cell.bases},
        "ids": {line: min(found) for line, found in names.items() if len(found) == 1},
    }


def _frame(T: FloatArray) -> list[float]:
    xyz_mm, abc_deg = kuka_from_transform(T)
    return [round(float(v), 6) + 0.0 for v in (*xyz_mm, *abc_deg)]


def limit_memory(gigabytes: float | None) -> None:
    """Bound this process's memory where the system can (the worker's initializer)."""
    if gigabytes is None or os.name != "posix":
        return
    import resource

    limit = int(gigabytes * 1024**3)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
