"""A process for one job after the other that can be ended: what a worker is.

A thread cannot end a function that hangs, and dies with one that crashes. So jobs run in a child
process, which is started anew when it had to be ended or has died. It knows nothing of the script
that asks: a script without ``if __name__ == "__main__":`` runs once.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING

from postproc.batch.worker import JobResult, died, limit_memory, run_job, too_slow
from postproc.version import __version__

if TYPE_CHECKING:
    from postproc.batch.jobs import Job

_OF_THREAD = threading.local()
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

_MAIN = "from postproc.batch.child import main; main()"


def run_in_child(
    job: Job, timeout: float | None, memory: float | None, version: str, folder: str
) -> JobResult:
    """Run a job in this thread's child process: what a worker of a cluster does.

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
    if child is None or child.made_for != (memory, folder):
        child = _OF_THREAD.child = Child(memory, folder)
    return child.run(job, timeout)


class Child:
    """The parent's end of one child process, which is started with the first job.

    Args:
        memory: GiB of address space, None = no limit.
        folder: in which it runs, None = that of this process.
    """

    def __init__(self, memory: float | None, folder: str | None = None) -> None:
        self.made_for = (memory, folder)
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def run(self, job: Job, timeout: float | None) -> JobResult:
        """Return the result of a job; the child is gone after one that is too slow or crashes."""
        if self._closed:
            return died(job)
        if self._process is None or self._process.poll() is not None:
            self.end()
            self._process = _ready(self._started())
        late = threading.Event()
        timer = threading.Timer(timeout or 0.0, self._stop, (late,))
        if timeout is not None:
            timer.start()
        try:
            result = _answer(self._process, job)
        except (EOFError, OSError, pickle.UnpicklingError):
            self.end()
            return too_slow(job, timeout) if late.is_set() else died(job)
        finally:
            timer.cancel()
        return result

    def end(self) -> None:
        """End the process at once; the next job gets a new one."""
        if self._process is not None:
            self._process.kill()
            with suppress(OSError):
                self._process.communicate()
            self._process = None

    def close(self) -> None:
        """Take no more jobs, from whatever thread; the one under way has died."""
        self._closed = True
        if (process := self._process) is not None:
            process.kill()

    def _stop(self, late: threading.Event) -> None:
        late.set()
        if (process := self._process) is not None:
            process.kill()

    def _started(self) -> subprocess.Popen[bytes]:
        memory, folder = self.made_for
        command = [sys.executable, "-P", "-c", _MAIN]
        # what this process can import the child can, and nothing else
        places = os.pathsep.join(place or os.getcwd() for place in sys.path)  # noqa: PTH109
        return subprocess.Popen(
            [*command, *([str(memory)] if memory else [])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=folder,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": places},
        )


def _ready(process: subprocess.Popen[bytes]) -> subprocess.Popen[bytes]:
    """Return a child that can take jobs: the time of a job is not that of its start."""
    if process.stdout is not None:
        process.stdout.read(1)
    return process


def _answer(process: subprocess.Popen[bytes], job: Job) -> JobResult:
    if process.stdin is None or process.stdout is None:
        raise EOFError
    pickle.dump((run_job, job), process.stdin)
    process.stdin.flush()
    result: JobResult = pickle.load(process.stdout)
    return result


def main() -> None:
    """Take jobs from the parent until it is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    with os.fdopen(os.dup(1), "wb") as answers, suppress(EOFError, OSError):
        os.dup2(2, 1)  # what a plug-in prints is no answer
        answers.write(b"\n")
        answers.flush()
        limit_memory(float(sys.argv[1]) if len(sys.argv) > 1 else None)
        while True:
            call, job = pickle.load(sys.stdin.buffer)
            pickle.dump(call(job), answers)
            answers.flush()
