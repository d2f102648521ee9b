"""Odd jobs of several tools and setups, each against closed forms or pinocchio."""

import re

import numpy as np
import pytest

from postproc.cell.file import load_cell
from tests import wing
from tests.jobs.test_tools import tips

NX = ("--dialect", "nx")


@pytest.fixture
def convert(tmp_path, run):
    """Return a function that converts a text in a cell; code, document and program."""

    def make(text, cell_text, name="wing.cls", options=NX):
        cam, cell, out = tmp_path / name, tmp_path / "cell.toml", tmp_path / "out"
        cam.write_text(text)
        cell.write_text(cell_text)
        code, document, _ = run(
            "convert", cam, "--cell", cell, "-o", out, "--name", "wing", "--json", *options
        )
        if code == 0:
            verify = ("verify", out / "wing.src", "--cell", cell, "--against", cam, "--json")
            found, report, _ = run(*verify, *options)
            assert (found, report["violations"]) == (0, [])
        return code, document, out / "wing.src"

    return make


def drilled(*calls, units="MM", scale=1.0, extra=()):
    """Return an NX text: for each call (tool, setup, places) the tool's cycle at the places."""
    lines = ["PARTNO wing", f"UNITS/{units}"]
    feed = "MMPM" if units == "MM" else "IPM"
    for tool, setup, places in calls:
        origin = [v / scale for v in wing.SETUPS[setup]]
        words = wing.CYCLES[tool].split(",")
        words[1:] = [
            f"{float(w) / scale:.6f}" if re.fullmatch(r"-?[\d.]+", w) else w for w in words[1:]
        ]
        cycle = ",".join(words).replace("MMPM", feed)
        lines += [
            "MSYS/" + ",".join(f"{v:.6f}" for v in (*origin, 1, 0, 0, 0, 1, 0)),
            f"LOADTL/{tool}", "SPINDL/2000,RPM,CLW", "RAPID",
            f"GOTO/0.,0.,{80 / scale:.6f},0.,0.,1.", cycle,
            *(f"GOTO/{x / scale:.6f},{y / scale:.6f},0.,0.,0.,1." for x, y in places),
            *extra, "CYCLE/OFF", "RAPID", f"GOTO/0.,0.,{80 / scale:.6f},0.,0.,1.",
        ]  # fmt: skip
    return "\n".join([*lines, "SPINDL/OFF", "FINI", ""])


def assert_drilled(program, cell, calls):
    """The bottoms of all calls are reached in order, each by its tool in its base."""
    tool, base, points = tips(program, cell)
    at = 0
    for number, setup, places in calls:
        for x, y in places:
            mine = (tool == 6 + number) & (base == 2 + setup)
            off = np.linalg.norm(points - [x, y, -wing.DEPTHS[number]], axis=1)
            near = np.flatnonzero(mine & (off < 0.01))
            near = near[near >= at]
            assert len(near), (number, setup, x, y)
            at = int(near[0]) + 1


A, B = [(0, 0), (15, 0)], [(30, 15), (45, 15)]


def test_tools_changed_back_and_forth(convert, tmp_path):
    calls = [(1, 1, A), (2, 1, A), (1, 1, B), (3, 2, A), (1, 2, A), (3, 1, A), (1, 1, [(60, 0)])]
    code, document, program = convert(drilled(*calls), wing.cell_text())
    assert (code, document["failures"]) == (0, [])
    assert_drilled(program, tmp_path / "cell.toml", calls)
    text = program.read_text()
    assert re.findall(r"PP_TOOL_CHANGE\((\d)\)", text) == [str(tool) for tool, _, _ in calls]


