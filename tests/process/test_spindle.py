"""The spindle of a CAM file: what the program adds, what is refused, what turns with it."""

from dataclasses import replace
from pathlib import Path

import pytest

from postproc.cell import SpindleStart, load_cell
from postproc.model import EventKind
from postproc.process import driven, start_findings, switched_off
from postproc.readers import read

CELL = Path(__file__).parents[2] / "fixtures" / "trim_5axis" / "cell.toml"
CALLED = (EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF)
HEAD = "UNITS/MM\nLOADTL/1\n"
CUT = "RAPID\nGOTO/0,0,50,0,0,1\nFEDRAT/600,MMPM\nGOTO/0,0,0\nGOTO/50,0,0\n"


@pytest.fixture
def part(tmp_path):
    def made(text):
        path = tmp_path / "part.apt"
        path.write_text(f"{text}FINI\n")
        return read(str(path))

    return made


def switching(toolpath):
    words = ("spindle_on", "spindle_off", "coolant_on", "coolant_off", "tool_change")
    return [
        (event.index, event.kind.value, round(event.value * 60))
        for event in switched_off(toolpath).events
        if event.kind in words
    ]


def refused(toolpath):
    return [(use.word, use.lines) for use in toolpath.word_uses if use.refused]


def test_what_the_file_leaves_on_is_switched_off_at_the_end(part):
    toolpath = part(f"UNITS/MM\nSPINDL/900,RPM,CCLW\nCOOLNT/MIST\n{CUT}")
    assert switching(toolpath) == [
        (0, "spindle_on", -900), (0, "coolant_on", 0), (3, "spindle_off", 0), (3, "coolant_off", 0),
    ]  # fmt: skip
    whole = switched_off(toolpath)
    assert switched_off(whole) is whole


def test_a_tool_change_stops_the_spindle_and_the_modal_speed_comes_back(part):
    toolpath = part(f"{HEAD}SPINDL/900,RPM,CLW\n{CUT}LOADTL/2\n{CUT}SPINDL/OFF\n")
    assert switching(toolpath)[2:] == [
        (3, "spindle_off", 0), (3, "tool_change", 120), (3, "spindle_on", 900),
        (6, "spindle_off", 0),
    ]  # fmt: skip
    own = part(f"{HEAD}SPINDL/900,RPM,CLW\n{CUT}LOADTL/2\nSPINDL/500,RPM,CLW\n{CUT}SPINDL/OFF\n")
    assert [value for _, kind, value in switching(own) if kind == "spindle_on"] == [900, 500]
    twice = part(f"{HEAD}SPINDL/900,RPM,CLW\n{CUT}LOADTL/2\nLOADTL/3\n{CUT}")
    assert [kind for _, kind, _ in switching(twice)][-2:] == ["spindle_on", "spindle_off"]
    assert refused(twice) == []


def test_a_file_that_never_names_the_spindle_is_left_alone(part):
    toolpath = part(f"{HEAD}{CUT}LOADTL/2\n{CUT}")
    assert switched_off(toolpath) is toolpath
    assert refused(toolpath) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"UNITS/MM\nSPINDL/900,RPM,CLW\n{CUT}SPINDL/OFF\n{CUT}", [("SPINDL/OFF", (8,))]),
        (f"UNITS/MM\n{CUT}SPINDL/900,RPM,CLW\n{CUT}", [("SPINDL", (7,))]),
        (f"UNITS/MM\nSPINDL/OFF\n{CUT}", [("SPINDL/OFF", (2,))]),
        (f"UNITS/MM\nspindl/900,rpm,clw\nspindl/off\nspindl/on\n{CUT}", []),
        (f"UNITS/MM\nSPINDL/900,RPM,CLW\n{CUT}SPINDL/OFF\nRAPID\nGOTO/0,0,9\n", []),
        (f"UNITS/MM\nSPINDL/-900,RPM,CCLW\n{CUT}", [("SPINDL/CCLW", (2,))]),
    ],
)
def test_cuts_while_the_spindle_stands(part, text, words):
    assert refused(part(text)) == words


CYCLE = "CYCLE/TAP,FEDTO,9,PITCH,1,RAPTO,2\n"


