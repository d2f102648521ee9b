"""Where jobs run: worker processes of this machine, or a Dask cluster; results as they come."""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from postproc.batch.child import Child, JobResult, died, run_in_child
from postproc.errors import DataError, PluginError, SourceRef
from postproc.version import __version__

if TYPE_CHECKING:
    from postproc.batch.jobs import Job

_AHEAD = 3
"""Jobs per worker under way: keeps all busy; more would only fill memory."""
_NO_WORKERS = 60.0
"""Time [s] without any worker after which a cluster counts as gone."""
_NO_ANSWER = 12.0
"""Time [s] without an answer of the scheduler after which it counts as gone."""


def run_local(
    jobs: Sequence[Job], workers: int, timeout: float | None = None, memory: float | None = None
) -> Iterator[JobResult]:
    """Run jobs in worker processes; a hanging or dying worker costs only its own job.

    ``timeout`` [s] per job, ``memory`` [GiB] per worker, None = no limit. Results are yielded in
    the order in which they finish.
    """
    folder = os.getcwd()  # noqa: PTH109 - as text
    children = [Child(memory, folder) for _ in range(min(workers, len(jobs)))]
    free: SimpleQueue[Child] = SimpleQueue()
    for child in children:
        free.put(child)

    def work(job: Job) -> JobResult:
        child = free.get()
        try:
            return child.run(job, timeout)
        finally:
            free.put(child)

    pool = ThreadPoolExecutor(len(children))
    waiting: set[Future[JobResult]] = set()
    queue = iter(jobs)
    try:
        while True:
            wanted = _AHEAD * len(children) - len(waiting)
            waiting |= {pool.submit(work, job) for job in itertools.islice(queue, wanted)}
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in children:
            child.close()
        pool.shutdown()
        for child in children:
            child.end()


def run_dask(
    jobs: Sequence[Job], address: str, timeout: float | None = None, memory: float | None = None
) -> Iterator[JobResult]:
    """Run jobs on the Dask cluster at ``address``; inputs must be readable there.

    Limits as of ``run_local``. PLG008 if the cluster extra is not installed, BAT031 if no scheduler
    answers.
    """
    try:
        from distributed import Client
    except ImportError:
        text = '--dask needs an extra: pip install "postproc[cluster]"'
        raise PluginError("PLG008", text, SourceRef("postproc")) from None

    def connected() -> Any:  # noqa: ANN401 - distributed has no types
        limit = f"{_NO_ANSWER:g}s"
        return Client(address, timeout=limit, set_as_default=False)  # type: ignore[no-untyped-call]

    client = _in_time(connected)
    if isinstance(client, Exception):
        what = f": {client}" if str(client) else f" within {_NO_ANSWER:g} s"
        raise DataError("BAT031", f"no Dask scheduler answers{what}", SourceRef(address))
    try:
        yield from _on_cluster(client, jobs, timeout, memory)
    finally:
        _in_time(client.close)


def _in_time(call: Callable[[], Any]) -> Any:  # noqa: ANN401 - distributed has no types
    """Return what a call to the cluster returns or raises; one that never ends is left behind."""
    found: list[Any] = []

    def work() -> None:
        try:
            found.append(call())
        except Exception as problem:  # noqa: BLE001 - a lost scheduler shows in many ways
            found.append(problem)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(_NO_ANSWER)
    return found[0] if found else TimeoutError()


def _on_cluster(
    client: Any,  # noqa: ANN401 - distributed has no types
    jobs: Sequence[Job],
    timeout: float | None,
    memory: float | None,
) -> Iterator[JobResult]:
    """Keep some jobs per thread of the cluster under way until all are done or it is gone."""
    waiting: dict[Any, Job] = {}
    queue = iter(enumerate(jobs))
    seen = time.monotonic()
    why = ""
    while not why:
        threads = _in_time(lambda: sum(client.nthreads().values()))
        if isinstance(threads, Exception):
            why = "the scheduler no longer answers"
            break
        seen = time.monotonic() if threads else seen
        if time.monotonic() - seen > _NO_WORKERS:
            why = "no worker is left on the cluster"
            break
        while len(waiting) < _AHEAD * max(threads, 1):
            number, job = next(queue, (0, None))
            if job is None:
                break
            arguments = (job, timeout, memory, __version__, os.getcwd())  # noqa: PTH109 - as text
            key = f"postproc-{number}-{job.key}"
            future = client.submit(run_in_child, *arguments, key=key, pure=False, retries=3)
            waiting[future] = job
        if not waiting:
            return
        for future in _finished(client, list(waiting)):
            result = _in_time(future.result) if future.status == "finished" else None
            if future.status == "cancelled":  # by a scheduler that is gone, not by the job
                continue
            job = waiting.pop(future)
            yield result if isinstance(result, JobResult) else died(job)
            _in_time(future.release)
    yield from (_lost(job, why) for job in [*waiting.values(), *(job for _, job in queue)])


def _finished(client: Any, futures: list[Any]) -> list[Any]:  # noqa: ANN401 - as above
    """Return those of the futures that have come to an end, waiting a little for the first."""
    from distributed import wait as wait_for

    def wait() -> Any:  # noqa: ANN401 - as above
        with client.as_current():
            return wait_for(futures, timeout=5, return_when="FIRST_COMPLETED").done  # type: ignore[no-untyped-call]

    found = _in_time(wait)
    return [] if isinstance(found, Exception) else list(found)


def _lost(job: Job, why: str) -> JobResult:
    line = f"{job.request.source}:1: error BAT032: {why}"
    return JobResult(job.key, "crash", errors=(line,))
