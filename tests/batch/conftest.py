import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from postproc.batch import run as run_module
from postproc.batch.child import run_job
from postproc.cli.app import run as run_cli
from tests.cells import FEED, cell_text

CELL = cell_text("[optimize]\nstep_deg = 30\n", FEED)
HEADER = "x,y,z,i,j,k,depth\n"


def row(x, y=0.0):
    return f"{x:.3f},{y:.3f},0,0,0,1,5\n"


def holes(count, shift=0.0):
    return HEADER + "".join(row(20 * i + shift, shift) for i in range(count))


@dataclass
class Done:
    """How a batch ended."""

    code: int
    document: dict[str, Any] | None
    err: str


@pytest.fixture
def work(tmp_path, monkeypatch):
    """The current folder: a cell and three small inputs, one of them with an unreachable hole."""
    (tmp_path / "cell.toml").write_text(CELL)
    parts = tmp_path / "parts"
    parts.mkdir()
    (parts / "a.csv").write_text(holes(3))
    (parts / "b.csv").write_text(holes(2, 10.0))
    (parts / "far.csv").write_text(f"{HEADER}9000,0,0,0,0,1,5\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(inputs, output, arguments):
    words = ["batch", *inputs, "-o", output, "--json", "--cell", "cell.toml", "--jobs", "2"]
    return [*words, *arguments]


@pytest.fixture
def serial(monkeypatch):
    """Run jobs in this process, one after the other, last first."""

    def one_by_one(jobs, *_limits):
        return (run_job(job) for job in reversed(jobs))

    monkeypatch.setattr(run_module, "run_local", one_by_one)


@pytest.fixture
def batch(work, serial, capfd):
    """Run ``postproc batch`` in ``work``, in this process."""

    def run(*arguments, inputs=("parts",), output="out"):
        capfd.readouterr()
        code = run_cli(call(inputs, output, arguments))
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Done(code, json.loads(out) if out else None, err)

    return run


@pytest.fixture
def processes(work):
    """Run ``postproc batch`` in ``work`` as users do, with two workers."""

    def run(*arguments, inputs=("parts",), output="out", before=None):
        command = [sys.executable, "-m", "postproc", *call(inputs, output, arguments)]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, preexec_fn=before
        )
        assert "Traceback" not in done.stderr
        return Done(done.returncode, json.loads(done.stdout) if done.stdout else None, done.stderr)

    return run


@pytest.fixture
def snapshot():
    """Return all files below a folder as name -> bytes."""

    def take(folder):
        return {
            str(p.relative_to(folder)): p.read_bytes()
            for p in sorted(Path(folder).rglob("*"))
            if p.is_file()
        }

    return take
