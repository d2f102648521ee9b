"""Batches as users run them: in processes that get killed, in pairs, on a cluster."""

import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest

from postproc.batch.manifest import Manifest

from .conftest import HEADER, call, holes, row


def start(arguments, output):
    """Start a batch in a process group of its own, which an interrupt can end.

    A shell that starts the tests in the background hands down that interrupts are ignored.
    """
    return subprocess.Popen(
        [sys.executable, "-m", "postproc", *call(["parts"], output, arguments)],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


def wait_for(path):
    """Wait until a batch has begun to write, however busy the machine is."""
    deadline = time.monotonic() + 60
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.05)


def test_processes_give_the_bytes_of_one_process(batch, processes, work, snapshot):
    batch(output="one")
    done = processes(output="two")
    assert snapshot("one") == snapshot("two")
    lines = done.err.splitlines()
    shape = r"\d of 3, [0-9.]+ per (s|min), 0:00:\d\d left, [01] failed"
    assert all(re.fullmatch(shape, line) for line in lines[:3])
    assert lines[3].startswith("parts/far.csv:2: error PLN101")
    assert batch("--quiet").err.startswith("parts/far.csv:2: error PLN101")


@pytest.mark.slow
def test_a_killed_batch_goes_on_to_the_same_folder(batch, work, snapshot):
    for number in range(6):
        (work / "parts" / f"p{number}.csv").write_text(HEADER + row(20 * number))
    batch(output="whole")
    moments = random.Random(7)
    for _ in range(3):
        with start((), "cut") as running:
            wait_for(work / "cut" / ".postproc-journal")
            time.sleep(moments.uniform(0.0, 1.5))
            os.killpg(running.pid, signal.SIGKILL)
    (work / "cut" / ".a.src.0abc_def.part").write_bytes(b"half a progr")
    batch(output="cut")
    assert snapshot("cut") == snapshot("whole")


@pytest.mark.slow
def test_an_interrupted_batch_says_so_and_keeps_what_it_has(batch, work):
    for number in range(300):
        (work / "parts" / f"p{number}.csv").write_text(holes(2, 0.1 * number))
    with start((), "out") as running:
        wait_for(work / "out" / ".postproc-journal")
        os.killpg(running.pid, signal.SIGINT)
        errors = running.communicate()[1]
        assert running.returncode == 130
    assert "Traceback" not in errors
    assert "out:1: error CLI130: interrupted; the same call goes on from here" in errors
    kept = Manifest.load(work / "out").entries
    assert 0 < len(kept) < 300
    key = min(kept)
    assert batch(inputs=(key,)).document["kept"] == 1
    assert not (work / "out" / ".postproc-lock").exists()


def test_the_second_of_two_batches_is_refused(batch, work):
    with start((), "out") as first:
        lock = work / "out" / ".postproc-lock"
        deadline = time.monotonic() + 30
        while not lock.exists() or not lock.read_text():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        first.send_signal(signal.SIGSTOP)
        done = batch()
        first.send_signal(signal.SIGCONT)
        assert first.wait(timeout=60) == 1
        first.communicate()
    assert (done.code, done.document["schema"]) == (2, "postproc.error/1")
    line = done.err.splitlines()[0]
    assert line.startswith(
        f"out:1: error BAT011: a batch already runs here: pid {first.pid}, since"
    )
    assert batch().document["kept"] == 2


def test_a_full_disk_is_a_list_of_failures(batch, processes, work):
    """A file system that takes only small files: the limit on file size stands in for it."""
    (work / "parts" / "big.csv").write_text(holes(20))

    def small():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))

    done = processes(before=small)
    assert done.code == 1
    assert set(done.document["failed"]) == {"parts/big.csv", "parts/far.csv"}
    assert "IO003: cannot be written: File too large" in done.err
    assert {p.name for p in (work / "out").iterdir()} == {
        "a.src", "a.dat", "b.src", "b.dat", "manifest.json",
    }  # fmt: skip
    assert batch().document["failed"] == ["parts/far.csv"]


def _written(file):
    """The scheduler creates the file before it writes it."""
    return file.exists() and file.read_text().rstrip().endswith("}")


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes_although_a_worker_dies(batch, work, snapshot):
    pytest.importorskip("distributed")
    for number in range(24):
        (work / "parts" / f"p{number}.csv").write_text(holes(2, 0.1 * number))
    batch(output="here")
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    python = [sys.executable, "-m"]
    with ExitStack() as stack:

        def serve(*words):
            server = stack.enter_context(subprocess.Popen([*python, *words], **quiet))
            stack.callback(server.kill)
            return server

        file = work / "scheduler.json"
        local = ["--no-dashboard", "--host", "127.0.0.1"]
        name = ["--port", "0", "--scheduler-file", str(file)]
        serve("distributed.cli.dask_scheduler", *local, *name)
        deadline = time.monotonic() + 30
        while not _written(file) and time.monotonic() < deadline:
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        worker = ["distributed.cli.dask_worker", address, *local, "--nthreads", "1", "--no-nanny"]
        workers = [serve(*worker) for _ in range(2)]
        with start(("--dask", address), "there") as running:
            journal = work / "there" / ".postproc-journal"
            while not journal.exists() and running.poll() is None:
                time.sleep(0.05)
            workers[0].kill()  # in the middle: some are done, not all
            errors = running.communicate(timeout=60)[1]
            assert running.returncode == 1, errors
    assert snapshot("there") == snapshot("here")


def test_no_scheduler_is_one_line(batch, monkeypatch):
    distributed = pytest.importorskip("distributed")

    def silent(*_args, **_options):
        raise OSError("Timed out trying to connect to tcp://127.0.0.1:9")

    monkeypatch.setattr(distributed, "Client", silent)
    done = batch("--dask", "tcp://127.0.0.1:9")
    assert done.code == 2
    assert "BAT031" in done.err.splitlines()[0]
