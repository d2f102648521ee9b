"""Workers that hang, die or need too much memory cost only their own job."""

import os
import time

from postproc.batch import executors
from postproc.batch.jobs import Job
from postproc.batch.worker import JobResult, run_job
from postproc.pipeline.convert import ConvertRequest


def misbehave(job):
    """Stand in for a conversion: what to do is the job's name."""
    if job.key == "hang":
        time.sleep(60)
    if job.key == "die":
        os._exit(9)
    if job.key == "eat":
        bytearray(8 * 1024**3)
    return JobResult(job.key, "ok", errors=())


def _job(name):
    return Job(name, ConvertRequest(source=f"{name}.csv", cell="cell.toml"))


def test_hanging_and_dying_workers(monkeypatch):
    monkeypatch.setattr(executors, "run_job", misbehave)
    jobs = [_job(name) for name in ("a", "hang", "b", "die", "c")]
    results = {r.key: r for r in executors.run_local(jobs, 2, timeout=3.0)}
    assert {k: r.status for k, r in results.items()} == {
        "a": "ok", "b": "ok", "c": "ok", "hang": "timeout", "die": "crash",
    }  # fmt: skip
    assert results["hang"].errors == ("hang.csv:1: error BAT021: not done after 3 s",)
    assert results["die"].errors[0].startswith("die.csv:1: error BAT022")


def test_a_fault_of_ours_is_a_result_too(monkeypatch):
    import postproc.pipeline.convert as convert_module

    def broken(*_args, **_kwargs):
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(convert_module, "convert", broken)
    result = run_job(_job("x"))
    assert result.status == "crash"
    assert "BAT070" in result.errors[0]

    def hungry(*_args, **_kwargs):
        raise MemoryError

    monkeypatch.setattr(convert_module, "convert", hungry)
    assert run_job(_job("x")).status == "memory"
