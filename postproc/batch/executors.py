"""Where jobs run: worker processes of this machine, or a Dask cluster; results as they come."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TYPE_CHECKING, Any

from postproc.batch.worker import JobResult, limit_memory, run_job
from postproc.errors import DataError, PluginError, SourceRef

if TYPE_CHECKING:
    from postproc.batch.jobs import Job


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
                # a few jobs ahead keep workers busy; more would only fill the pipe
                while len(waiting) < 3 * workers and (job := next(queue, None)) is not None:
                    waiting[pool.schedule(run_job, args=[job], timeout=timeout)] = job
                if not waiting:
                    return
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    yield _outcome(future, waiting.pop(future), timeout)
        except BaseException:
            pool.stop()  # type: ignore[no-untyped-call]
            raise


def _outcome(future: Future[JobResult], job: Job, timeout: float | None) -> JobResult:
    from pebble import ProcessExpired

    source = job.request.source
    try:
        return future.result()
    except TimeoutError:
        line = f"{source}:1: error BAT021: not done after {timeout:g} s"
        return JobResult(job.key, "timeout", errors=(line,))
    except ProcessExpired:
        line = f"{source}:1: error BAT022: the worker died on this input"
        return JobResult(job.key, "crash", errors=(line,))


def run_dask(jobs: Sequence[Job], address: str) -> Iterator[JobResult]:
    """Run jobs on the Dask cluster at ``address``; inputs must be readable there.

    Raises:
        PluginError: BAT030 if the cluster extra is not installed.
        DataError: BAT031 if no scheduler answers.
    """
    try:
        from distributed import Client, as_completed
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
        futures: dict[Any, Job] = {
            client.submit(
                run_job, job, key=f"postproc-{number}-{job.key}", pure=False, retries=3
            ): job
            for number, job in enumerate(jobs)
        }
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]
            job = futures[future]
            if future.status == "finished":
                yield future.result()
            else:
                line = f"{job.request.source}:1: error BAT022: the worker died on this input"
                yield JobResult(job.key, "crash", errors=(line,))
            future.release()
