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
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from postproc.errors import PostprocError, Severity
from postproc.geometry import kuka_from_transform
from postproc.records import dataclass
from postproc.version import __version__

if TYPE_CHECKING:
    from postproc.arrays import FloatArray
    from postproc.batch.jobs import Job
    from postproc.jobs.convert import Conversion

_OF_THREAD = threading.local()
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

_MAIN = "from postproc.batch.child import main; main()"


def run_in_child(
    job: Job, timeout: float | None, memory: float | None, version: str, folder: str
) -> JobResult:
    """Run a job in this thread's child process: what a worker of a cluster does.

    ``timeout`` [s], ``memory`` [GiB], None = no limit; ``version`` of the postproc that asks:
    another one here would make other programs; ``folder`` from which the names of files count: that
    of the call, not of the worker.
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

    ``memory``: GiB of address space, None = no limit; ``folder``: in which it runs.
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

    keys = dict(job.request.keys)
    if job.toolpath is not None:
        keys["cam_lines"] = False  # of a section: they move with every line added elsewhere
    conversion = convert(replace(job.request, keys=keys), toolpath=job.toolpath)
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
