"""What counts as a difference of two programs, and what does not."""

import json
import re

import numpy as np
import pytest

from postproc.cli.app import run
from postproc.comparison.align import Lines, align
from postproc.comparison.diff import diff, diff_files
from postproc.comparison.difference import DiffTolerance
from postproc.errors import PostprocError
from postproc.krl.text.parse import parse_files
from postproc.krl.text.render import render

OLD = """DEF JOB( )
;FOLD INI
BAS(#INITMOV,0)
;ENDFOLD
BAS(#TOOL,1)
BAS(#BASE,2)
BAS(#VEL_PTP,50)
PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0}
PP_SPINDLE_ON(3000)
PTP {X 0.0,Y 0.0,Z 100.0,A 0.0,B 90.0,C 0.0,S 2,T 2} C_PTP
$VEL.CP=0.5
$APO.CDIS=1.0
LIN {X 0.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0}
$VEL.CP=0.01
LIN {X 10.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0} C_DIS
LIN {X 20.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0} C_DIS
CIRC {X 25.0,Y 5.0,Z 5.0},{X 20.0,Y 10.0,Z 5.0,A 0.0,B 90.0,C 0.0}
WAIT SEC 0.5
IF bGo THEN
LIN {X 30.0,Y 10.0,Z 5.0,A 0.0,B 90.0,C 0.0}
ENDIF
$OUT[5]=TRUE
FOR i=1 TO 3
LIN_REL {Z 1.0} #TOOL
ENDFOR
WAIT FOR $IN[1] AND ($IN[2]==FALSE)
PP_SPINDLE_OFF()
PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0}
END
"""


def compare(new, old=OLD, tolerance=None):
    return diff_files({"JOB.src": old.encode()}, {"JOB.src": new.encode()}, "JOB", tolerance)


def change(old, new, count=1):
    assert old in OLD
    return OLD.replace(old, new, count)


def kinds(report):
    return [item.kind for item in report.differences]


POINT = "X 10.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0}"
FRAME = "{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}"
TRIGGER = "TRIGGER WHEN PATH=5 DELAY=0 DO $OUT[1]=TRUE"
EXTRA = "LIN {X 15.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0}"
SAME = {
    "comments and folds": change(
        "WAIT SEC 0.5", "; now\n;FOLD wait\nWAIT SEC 0.5 ; half a second\n;ENDFOLD"
    ),
    "a comment behind every line": "\n".join(f"{line} ; c" for line in OLD.split("\n")),
    "blank lines and blanks": OLD.replace("\n", "\n\n").replace(",", " , "),
    "case of words": change("LIN {X 10.0", "lin {x 10.0"),
    "digits": change("X 10.0,Y 0.0", "X 10,Y 0.0000"),
    "exponents": change("X 10.0,Y 0.0", "X 1.0E+01,Y -2.6E-14"),
    "order of components": change("X 10.0,Y 0.0,Z 5.0", "Z 5.0,X 10.0,Y 0.0"),
    "type prefix": change("PTP {X 0.0", "PTP {E6POS: X 0.0"),
    "binary S and T": change("S 2,T 2", "S 'B010',T 'B10'"),
    "angles a full turn on": change("X 10.0,Y 0.0,Z 5.0,A 0.0", "X 10.0,Y 0.0,Z 5.0,A 360.0"),
    "name of the program": OLD.replace("DEF JOB", "DEF WORK"),
    "how a speed is set": change("$VEL.CP=0.5", "BAS(#VEL_CP,0.5)"),
    "how all axis speeds are set": change(
        "BAS(#VEL_PTP,50)", "\n".join(f"$VEL_AXIS[{i}]=50.0" for i in range(1, 7))
    ),
    "settings said again": change("LIN {X 20.0", "$VEL.CP=0.01\nBAS(#TOOL,1)\nLIN {X 20.0"),
    "a point by name": change(
        "LIN {X 10.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0} C_DIS",
        "xP={X 10.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0}\nLIN xP C_DIS",
    ).replace("DEF JOB( )", "DEF JOB( )\nDECL FRAME xP"),
    "a variable of its own": change("WAIT SEC 0.5", "rPause=0.25*2\nWAIT SEC rPause").replace(
        "DEF JOB( )", "DEF JOB( )\nDECL REAL rPause"
    ),
    "digits of a condition": change("FOR i=1 TO 3", "FOR i=1.0 TO 3.00"),
    "the message that a loop shows": change("WAIT SEC 0.5", 'WAIT SEC 0.5\n$LOOP_MSG[]="x"'),
    "declarations": change("DEF JOB( )", "DEF JOB( )\nDECL INT i,k\nDECL REAL r"),
    "header": "&ACCESS RVP\n&REL 7\n" + OLD,
    "a point within the tolerance": change("X 10.0,Y 0.0", "X 10.0008,Y 0.0"),
}


