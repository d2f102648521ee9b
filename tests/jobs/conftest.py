import json

import pytest

from postproc.cli import app
from tests.cells import FEED, STIFFNESS, cell_text


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(cell_text(STIFFNESS, FEED))
    return path


@pytest.fixture
def run(capsys):
    """Run the command line; return exit code, JSON document (or None) and stderr."""

    def call(*arguments):
        code = app.run([str(a) for a in arguments])
        captured = capsys.readouterr()
        return code, json.loads(captured.out) if captured.out.strip() else None, captured.err

    return call
