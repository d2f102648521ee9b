import json
import subprocess
import sys
from pathlib import Path

import pytest

CELL = """\
schema = "postproc.cell/1"
name = "bench"
[robot]
model = "kuka_kr500_r2830"
[tool]
number = 1
name = "head"
frame = { xyz_mm = [107, 0, 362], abc_deg = [0, 0, 0] }
axis = "+x"
[workpiece]
number = 1
frame = { xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }
[motion]
feed_mm_min = 600
"""


def holes(count, shift=0.0):
    rows = "".join(f"{20 * i + shift:.3f},{shift:.3f},0,0,0,1,5\n" for i in range(count))
    return "x,y,z,i,j,k,depth\n" + rows


@pytest.fixture
def work(tmp_path):
    """A folder with a cell and three small inputs, one of them with an unreachable hole."""
    (tmp_path / "cell.toml").write_text(CELL)
    parts = tmp_path / "parts"
    parts.mkdir()
    (parts / "a.csv").write_text(holes(4))
    (parts / "b.csv").write_text(holes(3, 10.0))
    (parts / "far.csv").write_text("x,y,z,i,j,k,depth\n9000,0,0,0,0,1,5\n")
    return tmp_path


@pytest.fixture
def batch(work):
    """Run ``postproc batch`` in ``work``; return exit code, JSON document and stderr."""

    def run(*arguments, inputs=("parts",), output="out", check=True):
        command = [sys.executable, "-m", "postproc", "batch", *inputs, "-o", output, "--json"]
        command += ["--cell", "cell.toml", "--jobs", "2", *arguments]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
        assert "Traceback" not in done.stderr
        return done.returncode, json.loads(done.stdout) if done.stdout else None, done.stderr

    return run


@pytest.fixture
def snapshot():
    """Return all files below a folder as name -> bytes."""

    def take(folder: Path):
        return {
            str(p.relative_to(folder)): p.read_bytes()
            for p in sorted(folder.rglob("*"))
            if p.is_file()
        }

    return take
