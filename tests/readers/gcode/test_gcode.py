import re
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

import postproc as pp
from postproc.errors import ReadError
from postproc.model import EventKind, MotionKind
from postproc.readers import READERS, ReadOptions, read
from postproc.testing import check_reader
from tests.readers.gcode import canon
from tests.readers.gcode.programs import dressed, program

HERE = Path(__file__).parent
KINDS = {"rapid": MotionKind.RAPID, "line": MotionKind.LINEAR, "arc": MotionKind.ARC}
SEATS = sorted(path for path in HERE.glob("seats/*") if path.suffix != ".canon")
"""Written after what the posts of FreeCAD, Fusion, HSMWorks, Mastercam, NX, PathPilot and others
write; beside each, what LinuxCNC's interpreter made of it."""
HEAD = "G21 G90 G17 G94\nT1 M6\nS3000 M3\nG0 X0. Y0. Z10.\n"


def differences(path, listing):
    """Return what differs between a file as it is read and as the other interpreter drives it."""
    part = read(path, ReadOptions(format="gcode", dialect="linuxcnc"))
    found = [re.match(r"N(\d+)", line) for line in path.read_text().split("\n")]
    numbers = [match[1] if match else "" for match in found]
    tags, driven, wrong = defaultdict(list), defaultdict(list), []
    for tag in range(len(part)):
        tags[numbers[part.line[tag] - 1]].append(tag)
    for block, *stroke in canon.strokes(listing):
        driven[block].append(stroke)
    for block in {*tags, *driven}:
        mine, other = tags[block], driven[block]
        if not mine:  # a rapid while one of its coordinates is not known yet
            wrong += [f"N{block}: not read"] if any(s[0] != "rapid" for s in other) else []
        elif part.kind[mine[0]] == MotionKind.HOLE:
            wrong += [f"N{block}: {text}" for text in _hole(part, mine[0], other)]
        elif part.arc[mine[-1]] >= 0 and len(mine) > len(other):  # each flat turn is a circle
            turns = sum(int(part.arcs.sweep[part.arc[tag]] / 2 / np.pi - 1e-6) + 1 for tag in mine)
            wrong += [] if turns == abs(other[0][3][1]) else [f"N{block}: {turns} turns"]
        elif len(mine) != len(other):
            wrong.append(f"N{block}: {len(mine)} tags, {len(other)} strokes")
        else:
            pairs = zip(mine, other, strict=True)
            wrong += [f"N{block}: {text}" for pair in pairs for text in _tag(part, *pair)]
    return wrong


def _hole(part, tag, strokes):
    cycle, (x, y, level) = part.cycles[part.cycle[tag]], part.points[tag] * 1e3
    feeds = [stroke for stroke in strokes if stroke[0] == "line"]
    wanted = {
        "x": (feeds[0][1][0], x),
        "y": (feeds[0][1][1], y),
        "bottom": (min(stroke[1][2] for stroke in feeds), level - cycle.depth * 1e3),
        "retract": (strokes[-1][1][2], level + cycle.retract * 1e3),
        "feed": (feeds[0][2], part.feed[tag] * 60e3),
    }
    return [f"{name} {a} != {b}" for name, (a, b) in wanted.items() if abs(a - b) > 2e-3]


def _tag(part, tag, stroke):
    kind, end, feed, arc = stroke
    if part.kind[tag] != KINDS[kind] or np.abs(part.points[tag] * 1e3 - end).max() > 2e-3:
        yield f"{part.kind[tag]} to {part.points[tag] * 1e3} != {kind} to {end}"
    elif kind != "rapid" and abs(part.feed[tag] * 60e3 - feed) > 0.02:
        yield f"feed {part.feed[tag] * 60e3} != {feed}"
    elif arc is not None:
        (centre, turns, order), row = arc, part.arc[tag]
        way = part.arcs.normal[row][order[2]] * (int(part.arcs.sweep[row] / 2 / np.pi - 1e-6) + 1)
        gap = np.abs(part.arcs.centre[row] * 1e3 - centre)[order[:2]].max()
        if way != turns or gap > 5e-3:
            yield f"arc about {part.arcs.centre[row] * 1e3}, {way} turns != {centre}, {turns}"


