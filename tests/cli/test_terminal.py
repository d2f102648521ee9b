"""What a person sees: tables and colour on a terminal, plain text in a pipe."""

import os
import pty
import subprocess
import sys

import pytest

from tests.cells import cell_text

ESCAPE = "\x1b["


def on_a_terminal(arguments, folder, **variables):
    """Run the command line on a pseudo terminal and return what it prints."""
    here, there = pty.openpty()
    environment = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    environment |= {"TERM": "xterm-256color", "COLUMNS": "160", **variables}
    process = subprocess.Popen(
        [sys.executable, "-m", "postproc", *arguments],
        stdin=there,
        stdout=there,
        stderr=there,
        cwd=folder,
        env=environment,
    )
    os.close(there)
    output = b""
    while True:
        try:
            chunk = os.read(here, 65536)
        except OSError:
            break
        if not chunk:
            break
        output += chunk
    os.close(here)
    process.wait(60)
    return output.decode()


CELL = cell_text(robot="kuka_kr210_r2700_2", tcp=(150, 0, 250), origin=(1400, -60, 700))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "p.csv").write_text("x,y,z,i,j,k\n0,0,0,0,0,1\n50,0,0,0,0,1\n")
    return tmp_path


def test_a_table_is_ruled_on_a_terminal_and_plain_in_a_pipe(folder):
    shown = on_a_terminal(["robots"], folder)
    assert "─" in shown
    piped = subprocess.run(
        [sys.executable, "-m", "postproc", "robots"], capture_output=True, text=True, check=True
    ).stdout
    assert "─" not in piped
    assert ESCAPE not in piped
    starts = {line.index(word) for line, word in zip(piped.splitlines(), ["robot", "KUKA"],
                                                     strict=False)}  # fmt: skip
    assert len(starts) == 1


def test_severities_are_coloured_on_a_terminal_only(folder):
    call = ["convert", "p.csv", "--cell", "cell.toml", "-o", "out"]
    assert ESCAPE + "33mwarning" in on_a_terminal(call, folder)
    assert ESCAPE + "33m" not in on_a_terminal(call, folder, NO_COLOR="1")
    piped = subprocess.run(
        [sys.executable, "-m", "postproc", *call], cwd=folder, capture_output=True, check=True
    )
    assert ESCAPE.encode() not in piped.stdout + piped.stderr


def test_quiet_says_nothing(folder):
    call = ["convert", "p.csv", "--cell", "cell.toml", "-o", "out", "--quiet"]
    assert on_a_terminal(call, folder) == ""