def test_a_base_switched_inside_a_cycle(convert, tmp_path):
    """The cycle goes on in the other setup: the same depth, the tool goes home in between."""
    text = drilled((1, 1, A))
    second = "MSYS/" + ",".join(f"{v:.4f}" for v in (*wing.SETUPS[2], 1, 0, 0, 0, 1, 0))
    more = [second, *(f"GOTO/{x},{y},0.,0.,0.,1." for x, y in B)]
    text = text.replace("CYCLE/OFF", "\n".join([*more, "CYCLE/OFF"]))
    code, document, program = convert(text, wing.cell_text())
    assert (code, document["failures"]) == (0, [])
    assert_drilled(program, tmp_path / "cell.toml", [(1, 1, A), (1, 2, B)])
    lines = program.read_text().splitlines()
    change = next(i for i, line in enumerate(lines) if line.startswith("BAS(#BASE,4)"))
    motion = [line for line in lines[:change] if re.match(r"PTP|LIN|CIRC", line)]
    assert motion[-1].startswith("PTP {A1 0.00000,A2 -90.00000"), "changed at home"


def test_a_tool_without_mass_has_no_load_data(convert, tmp_path):
    text = wing.cell_text("[krl]\nsetup = true\n").replace(
        "mass_kg = 81\ncog_mm = [0, 0, 200]\n", ""
    )
    code, _, program = convert(drilled((1, 1, A), (2, 1, A), (3, 1, A)), text)
    assert code == 0
    setup = program.with_name("wing_SETUP.src").read_text()
    assert re.findall(r"(?m)^ *LOAD_DATA\[(\d)\]", setup) == ["7", "9"]
    assert re.findall(r"(?m)^ *TOOL_DATA\[(\d)\]", setup) == ["7", "8", "9"]


def test_the_job_in_inches(convert, tmp_path):
    """The same holes in a file of inches: bottoms in the same places."""
    calls = [(1, 1, A), (2, 1, A), (3, 2, B)]
    code, document, program = convert(drilled(*calls, units="INCHES", scale=25.4), wing.cell_text())
    assert (code, document["failures"]) == (0, [])
    assert_drilled(program, tmp_path / "cell.toml", calls)


@pytest.mark.parametrize("longer", [0.0, 60.0])
def test_a_cutter_that_only_sticks_out_behind_collides_there(convert, longer):
    """The same tool point; only the cutter's solid is longer, through the head and out of it."""
    text = wing.cell_text()
    text = text.replace("length_mm = 80.0 }", f"length_mm = {80.0 + longer + 60} }}")
    text = re.sub(r"meshes = \[\{ box = \{ size_mm = \[80, 80, 100\].*\n", "", text)
    # the reamer's tip is 12 mm below to 20 mm above the panel, its cutter ends 140 mm higher
    text += '[[obstacles]]\nname = "beam"\nbox = { size_mm = [60, 60, 10] }\n'
    text += "xyz_mm = [1507, -300, 770]\n"
    code, document, _ = convert(drilled((3, 1, A)).replace("0.,80.", "0.,20."), text)
    assert code == (1 if longer else 0), document["failures"]
    said = "cutter hits obstacle beam or comes nearer than 2.3 mm"  # clearance_mm is 2
    assert all(said in item["detail"] for item in document["failures"])


def test_two_cam_tools_of_one_number_that_differ_are_told(convert, tmp_path):
    """One entry claims both by their number; that they are not one tool the file itself says."""
    head = "TOOL PATH/ONE,TOOL,{}\nTLDATA/DRILL,{},0.0000,80.0000,118.0000,30.0000\n"
    text = drilled((1, 1, A), (2, 1, A))
    text = text.replace("LOADTL/2", "LOADTL/1")
    first, second = text.split("LOADTL/1", 1)[0], text.split("LOADTL/1", 1)[1]
    text = first + head.format("SIX", "6.0000") + "LOADTL/1" + second
    at = text.rindex("LOADTL/1")
    text = text[:at] + head.format("EIGHT", "8.0000") + text[at:]
    cell = wing.cell_text(cutter=False).replace('cam = [1, "DRILL"]', "cam = [1]")
    code, document, _ = convert(text, cell)
    assert code == 0
    (warning,) = [item for item in document["warnings"] if item["code"] == "WRD024"]
    for word in ("SIX", "EIGHT", "tool 7"):
        assert word in warning["text"]
    both = cell.replace("cam = [1]", 'cam = ["SIX"]').replace("[2,", '["EIGHT",')
    code, document, program = convert(text, both)
    assert code == 0
    assert not [item for item in document["warnings"] if item["code"] == "WRD024"]
    assert set(re.findall(r"BAS\(#TOOL,(\d)\)", program.read_text())) == {"7", "8"}
    loaded = load_cell(tmp_path / "cell.toml")
    assert [tool.cam for tool in loaded.tools[:2]] == [("SIX",), ("EIGHT", "CSINK")]