@pytest.mark.skipif(canon.RS274 is None, reason="rs274 of LinuxCNC is not installed")
def test_random_programs_are_read_as_linuxcnc_drives_them(tmp_path):
    wrong = []
    for seed in range(20):
        path = tmp_path / f"p{seed}.ngc"
        path.write_text(dressed(program(seed), seed))
        wrong += [f"seed {seed} {text}" for text in differences(path, canon.run(path))]
    assert wrong == []


def test_files_of_seats_are_read_as_linuxcnc_drove_them():
    assert len(SEATS) >= 20
    wrong = {}
    for file in SEATS:
        found = differences(file, Path(f"{file}.canon").read_text())
        if found:
            wrong[file.name] = found
    assert wrong == {}


def test_it_keeps_the_contract_of_readers():
    for file in SEATS[:3]:
        check_reader(READERS.get("gcode"), file)


def _read(tmp_path, text, **options):
    path = tmp_path / "p.nc"
    path.write_text(text)
    return read(path, ReadOptions(**options))


def test_what_is_not_executed_stops_by_its_name(tmp_path):
    words = "G41 D1,G16,G51 P2.,G68 R30.,G10 L2 P1 X5.,G52 X1.,G92 X0.,G93,G96,G31 Z-5.,M10,M123"
    words += ",G76 Z-5. R2. Q.5,G87 Z-5. R2.,G68.2 P1,M61 Q3,M97 P5,G65 P9810,G12 I5.,G123,U2."
    words += ",A30.,B-5.,F9. G20"
    missed = []
    for word in words.split(","):
        part = _read(tmp_path, HEAD + f"G1 Z-1. F100.\n{word}\nG1 X5.\nM30\n")
        refused = {use.word: use.lines for use in part.word_uses if use.refused}
        name = word.split()[0].rstrip(".") if word[0] in "GM" else word[0]
        if refused.get(name) != (6,):
            missed.append((word, refused))
    assert missed == []


def test_what_cannot_be_read_is_one_error_with_its_line(tmp_path):
    cases = {
        "#1=5": "GCD002", "G1 X#5": "GCD002", "IF[#1EQ2]GOTO5": "GCD002", "o<sub> call": "GCD002",
        "G1 X1. X2.": "GCD003", "G0 G1 X5.": "GCD004", "G2 X5. Y5.": "GCD011",
        "G2 X5. Y5. I1. J9.": "GCD011", "G2 X0. Y0. R5.": "GCD011", "G2 X50. R5.": "GCD011",
        "G81 X1. R2. F100.": "GCD012", "G81 Z-5. X1. F100.": "GCD012", "G81 Z5. R2. X1.": "GCD012",
        "G83 X1. Z-5. R2.": "GCD012", "G18 G81 X1. Z-5. R2.": "GCD012", "F0.": "GCD014",
        "G53 G0 Z0.\nG1 X5.": "GCD010", "M98 P77": "GCD007", "G1 X1 what": "GCD001",
        "BEGIN PGM 7 MM": "GCD013", "CYCLE81(10,0,2,-5)": "GCD013", "G80 X5.": "GCD016",
        "M98 P1\nM30\nO1\nM98 P1\nM99": "GCD008",
    }  # fmt: skip
    wrong = {}
    for text, code in cases.items():
        try:
            _read(tmp_path, HEAD + text + "\nM30\n")
            wrong[text] = "read"
        except ReadError as error:
            if error.code != code or error.source.line < 5:
                wrong[text] = (error.code, error.source.line)
    assert wrong == {}


def test_line_ends_are_those_of_any_system(tmp_path):
    text = HEAD + "G1 Z-1. F100.\nG1 X5.\nM30\n"
    plain = _read(tmp_path, text)
    for ending in ("\r\n", "\r"):
        (tmp_path / "q.nc").write_bytes(text.replace("\n", ending).encode())
        part = read(tmp_path / "q.nc", ReadOptions())
        assert part.points.tolist() == plain.points.tolist(), ending