@pytest.mark.parametrize("name", SAME)
def test_what_does_not_count(name):
    report = compare(SAME[name])
    assert report.differences == ()
    assert report.same


MOVED = ("X 10.0,Y 0.0,Z 5.0", "X 10.0,Y 0.3,Z 5.4")
DIFFERENT = {
    "moved": (change(*MOVED), ["moved"]),
    "turned": (change(POINT, POINT.replace("90.0", "89.5")), ["moved"]),
    "other joints": (change("A5 45.0", "A5 46.0"), ["moved"]),
    "auxiliary point": (change("X 25.0,Y 5.0", "X 15.0,Y 5.0"), ["moved"]),
    "arc angle": (change("C 0.0}\nWAIT", "C 0.0},CA 200.0\nWAIT"), ["moved"]),
    "removed": (re.sub(r"LIN \{X 20.*\n", "", OLD), ["removed"]),
    "inserted": (change("LIN {X 20.0", f"{EXTRA}\nLIN {{X 20.0"), ["inserted"]),
    "other instruction": (change("LIN {X 10.0", "SLIN {X 10.0"), ["motion"]),
    "PTP for LIN": (change("LIN {X 10.0", "PTP {X 10.0"), ["motion"]),
    "speed": (change("$VEL.CP=0.01", "$VEL.CP=0.012"), ["speed"]),
    "axis speed": (change("#VEL_PTP,50", "#VEL_PTP,60"), ["speed"]),
    "status": (change("S 2,T 2", "S 6,T 18"), ["status"]),
    "status left out": (change(",S 2,T 2", ""), ["status"]),
    "exact stop": (change(f"{POINT} C_DIS", POINT), ["approximation"]),
    "approximation distance": (change("$APO.CDIS=1.0", "$APO.CDIS=2.0"), ["approximation"]),
    "tool": (change("#TOOL,1", "#TOOL,3"), ["tool"]),
    "base": (change("#BASE,2", "#BASE,3"), ["base"]),
    "a tool frame": (change("BAS(#TOOL,1)", f"BAS(#TOOL,1)\n$TOOL={FRAME}"), ["tool"]),
    "orientation speed": (change("$VEL.CP=0.5", "$VEL.CP=0.5\n$VEL.ORI1=50"), ["settings"]),
    "orientation type": (change("$VEL.CP=0.5", "$VEL.CP=0.5\n$ORI_TYPE=#JOINT"), ["settings"]),
    "external axis": (change("A6 0.0}\nEND", "A6 0.0,E1 100.0}\nEND"), ["external"]),
    "relative frame": (change("#TOOL\nENDFOR", "#BASE\nENDFOR"), ["motion"]),
    "a lost call": (change("PP_SPINDLE_OFF()\n", ""), ["call"]),
    "another argument": (change("ON(3000)", "ON(300)"), ["call"]),
    "an output": (change("$OUT[5]=TRUE", "$OUT[6]=TRUE"), ["io"]),
    "an output's value": (change("$OUT[5]=TRUE", "$OUT[5]=FALSE"), ["io"]),
    "a dwell": (change("SEC 0.5", "SEC 0.25"), ["wait"]),
    "a condition": (change("$IN[1] AND", "$IN[1] OR"), ["wait"]),
    "a loop": (change("1 TO 3", "1 TO 4"), ["control"]),
    "a trigger": (change("LIN {X 20.0", f"{TRIGGER}\nLIN {{X 20.0"), ["other", "io"]),
    "an interrupt": (change("WAIT SEC", "INTERRUPT ON 21\nWAIT SEC"), ["other"]),
    "a setting that nothing uses": (change("WAIT SEC", "$APO.CORI=7\nWAIT SEC"), ["approximation"]),
    "one that is set again": (change("WAIT SEC", "$VEL.CP=7\n$VEL.CP=0.01\nWAIT SEC"), ["other"]),
    "one before INITMOV": (change(";FOLD INI", "$CIRC_TYPE=#PATH"), ["other"]),
    "behind the last motion": (OLD.replace("END\n", "$OV_PRO=10\nEND\n"), ["settings"]),
    "a frame by its number": (change("BAS(#TOOL,1)", "BAS(#TOOL,1)\n$TOOL=TOOL_DATA[2]"), ["tool"]),
    "a component": (change("WAIT SEC", "$TOOL.Z=$TOOL.Z+1\nWAIT SEC"), ["tool"]),
    "a load": (change("WAIT SEC", "$LOAD.M=3\nWAIT SEC"), ["settings"] * 2),
    "a ramp": (change("WAIT SEC", "$ACC.ORI1=3\nWAIT SEC"), ["settings"]),
    "a limit": (change("WAIT SEC", "$SOFTP_END[2]=3\nWAIT SEC"), ["settings"]),
    "an unknown variable": (change("WAIT SEC", "$WHAT_EVER=3\nWAIT SEC"), ["settings"]),
    "a command of BAS": (change("WAIT SEC", "BAS(#EX_BASE,2)\nWAIT SEC"), ["other"]),
    "a variable that others see": (change("WAIT SEC", "g_rpm=6000\nWAIT SEC"), ["data"]),
    "a flag": (change("WAIT SEC", "$FLAG[3]=TRUE\nWAIT SEC"), ["io"]),
    "a signal": (change("DEF JOB( )", "DEF JOB( )\nSIGNAL sVac $OUT[5]"), ["other"]),
    "an instruction as written": (change("WAIT SEC", "CONST_VEL START=1\nWAIT SEC"), ["other"]),
    "the advance run": (change("WAIT SEC", "CONTINUE\nWAIT SEC"), ["other"]),
    "the delivered interrupt": (change("WAIT SEC", "INTERRUPT OFF 3\nWAIT SEC"), ["other"]),
    "what is not known": (change("WAIT SEC", "$APO.CDIS=rWhat*2\nWAIT SEC"), ["data"]),
    "a line in a branch": (change("IF bGo THEN", "IF bGo THEN\n$VEL.CP=0.3"), ["other", "speed"]),
    "a routine that a trigger calls": (OLD + "DEF UP()\n$OUT[9]=TRUE\nEND\n", ["control", "io"]),
    "tool data": (change("WAIT SEC", "TOOL_DATA[1].X=5.0\nWAIT SEC"), ["data"]),
}  # fmt: skip


