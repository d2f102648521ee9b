"""Workers that hang, die or need too much memory cost only their own job."""

import io
import socket
import subprocess
import sys
import time

import pytest

from postproc.batch import child as child_module
from postproc.batch import executors
from postproc.batch.child import run_in_child, run_job
from postproc.batch.jobs import Job
from postproc.cli.commands.batch import EVERY, Lines, speed, ticker
from postproc.cli.common import Session
from postproc.errors import DataError
from postproc.jobs.convert import ConvertRequest
from tests.batch.misbehave import misbehave
from tests.places import FIXTURES


def _job(name):
    return Job(name, ConvertRequest(source=f"{name}.csv", cell="cell.toml"))


@pytest.mark.slow
def test_hanging_dying_and_hungry_jobs(monkeypatch):
    monkeypatch.setattr(child_module, "run_job", misbehave)
    jobs = [_job(name) for name in ("a", "hang", "b", "die", "c", "eat", "d")]
    results = {r.key: r for r in executors.run_local(jobs, 2, timeout=8.0, memory=4.0)}
    assert {k: r.status for k, r in results.items()} == {
        "a": "ok", "b": "ok", "c": "ok", "d": "ok",
        "hang": "timeout", "die": "crash", "eat": "memory",
    }  # fmt: skip
    assert results["hang"].errors == ("hang.csv:1: error BAT021: not done after 8 s",)
    assert results["die"].errors[0].startswith("die.csv:1: error BAT022")
    assert results["eat"].errors[0].startswith("eat.csv:1: error BAT020")


def test_a_child_is_used_again_and_replaced_when_it_is_gone(tmp_path):
    call = (_job("missing"), 60.0, None, child_module.__version__, str(tmp_path))
    first = run_in_child(*call)
    assert first.status == "error"
    assert "IO001" in first.errors[0]
    child = child_module._OF_THREAD.child
    process = child._process
    assert run_in_child(*call) == first
    assert child._process is process
    process.send_signal(19)  # stopped: it will never answer
    assert child.run(_job("a"), 0.2).status == "timeout"
    assert run_in_child(*call) == first
    child.close()
    assert child.run(_job("a"), None).status == "crash"
    child.end()


def test_a_script_without_a_main_guard_runs_once(tmp_path):
    (tmp_path / "few.csv").write_text("x,y,z,i,j,k\n0,0,0,0,0,1\n", encoding="utf-8")
    script = (
        "import postproc as pp\nprint('once')\n"
        f"done = pp.batch('few.csv', {str(FIXTURES / 'drilling_panel' / 'cell.toml')!r}, 'made')\n"
        "print(len(done.done), done.bad)\n"
    )
    (tmp_path / "script.py").write_text(script, encoding="utf-8")
    call = [sys.executable, "script.py"]
    ran = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ran.stdout.splitlines()[0], ran.returncode) == ("once", 0), ran.stderr
    assert ran.stdout.count("once") == 1
    assert "BAT022" not in ran.stdout


def test_a_cluster_with_another_version_makes_nothing():
    result = run_in_child(_job("a"), None, None, "0.0.other", ".")
    assert result.status == "error"
    assert "BAT033" in result.errors[0]


def test_names_count_from_the_folder_of_the_call(tmp_path):
    (tmp_path / "here.csv").write_text("no points\n", encoding="utf-8")
    (tmp_path / "cell.toml").write_text("nothing = 1\n", encoding="utf-8")
    result = run_in_child(_job("here"), 60.0, None, child_module.__version__, str(tmp_path))
    assert "cell.toml:1: error CEL" in result.errors[0]
    child_module._OF_THREAD.child.end()
    gone = run_in_child(_job("here"), 60.0, None, child_module.__version__, str(tmp_path / "no"))
    assert "BAT034" in gone.errors[0]


@pytest.mark.slow
def test_a_scheduler_that_accepts_and_is_silent_is_given_up():
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        start = time.monotonic()
        with pytest.raises(DataError, match="BAT031"):
            list(executors.run_dask([_job("a")], address))
        assert time.monotonic() - start < 20.0


def test_a_scheduler_that_dies_in_mid_run_costs_what_was_open():
    script = "from distributed import LocalCluster as C; import time; " + (
        "c = C(n_workers=1, threads_per_worker=1, processes=False, "
        "protocol='tcp://', dashboard_address=None); "
        "print(c.scheduler_address, flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", f"if __name__ == '__main__':\n {script}"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    ) as cluster:  # fmt: skip
        jobs = [_job(f"missing{k}") for k in range(200)]
        found = executors.run_dask(jobs, cluster.stdout.readline().strip())
        results = [next(found)]
        cluster.kill()
        start = time.monotonic()
        results += found
        assert time.monotonic() - start < 20.0
    assert {result.key for result in results} == {job.key for job in jobs}
    assert {line.split("error ")[1].split(":")[0] for r in results for line in r.errors} <= {
        "IO001", "BAT022", "BAT032",
    }  # fmt: skip
    assert "BAT032" in results[-1].errors[0]


def test_a_fault_of_ours_is_a_result_too(monkeypatch):
    import postproc.jobs.convert as convert_module

    def broken(*_args, **_kwargs):
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(convert_module, "convert", broken)
    result = run_job(_job("x"))
    assert result.status == "crash"
    assert "BAT070" in result.errors[0]


def test_lines_in_a_pipe_come_by_tenths_and_by_time():
    lines, now = [], [0.0]
    tick = Lines(lines.append, lambda: now[0])
    for done in range(1, 101):
        now[0] += 0.5
        tick(done, 100, done // 50)
    assert len(lines) == 10
    assert lines[4] == "50 of 100, 2.0 per s, 0:00:25 left, 1 failed"
    assert lines[9] == "100 of 100, 2.0 per s, 0:00:00 left, 2 failed"
    now[0] += 2 * EVERY
    tick(101, 10_000, 2)
    assert len(lines) == 11


@pytest.mark.parametrize(
    ("done", "seconds", "words"),
    [
        (0, 1.0, "just begun"),
        (5, 10.0, "30.0 per min, 0:00:10 left"),
        (1, 3600.0, "0.0 per min, 9:00:00 left"),
    ],
)
def test_rate_and_time_left(done, seconds, words):
    assert speed(done, 10, seconds) == words


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_gets_a_bar_with_rate_failures_and_time_left(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with ticker(Session(json=False, quiet=False)) as tick:
        tick(3, 12, 1)
    text = screen.getvalue()
    assert "3/12" in text
    assert "left, 1 failed" in text
    assert "━" in text