TWO_NAMES = """schema = "postproc.cell/1"
[robot]
model = "kuka_kr210_r2700_2"
[[tools]]
number = 1
cam = ["DRILL_8"]
frame = { xyz_mm = [150, 0, 250], abc_deg = [0, 0, 0] }
axis = "+x"
[[tools]]
number = 2
cam = ["MILL_8"]
frame = { xyz_mm = [180, 0, 220], abc_deg = [0, 0, 0] }
axis = "+x"
[workpiece]
number = 3
frame = { xyz_mm = [1500, -60, 700], abc_deg = [0, 0, 0] }
"""
OPERATION = """TOOL PATH/{kind},TOOL,{kind}_8
TLDATA/{kind},{diameter},0.0000,75.0000,0.0000,0.0000
MSYS/0.0,0.0,0.0,1.0,0.0,0.0,0.0,1.0,0.0
{load}SPINDL/RPM,1200,CLW
RAPID
GOTO/{x},0,120,0,0,1
FEDRAT/MMPM,200
GOTO/{x},0,0
RAPID
GOTO/{x},0,120
END-OF-PATH
"""


@pytest.mark.parametrize("diameter", ["8.0000", "10.0000"])
@pytest.mark.parametrize("load", ["LOAD/TOOL,1\n", "LOAD/TOOL,0\n", ""])
def test_tools_of_one_number_are_told_by_their_names(convert, run, tmp_path, diameter, load):
    """Each is called for and the spindle stands meanwhile, whatever the file says of numbers."""
    text = OPERATION.format(kind="DRILL", diameter="8.0000", load=load, x=0)
    text += OPERATION.format(kind="MILL", diameter=diameter, load=load, x=50)
    code, document, program = convert(text, TWO_NAMES)
    assert (code, document["failures"]) == (0, [])
    written = program.read_text()
    calls = re.findall(r"PP_(?:TOOL_CHANGE|SPINDLE_O[NF]+)\(\d*\)|BAS\(#TOOL,\d\)", written)
    change = calls.index("PP_TOOL_CHANGE(2)")
    assert calls[change - 1 : change + 3] == [
        "PP_SPINDLE_OFF()", "PP_TOOL_CHANGE(2)", "BAS(#TOOL,2)", "PP_SPINDLE_ON(1200)",
    ]  # fmt: skip
    assert ("PP_TOOL_CHANGE(1)" in calls) == bool(load)
    program.write_text(re.sub(r"PP_TOOL_CHANGE\(2\).*\n", "", written))
    verify = ("verify", program, "--cell", tmp_path / "cell.toml", "--json")
    code, report, _ = run(*verify, "--against", tmp_path / "wing.cls", *NX)
    assert (code, {v["kind"] for v in report["violations"]}) == (1, {"event"})


@pytest.mark.parametrize("call", ["LOADTL/MILL_8", "LOAD/TOOL,'MILL_8'", "LOADTL/'MILL_8'"])
def test_a_tool_is_loaded_by_its_name(convert, call):
    text = f"UNITS/MM\n{call}\nSPINDL/1200,RPM,CLW\nRAPID\nGOTO/0,0,120,0,0,1\nFEDRAT/200,MMPM\n"
    code, document, program = convert(text + "GOTO/0,0,0\nFINI\n", TWO_NAMES, "a.apt", ())
    assert (code, document["failures"]) == (0, [])
    assert "PP_TOOL_CHANGE(2)" in program.read_text()
    assert "BAS(#TOOL,2)" in program.read_text()