def test_units_are_never_guessed(tmp_path):
    text = HEAD.replace("G21 ", "") + "G1 X5. F100.\nM30\n"
    with pytest.raises(ReadError, match="G20 nor G21"):
        _read(tmp_path, text)
    assert _read(tmp_path, text, units="inch").points[-1, 0] == pytest.approx(5 * 25.4e-3)
    with pytest.raises(ReadError, match="--units says inch"):
        _read(tmp_path, HEAD + "M30\n", units="inch")


def test_a_reference_move_is_drawn_up_to_the_height_that_follows(tmp_path):
    text = HEAD + "G1 Z-5. F100.\nG91 G28 Z0.\nG90\nG0 X50.\nG43 H2 Z20.\nM30\n"
    part = _read(tmp_path, text)
    np.testing.assert_allclose(part.points[-2:] * 1e3, [[0, 0, 20], [50, 0, 20]])
    assert part.kind[-2:].tolist() == [MotionKind.RAPID] * 2
    assert part.line[-2:].tolist() == [6, 9]


def test_sub_programs_run_as_often_as_called(tmp_path):
    text = HEAD + "G1 Z-1. F100.\nM98 P12 L3\nM98 P20012\nM30\nO12\nG91 G1 X2.\nG90\nM99\n"
    part = _read(tmp_path, text)
    np.testing.assert_allclose(part.points[2:, 0] * 1e3, [2, 4, 6, 8, 10])


def test_spindle_coolant_and_tools_stand_in_the_order_of_the_file(tmp_path):
    text = HEAD + "M8\nG1 Z-1. F100.\nG0 Z10.\nM9\nM5\nT2 M6\nS500 M4\nG0 Z5.\nS800\nG1 Z0.\nM30\n"
    part = _read(tmp_path, text)
    kinds = [(event.index, event.kind, event.value) for event in part.events]
    assert kinds == [
        (0, EventKind.TOOL_CHANGE, 1.0), (0, EventKind.SPINDLE_ON, 50.0),
        (1, EventKind.COOLANT_ON, 0.0), (3, EventKind.COOLANT_OFF, 0.0),
        (3, EventKind.SPINDLE_OFF, 0.0), (3, EventKind.TOOL_CHANGE, 2.0),
        (3, EventKind.SPINDLE_ON, pytest.approx(-500 / 60)),
        (4, EventKind.SPINDLE_ON, pytest.approx(-800 / 60)),
    ]  # fmt: skip


def test_a_setup_is_a_base_and_hides_where_the_tool_was(tmp_path):
    part = _read(
        tmp_path,
        HEAD + "G54\nG1 Z-1. F100.\nG55\nG0 X0. Y0.\nZ10.\nG54.1 P3\nG0 X1. Y1. Z1.\nM30\n",
    )
    assert [setup.name for setup in part.setups] == ["G54", "G55", "G54.1 P3"]
    assert part.setup.tolist() == [-1, 0, 1, 2]


CELL = """schema = "postproc.cell/1"
name = "mill"
robot = { model = "kuka_kr500_r2830" }
[[tools]]
number = 2
name = "spindle"
cam = ["1", "2", "3", "4", "5", "6", "7", "8", "9", "10",
  "11", "12", "13", "14", "15", "16", "17", "18"]
frame = { xyz_mm = [0, 0, 350], abc_deg = [0, 0, 0] }
axis = "+z"
mass_kg = 60
cog_mm = [0, 0, 150]
[[bases]]
number = 3
cam = ["G54", "G55", "G56", "G57", "G58"]
frame = { xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }
[optimize]
step_deg = 60
"""


@pytest.mark.slow
def test_files_of_seats_become_programs(tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    cell = pp.load_cell(tmp_path / "cell.toml")
    bad = {}
    for file in SEATS:
        job = pp.convert(pp.read(file, cell), cell)
        if not job.good:
            bad[file.name] = [str(finding) for finding in job.findings]
    assert bad == {}
