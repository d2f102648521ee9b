import json
from pathlib import Path

import pytest

from postproc.cli import app

ROOT = Path(__file__).resolve().parents[2]
PANEL = ROOT / "fixtures" / "drilling_panel"

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
[stiffness]
joint_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
[motion]
feed_mm_min = 600
"""


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(CELL)
    return path


@pytest.fixture
def run(capsys):
    """Run the command line; return exit code, JSON document (or None) and stderr."""

    def call(*arguments):
        code = app.run([str(a) for a in arguments])
        captured = capsys.readouterr()
        return code, json.loads(captured.out) if captured.out.strip() else None, captured.err

    return call