@pytest.mark.parametrize("name", DIFFERENT)
def test_what_counts(name):
    new, expected = DIFFERENT[name]
    report = compare(new)
    assert sorted(kinds(report)) == sorted(expected)
    back = compare(OLD, old=new)
    swapped = {"inserted": "removed", "removed": "inserted"}
    assert sorted(kinds(back)) == sorted(swapped.get(kind, kind) for kind in expected)


def test_sizes_and_places():
    report = compare(change(*MOVED))
    moved = report.differences[0]
    assert moved.distance_mm == pytest.approx(0.5)
    assert moved.angle_deg is None
    assert (moved.old_line, moved.new_line) == (15, 15)
    assert moved.position_mm == ((10.0, 0.0, 5.0), (10.0, 0.3, 5.4))
    turned = compare(DIFFERENT["turned"][0]).differences[0]
    assert turned.angle_deg == pytest.approx(0.5)
    assert turned.distance_mm is None
    shifted = compare("; one more line\n" + change(*MOVED)).differences[0]
    assert (shifted.old_line, shifted.new_line) == (15, 16)
    assert compare(change(*MOVED), tolerance=DiffTolerance(position_mm=0.6)).same


def test_the_document():
    report = compare(change(*MOVED).replace("PP_SPINDLE_OFF()\n", ""))
    document = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert document["schema"] == "postproc.diff/1"
    assert document["same"] is False
    assert document["counts"] == {"call": 1, "moved": 1}
    first, second = document["differences"]
    assert (first["kind"], first["old_line"], first["new_line"]) == ("moved", 15, 15)
    assert (second["kind"], second["new_line"]) == ("call", None)
    assert "moved at most 0.5000 mm" in report.summary()


# ------------------------------------------------------------------------- files and folders


def write(folder, **files):
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        stem, _, suffix = name.rpartition("_")
        (folder / f"{stem}.{suffix}").write_bytes(text.replace("\n", "\r\n").encode())
    return folder