@pytest.mark.parametrize(
    ("text", "kinds"),
    [
        ("SPINDL/60,RPM,CLW\n{c}{h}SPINDL/60,RPM,CCLW\n{h}", ["tap", "tap_left"]),
        ("SPINDL/60,RPM,CLW\n{c}{h}CYCLE/OFF\nSPINDL/-60,RPM\nCYCLE/ON\n{h}", ["tap", "tap_left"]),
        ("SPINDL/60,RPM,CLW\n{c}{h}CYCLE/OFF\nSPINDL/60,RPM,CCLW\n{c}{h}", ["tap", "tap_left"]),
        ("{c}SPINDL/60,RPM,CCLW\n{h}SPINDL/60,RPM,CLW\n{h}", ["tap_left", "tap"]),
        ("SPINDL/60,RPM,CLW\n{c}{h}SPINDL/60,RPM,CCLW\nCYCLE/ON,FEDTO,4\n{h}", ["tap", "tap_left"]),
    ],
)
@pytest.mark.parametrize("word", ["TAP", "RIGID"])
def test_a_tap_has_the_hand_of_the_spindle_at_its_hole(part, text, kinds, word):
    cycle = CYCLE.replace("TAP", word)
    toolpath = part("UNITS/MM\n" + text.format(c=cycle, h="GOTO/0,0,0\n"))
    found = [toolpath.cycles[i].kind.value.replace("rigid_", "") for i in toolpath.cycle]
    assert found == kinds
    assert toolpath.feed.tolist() == pytest.approx([1e-3, 1e-3])


def test_feeds_and_dwells_in_turns_take_the_speed_at_each_hole(part):
    toolpath = part(
        "UNITS/MM\nSPINDL/600,RPM,CLW\nCYCLE/FACE,FEDTO,9,MMPR,.1,RAPTO,2,DWELL,5,REV\n"
        "GOTO/0,0,0\nSPINDL/1200,RPM,CLW\nGOTO/9,0,0\nGOTO/18,0,0\n"
    )
    assert toolpath.feed.tolist() == pytest.approx([1e-3, 2e-3, 2e-3])
    assert [toolpath.cycles[i].dwell for i in toolpath.cycle] == pytest.approx([0.5, 0.25, 0.25])
    assert not refused(toolpath)


@pytest.mark.parametrize("mode", ["REAM", "BORE", "TAP"])
def test_pecks_of_what_must_not_leave_in_rapid_are_refused(part, mode):
    text = f"UNITS/MM\nSPINDL/600,RPM,CLW\nCYCLE/{mode},FEDTO,9,STEP,3,MMPM,60,RAPTO,2\n"
    assert refused(part(text + "GOTO/0,0,0\n")) == [(f"CYCLE/{mode}", (3,))]


def test_on_without_a_cycle_is_refused_where_points_follow(part):
    assert refused(part("UNITS/MM\nCYCLE/ON\nGOTO/0,0,0\n")) == [("CYCLE/ON", (2,))]
    drill = "CYCLE/DRILL,FEDTO,5,MMPM,100,RAPTO,2\n"
    assert refused(part(f"UNITS/MM\nCYCLE/ON\n{drill}GOTO/0,0,0\n")) == []
    again = f"UNITS/MM\n{drill}GOTO/0,0,0\nCYCLE/CLEAR\nCYCLE/ON\nGOTO/9,0,0\n"
    assert refused(part(again)) == [("CYCLE/ON", (5,))]


@pytest.mark.parametrize("who", ["unit", "hand", None])
def test_who_drives_the_spindle_decides_what_is_called(part, who):
    cell = load_cell(CELL)
    process = replace(cell.process, spindle=who and SpindleStart(who), spindle_turns=20.0)
    cell = replace(cell, process=process)
    told = part(f"{HEAD}SPINDL/900,RPM,CLW\n{CUT}SPINDL/OFF\n")
    bare = part(f"{HEAD}SPINDL/ON\n{CUT}")
    speeds = [[round(e.value * 60) for e in driven(path, cell).events if e.kind in CALLED]
              for path in (told, bare)]  # fmt: skip
    assert speeds == ([[900, 0], [1200, 0]] if who is None else [[], []])
    assert not start_findings(bare, cell)


def test_a_spindle_without_a_speed_anywhere_is_an_error(part):
    cell = load_cell(CELL)
    cell = replace(cell, process=replace(cell.process, spindle_turns=0.0, spindle=None))
    (found,) = start_findings(part(f"{HEAD}SPINDL/ON\n{CUT}"), cell)
    assert (found.code, found.source.line) == ("PRC005", 3)
