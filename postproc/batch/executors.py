"""Where jobs run: worker processes of this machine, or a Dask cluster; results as they come."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TYPE_CHECKING, Any

from postproc.batch.child import run_in_child
from postproc.batch.worker import JobResult, died, limit_memory, run_job, too_slow
from postproc.errors import DataError, PluginError, SourceRef
from postproc.version import __version__

if TYPE_CHECKING:
    from postproc.batch.jobs import Job

_AHEAD = 3
"""Jobs per worker under way: keeps all busy; more would only fill memory."""
_NO_WORKERS = 60.0
"""Time [s] without any worker after which a cluster counts as gone."""


def run_local(
    jobs: Sequence[Job],
    workers: int,
    timeout: float | None = None,
    memory: float | None = None,
) -> Iterator[JobResult]:
    """Run jobs in worker processes; a hanging or dying worker costs only its own job.

    Args:
        jobs: what to do.
        workers: number of processes.
        timeout: seconds per job, None = no limit.
        memory: GiB of address space per worker, None = no limit.

    Yields:
        Results in the order in which they finish.
    """
    from pebble import ProcessPool

    context = multiprocessing.get_context("spawn")
    with ProcessPool(
        max_workers=min(workers, len(jobs)),
        context=context,
        initializer=limit_memory,
        initargs=(memory,),
    ) as pool:
        waiting: dict[Future[JobResult], Job] = {}
        queue = iter(jobs)
        try:
            while True:
                while len(waiting) < _AHEAD * workers and (job := next(queue, None)) is not None:
                    waiting[pool.schedule(run_job, args=[job], timeout=timeout)] = job
                if not waiting:
                    return
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    yield _outcome(future, waiting.pop(future), timeout)
        except BaseException:
            pool.stop()  # type: ignore[no-untyped-call]
            raise


def _outcome(future: Future[JobResult], job: Job, timeout: float | None) -> JobResult:
    try:
        return future.result()
    except TimeoutError:
        return too_slow(job, timeout)
    except Exception:  # noqa: BLE001 - whatever it is, it is this job's and no other's
        return died(job)


def run_dask(
    jobs: Sequence[Job], address: str, timeout: float | None = None, memory: float | None = None
) -> Iterator[JobResult]:
    """Run jobs on the Dask cluster at ``address``; inputs must be readable there.

    Args:
        jobs: what to do.
        address: of the scheduler.
        timeout: seconds per job, None = no limit.
        memory: GiB of address space per job, None = no limit.

    Raises:
        PluginError: BAT030 if the cluster extra is not installed.
        DataError: BAT031 if no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise PluginError(
            "BAT030", "--dask needs the extra postproc[cluster]", SourceRef("postproc")
        ) from None
    try:
        client = Client(  # type: ignore[no-untyped-call]
            address, timeout="10s", set_as_default=False
        )
    except (OSError, ValueError) as problem:
        raise DataError(
            "BAT031", f"no Dask scheduler answers: {problem}", SourceRef(address)
        ) from None
    with client:
        yield from _on_cluster(client, jobs, timeout, memory)


def _on_cluster(
    client: Any,  # noqa: ANN401 - distributed has no types
    jobs: Sequence[Job],
    timeout: float | None,
    memory: float | None,
) -> Iterator[JobResult]:
    """Keep some jobs per thread of the cluster under way until all are done or it is gone."""
    from distributed import wait as wait_for

    waiting: dict[Any, Job] = {}
    queue = iter(enumerate(jobs))
    seen = time.monotonic()
    while True:
        threads = _threads(client)
        seen = time.monotonic() if threads else seen
        if time.monotonic() - seen > _NO_WORKERS:
            yield from (_lost(job) for job in [*waiting.values(), *(job for _, job in queue)])
            return
        while len(waiting) < _AHEAD * max(threads, 1):
            number, job = next(queue, (0, None))
            if job is None:
                break
            key = f"postproc-{number}-{job.key}"
            arguments = (job, timeout, memory, __version__)
            future = client.submit(run_in_child, *arguments, key=key, pure=False, retries=3)
            waiting[future] = job
        if not waiting:
            return
        try:
            with client.as_current():
                some = wait_for(  # type: ignore[no-untyped-call]
                    list(waiting), timeout=5, return_when="FIRST_COMPLETED"
                )
        except TimeoutError:
            continue
        for future in some.done:
            job = waiting.pop(future)
            yield future.result() if future.status == "finished" else died(job)
            future.release()


def _threads(client: Any) -> int:  # noqa: ANN401 - distributed has no types
    try:
        return sum(client.nthreads().values())
    except (OSError, TimeoutError):
        return 0


def _lost(job: Job) -> JobResult:
    line = f"{job.request.source}:1: error BAT032: no worker is left on the cluster"
    return JobResult(job.key, "crash", errors=(line,))