LINES = [f"LIN {{X {i}.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}" for i in range(8)]


def whole(lines, name="W"):
    return "\n".join([f"DEF {name}( )", *lines, "END", ""])


def test_where_a_program_is_cut_does_not_count(tmp_path):
    one = write(tmp_path / "one", W_src=whole(LINES))
    parts = {
        "W_src": whole(["W_001()", "W_002()"]),
        "W_001_src": "\n".join(["DEF W_001( )", *LINES[:5], "END", ""]),
        "W_002_src": "\n".join(["DEF W_002( )", *LINES[5:], "END", ""]),
    }
    two = write(tmp_path / "two", **parts)
    assert diff(one / "W.src", two / "W.src").same
    parts["W_002_src"] = parts["W_002_src"].replace("X 6.0", "X 6.5")
    three = write(tmp_path / "three", **parts)
    report = diff(one / "W.src", three / "W.src")
    assert kinds(report) == ["moved"]
    assert report.differences[0].new_file.endswith("W_002.src")
    assert report.differences[0].new_line == 3


def test_points_of_the_data_list_are_looked_up(tmp_path):
    data = "DEFDAT W\nDECL E6POS {0}={{X 1.0,Y {1},Z 0.0,A 0.0,B 0.0,C 0.0}}\nENDDAT\n"
    for folder, name, y in (("a", "XP1", 0.0), ("b", "XQ7", 0.0), ("c", "XP1", 0.5)):
        write(tmp_path / folder, W_src=whole([f"LIN {name}"]), W_dat=data.format(name, y))
    assert diff(tmp_path / "a" / "W.src", tmp_path / "b" / "W.src").same
    assert kinds(diff(tmp_path / "a" / "W.src", tmp_path / "c" / "W.src")) == ["moved"]


def test_folders_module_by_module(tmp_path):
    config = "DEFDAT $CONFIG\nDECL REAL rFeed={0}\nENDDAT\n"
    files = {"A_src": whole(LINES, "A"), "B_src": whole(LINES[:3], "B")}
    old = write(tmp_path / "old", **files, **{"$config_dat": config.format("0.5")})
    new = write(tmp_path / "new", **files, **{"$config_dat": config.format("0.50")})
    assert diff(old, new).same
    assert diff(old, new).modules == ("$CONFIG", "A", "B")
    (new / "B.src").unlink()
    moved = files["A_src"].replace("X 3.0", "X 3.1")
    write(new, C_src=whole(LINES[:2], "C"), A_src=moved)
    write(new, **{"$config_dat": config.format("0.6")})
    report = diff(old, new)
    assert sorted(kinds(report)) == ["data", "module", "module", "moved"]


def test_parts_of_a_program_are_compared_where_it_calls_them(tmp_path):
    calls = whole(["A_1()", "A_2()"], "A")
    data = "DEFDAT A_1 PUBLIC\nDECL GLOBAL REAL rSeen={0}\nENDDAT\n"
    parts = {"A_1_src": whole(LINES[:2], "A_1"), "A_2_src": whole(LINES[2:], "A_2")}
    old = write(tmp_path / "old", A_src=calls, A_1_dat=data.format("1.0"), **parts)
    cut = {"A_1_src": whole(LINES[:1], "A_1"), "A_2_src": whole(LINES[1:], "A_2")}
    new = write(tmp_path / "new", A_src=calls, A_1_dat=data.format("1.0"), **cut)
    assert diff(old, new).same
    assert diff(old, new).modules == ("A",)
    write(new, A_1_dat=data.format("2.0"))
    assert kinds(diff(old, new)) == ["data"]
    assert list(diff(old, new).by_module()) == ["A"]
    for more, modules in (
        ({"B_src": whole(["A_1()"], "B")}, ("A", "A_1", "B")),  # of two programs: by itself
        ({"A_2_src": whole([*LINES[2:], "A_2()"], "A_2")}, ("A", "A_2")),  # two call it
        ({"A_2_src": parts["A_2_src"] + "DEF L()\nL()\nEND\n"}, ("A", "A_1", "A_2")),  # endless
    ):
        for side in (old, new):
            write(side, **parts | {"A_1_dat": data.format("1.0")} | more)
        assert diff(old, new).same
        assert diff(old, new).modules == modules
        (new / "B.src").unlink(missing_ok=True)
        (old / "B.src").unlink(missing_ok=True)


