"""What a stranger meets in the first hour: each answer names what, where, what else, what next."""

import re
import zipfile

import pytest

from postproc.cli.app import run
from tests.places import FIXTURES

LONGEST = 200
"""Characters of a line that a terminal of two columns of code still shows whole."""
CELL = str(FIXTURES / "drilling_panel" / "cell.toml")
PANEL = str(FIXTURES / "drilling_panel" / "panel.csv")
NEW = ("new-cell", "-o", "new.toml", "--robot")
CONVERT = ("convert", "few.csv", "--cell", CELL, "-o", "out")
BATCH = ("batch", "--cell", CELL, "-o", "made", "--jobs", "1")
HEAD = "id,x,y,z,i,j,k,depth,feed,rpm\n"
FILES = {
    "few.csv": HEAD + "H1,0,0,0,0,0,1,5,100,3000\nH2,60,0,0,0,0,1,5,100,3000\n",
    "far.csv": HEAD + "H1,9000,0,0,0,0,1,5,100,3000\n",
    "tilted.csv": "x,y,z,i,j,k,depth\n100,200,300,0,0.6,0.8,7\n",
    "bad.csv": "x,y,z,i,j,k\nabc\n",
    "list.csv": "some words\nand others\n",
    "part.h": "BEGIN PGM 7 MM\n1 L X+10 Y+5 R0 FMAX\nEND PGM 7 MM\n",
    "part.mpf": "%_N_TEST_MPF\nG54\nCYCLE81(10,0,2,-5)\nM30\n",
    "tool.nc": "%\nO1\nG21 G90\nG0 X0. Y0. Z5.\nG41 D1\nG1 X5. F100.\nM30\n%\n",
    "part.stp": "ISO-10303-21;\nHEADER;\n",
    "torn.xlsx": "PK\3\4 torn",
    "text.xls": "not a sheet",
    "prog.src": "DEF prog( )\nEND\n",
}
TABLE = [
    # call, exit code, words that the answer has
    ((*NEW, "KR QUANTEC"), 2, ("series of KUKA", "90-300 kg", "postproc robots --payload 90")),
    ((*NEW, "IRB 6700"), 2, ("'IRB 6700'", "arms of KUKA", "--urdf FILE")),
    ((*NEW, "quantec 210"), 2, ("kuka_kr210_r2700_2", "more")),
    ((*NEW, "kr210"), 2, ("kuka_kr210_r2700_2", "more", "postproc robots")),
    ((*NEW, "KR 211 R2700"), 2, ("nearest is 'kuka_kr", "postproc robots")),
    ((*CONVERT, "--emitter", "fanuc"), 2, ("'fanuc'", "expected kuka_krl", "plug-in")),
    ((*CONVERT, "--format", "step"), 2, ("'step'", "expected apt", "gcode", "plug-in")),
    ((*CONVERT, "--strateg", "each"), 2, ("--strateg", "--strategy")),
    (("inspect", "book.xlsx"), 2, ("Excel", "Save As", "CSV")),
    (("inspect", "torn.xlsx"), 2, ("Excel", "Save As", "CSV")),
    (("inspect", "text.xls"), 2, ("damaged spreadsheet", "Save As", "CSV")),
    (("inspect", "part.h"), 2, ("Heidenhain", "G-code")),
    (("inspect", "part.mpf"), 2, ("Sinumerik", "G-code")),
    (("inspect", "part.stp"), 2, ("STEP", "[workpiece]")),
    (("inspect", "prog.src"), 2, ("KUKA program", "verify")),
    (("inspect", "list.csv"), 2, ("list.csv:1: error IO010", "csv")),
    (("inspect", "nobody.apt"), 2, ("nobody.apt:1: error IO001", "no such file")),
    (("inspect", "tilted.csv"), 0, ("to 7 mm below", "above its surface")),
    (("convert", "tool.nc", "--cell", CELL, "-o", "out"), 1, ("tool.nc:5", "G41", "compensation")),
    (("convert", "far.csv", "--cell", CELL, "-o", "out"), 1, ("far.csv:2", "out of reach")),
    ((*CONVERT, "--report", "page.html"), 0, ("out/few.src", "tags     2", "page.html")),
    (("verify", "out/few.src", "--cell", CELL, "--against", "few.csv"), 0,
     ("measure", "allowed", "where", "out/few.src:", "2 of them passed in order", "good")),
    (("lint", "out/few.src"), 0, ("0 errors",)),
    (("diff", "out", "out"), 0, ("same",)),
    ((*BATCH, "few.csv", "bad.csv", "far.csv"), 1,
     ("converted 1 of 3, failed 2", "bad.csv", "far.csv:2")),
    ((*BATCH, "few.csv", "bad.csv", "-q"), 1, ("bad.csv",)),
    (("check", CELL), 0, ("kuka_kr500_r2830", "CEL147", "home_deg")),
    (("explain", "nobody"), 2, ("'nobody'", "postproc explain lists all")),
    (("explain", "joint_margin"), 0, ("soft limit", "joint_margin_deg")),
    (("robots", "--reach", "2700", "--payload", "200"), 0, ("kuka_kr210_r2700_2",)),
]  # fmt: skip


@pytest.fixture(scope="module")
def hour(tmp_path_factory):
    """Return what each call of the table answers: exit code and text, made in one folder."""
    folder = tmp_path_factory.mktemp("hour")
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="ascii")
    with zipfile.ZipFile(folder / "book.xlsx", "w") as book:
        book.writestr("[Content_Types].xml", "<Types/>")
    return folder


@pytest.mark.slow
@pytest.mark.causes
def test_every_answer_names_what_where_and_what_next(hour, capsys, monkeypatch):
    monkeypatch.chdir(hour)
    wrong = []
    for call, code, words in TABLE:
        done = run(list(call))
        out, err = capsys.readouterr()
        text = out + err
        missing = [word for word in words if word not in text]
        long = [line for line in err.splitlines() if len(line.replace(str(FIXTURES), "")) > LONGEST]
        if done != code or missing or long or "Traceback" in text or "please report" in text:
            wrong.append((" ".join(call), done, missing, long))
    assert wrong == []


def test_every_word_in_front_of_a_figure_and_every_code_is_explained(hour, capsys, monkeypatch):
    monkeypatch.chdir(hour)
    for call in (
        ("inspect", "few.csv"),
        ("check", CELL),
        (*CONVERT, "--keep", "out", "--report", "p.html"),
        ("verify", "out/few.src", "--cell", CELL, "--against", "few.csv"),
    ):
        run(list(call))
    out, err = capsys.readouterr()
    words = set(re.findall(r"^([a-z]\w*(?: \w+)*)(?:  +|$)", out, re.M | re.I))
    words |= set(re.findall(r"(?:error|warning|note) ([\w-]+):", out + err))
    words |= {"worst", "allowed", "good", "acceptable", "critical", "invalid", "clearance"}
    words |= {"explained", "no_gap", "unexplained", "undetermined", "noise"}
    assert len(words) >= 40
    assert [word for word in sorted(words) if run(["explain", word])] == []
