"""A process for one job after the other that can be ended: what a cluster worker starts.

A worker of a cluster cannot end a function that hangs, and dies with one that crashes. So jobs run
in a child of it, which is started anew when it had to be ended or has died.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from postproc.batch.worker import JobResult, died, limit_memory, run_job, too_slow
from postproc.version import __version__

if TYPE_CHECKING:
    from postproc.batch.jobs import Job

_OF_THREAD = threading.local()


def run_in_child(
    job: Job, timeout: float | None, memory: float | None, version: str, folder: str
) -> JobResult:
    """Run a job in this thread's child process.

    Args:
        job: what to do.
        timeout: seconds, None = no limit.
        memory: GiB of address space, None = no limit.
        version: of the postproc that asks; another one here would make other programs.
        folder: from which the names of files count: that of the call, not of the worker.
    """
    if version != __version__:
        line = f"{job.request.source}:1: error BAT033: the cluster has postproc {__version__}, "
        return JobResult(job.key, "error", errors=(f"{line}expected {version}",))
    if not os.path.isdir(folder):  # noqa: PTH112 - as text
        line = f"{job.request.source}:1: error BAT034: the worker {socket.gethostname()} has no"
        return JobResult(job.key, "crash", errors=(f"{line} folder {folder}",))
    child: Child | None = getattr(_OF_THREAD, "child", None)
    if child is None or child.made_for != (memory, folder) or not child.is_alive():
        child = _OF_THREAD.child = Child(memory, folder)
    return child.run(job, timeout)


class Child:
    """The parent's end of one child process.

    Args:
        memory: GiB of address space, None = no limit.
        folder: in which it runs, None = that of this process.
    """

    def __init__(self, memory: float | None, folder: str | None = None) -> None:
        self.made_for = (memory, folder)
        self._pipe, theirs = Pipe()
        command = [sys.executable, "-m", "postproc.batch.child", str(theirs.fileno())]
        threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [*command, *([str(memory)] if memory else [])],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            cwd=folder,
            env={**os.environ, **threads},
        )
        theirs.close()

    def is_alive(self) -> bool:
        """Return whether it can take a job."""
        return self._process.poll() is None

    def run(self, job: Job, timeout: float | None) -> JobResult:
        """Return the result of a job; the child is gone after one that is too slow or crashes."""
        try:
            self._pipe.send(job)
            if not self._pipe.poll(timeout):
                self.end()
                return too_slow(job, timeout)
            result: JobResult = self._pipe.recv()
        except (EOFError, OSError):
            self.end()
            return died(job)
        return result

    def end(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.wait()
        self._pipe.close()


def main() -> None:
    """Take jobs from the parent until it is gone."""
    pipe: Connection[JobResult, Job] = Connection(int(sys.argv[1]))
    limit_memory(float(sys.argv[2]) if len(sys.argv) > 2 else None)
    while True:
        try:
            pipe.send(run_job(pipe.recv()))
        except (EOFError, OSError):
            return


if __name__ == "__main__":
    main()
