"""The advance run: what a program may do before the motions that stand in front of it."""

import shutil
from pathlib import Path

import pytest

from postproc.api import convert, load_cell, read, verify
from postproc.errors import CellError, Severity

TRIM = Path(__file__).parents[2] / "fixtures" / "trim_5axis"
OFF = "GLOBAL DEF PP_SPINDLE_OFF()\n{}\nEND\n"
EARLY = (
    "RUNNING=FALSE",
    "RUNNING=FALSE\nWAIT FOR $IN[4]",
    "CONTINUE\n$OUT[3]=FALSE",
    "CONTINUE\nWAIT SEC 0\nRUNNING=FALSE",
    "STILL()\nEND\nDEF STILL()\nRUNNING=FALSE",
)
IN_TIME = (
    "",
    "WAIT SEC 0\nRUNNING=FALSE",
    "WAIT FOR $IN[4]\nRUNNING=FALSE",
    "$OUT[3]=FALSE\nRUNNING=FALSE",
    "HALT\nRUNNING=FALSE",
    "PULSE($OUT[3],TRUE,0.5)\nRUNNING=FALSE",
    "DECL BOOL MINE\nMINE=FALSE",
)


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(TRIM, tmp_path / "trim")
    return tmp_path / "trim"


def verdict(folder, put=("", ""), **files):
    """Return the report on the program with one text replaced and files of routines beside it."""
    src = folder / "expected" / "trim.src"
    text = (TRIM / "expected" / "trim.src").read_bytes().decode()
    assert put[0] in text
    src.write_bytes(text.replace(*put, 1).encode())
    for name, lines in files.items():
        (src.parent / f"{name}.src").write_bytes(lines.replace("\n", "\r\n").encode())
    cell = load_cell(folder / "cell.toml")
    return verify(src, cell, against=read(folder / "trim.cls", cell), collisions=False)


def kinds(report):
    return {finding.code for finding in report.violations}


def told(report):
    return [w.message.partition(" may act")[0] for w in report.warnings if w.code == "advance"]


def test_the_lines_of_a_routine_are_judged_as_they_run(folder):
    found = {}
    for body in EARLY + IN_TIME:
        report = verdict(folder, PP_SPINDLE_OFF=OFF.format(body))
        found[body] = "advance" in kinds(report)
        assert told(report) == ["PP_COOLANT_OFF"]
    assert found == dict.fromkeys(EARLY, True) | dict.fromkeys(IN_TIME, False)


def test_what_is_not_known_is_named(folder):
    assert told(verdict(folder)) == ["PP_COOLANT_OFF, PP_SPINDLE_OFF"]
    assert told(verdict(folder, ("PP_COOLANT_OFF", "WAIT SEC 0\r\nPP_COOLANT_OFF"))) == []
    assert told(verdict(folder, ("$ADVANCE=3", "$ADVANCE=0"))) == []
    continued = verdict(folder, ("PP_SPINDLE_OFF", "CONTINUE\r\nPP_SPINDLE_OFF"))
    assert kinds(continued) == {"advance"}


def test_a_dwell_may_not_be_run_ahead(folder):
    wait = "$VEL.CP=1.000000\r\n$APO.CDIS=0.5000"
    assert kinds(verdict(folder, (wait, f"CONTINUE\r\nWAIT SEC 2\r\n{wait}"))) >= {"advance"}


@pytest.mark.parametrize(
    ("own", "waits"),
    [
        ("[]", 1),
        ('["coolant_off"]', 1),
        ('["spindle_off"]', 1),
        ('["coolant_off","spindle_off"]', 0),
    ],
)
def test_the_cell_says_which_routines_stop_it(folder, own, waits):
    cell = folder / "cell.toml"
    cell.write_text(f"{cell.read_text()}\n[krl.hooks]\nstops_advance = {own}\n")
    job = convert(read(folder / "trim.cls", load_cell(cell)), load_cell(cell))
    assert job.good
    assert not [f for f in job.findings if f.code == "advance" and f.severity is Severity.WARNING]
    text = job.files["trim.src"].decode()
    assert text.count("WAIT SEC 0") == waits
    plain = (TRIM / "expected" / "trim.src").read_bytes().decode()
    without = [line for line in text.splitlines() if not line.startswith("WAIT SEC 0")]
    assert without == plain.splitlines()


def test_a_routine_that_there_is_not(folder):
    cell = folder / "cell.toml"
    cell.write_text(f'{cell.read_text()}\n[krl.hooks]\nstops_advance = ["spindle"]\n')
    with pytest.raises(CellError, match="stops_advance: no routine 'spindle'"):
        load_cell(cell)