def test_one_bad_file_does_not_stop_the_folder(tmp_path):
    for side in ("old", "new"):
        (tmp_path / side).mkdir()
        (tmp_path / side / "JOB.src").write_text(OLD)
        (tmp_path / side / "same.src").write_bytes(b"\x00\x01")
        (tmp_path / side / "cut.src").write_text("DEF CUT( )\nHALT\n")
    assert diff(tmp_path / "old", tmp_path / "new").same
    (tmp_path / "new" / "same.src").write_bytes(b"\x00\x02")
    (tmp_path / "new" / "cut.src").write_text("DEF CUT( )\nHALT\nEND\n")
    report = diff(tmp_path / "old", tmp_path / "new")
    details = {item.detail.split(":")[0]: item for item in report.differences}
    assert set(details) == {"module SAME cannot be compared", "module CUT cannot be compared"}
    assert report.counts() == {"module": 2}
    assert report.old_motions == report.new_motions > 0


def test_what_cannot_be_compared(tmp_path):
    folder = write(tmp_path / "a", W_src=whole(LINES))
    broken = write(tmp_path / "b", W_src=whole(["IF x THEN"]))
    foreign = write(tmp_path / "c", W_src=whole(["G01 X3"]))
    huge = write(tmp_path / "d", W_src=whole(["PULSE($OUT[1], TRUE, 1e10)"]))
    for left, right, code in (
        (folder, folder / "W.src", "DIF001"),
        (folder / "W.src", broken / "W.src", "KRL009"),
        (folder / "W.src", foreign / "W.src", "KRL004"),
        (folder / "W.src", huge / "W.src", "KRL901"),
        (folder / "W.src", tmp_path / "none.src", "IO001"),
    ):
        with pytest.raises(PostprocError) as caught:
            diff(left, right)
        assert caught.value.code == code
        assert code != "KRL901" or caught.value.source.path == str(right)


def test_programs_of_ours_are_the_same_after_reading_and_printing(emitted):
    styles = (
        ("dense", "inline"),
        ("dense", "dat"),
        ("spline_block", "inline"),
        ("forms", "dat"),
    )
    for style in styles:
        _, _, files = emitted(*style)
        module = parse_files(files)[0]
        again = render(module)[0]
        name = f"{module.name}.src"
        assert diff_files({name: files[name]}, {name: again}, name).same


# -------------------------------------------------------------------------------- alignment


def lines(keys, numbers=None):
    keys = np.array(keys, dtype=np.int64)
    values = np.zeros((len(keys), 6)) if numbers is None else np.asarray(numbers, dtype=float)
    zeros = np.zeros(len(keys), dtype=np.int64)
    return Lines(keys, zeros, zeros, values)


def test_alignment_keeps_order_and_finds_the_most():
    rng = np.random.default_rng(4)
    for _ in range(100):
        a, b = rng.integers(0, 5, 12), rng.integers(0, 5, 14)
        far = np.arange(5)[:, None] * 1000.0 * np.ones(6)
        i, j = align(lines(a, far[a]), lines(b, far[b]))
        assert (np.diff(i) > 0).all()
        assert (np.diff(j) > 0).all()


def test_a_shifted_copy_of_a_long_program():
    rng = np.random.default_rng(5)
    n = 3000
    points = np.cumsum(rng.normal(size=(n, 6)), axis=0)
    moved = points + 0.5
    cut = np.delete(np.arange(n), [700, 1500, 1501])
    i, _ = align(lines(np.arange(n), points), lines(np.arange(n, 2 * n - 3), moved[cut]))
    assert len(i) == n - 3
    missing = sorted(set(range(n)) - set(i.tolist()))
    assert np.abs(np.array(missing) - [700, 1500, 1501]).max() <= 3


def test_what_a_data_list_assigns_is_compared(tmp_path, capsys):
    """Arrays have their values in lines of their own: the tools of $config.dat."""
    text = "DEFDAT $CONFIG\nDECL FRAME TOOL_DATA[16]\nTOOL_DATA[3]={X 1.0,Y 2.0,Z 3.0}\nENDDAT\n"
    for name, content in (("old", text), ("new", text.replace("Z 3.0", "Z 3.5"))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "$config.dat").write_text(content)
    assert run(["diff", str(tmp_path / "old"), str(tmp_path / "new")]) == 1
    assert "TOOL_DATA[3]" in capsys.readouterr().out
