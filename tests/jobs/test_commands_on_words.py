"""``convert``, then ``verify --against``, as a user calls them, on what CAM files say of process.

Numbers of the text are compared with closed forms; a text that does less than the file asks for is
made by hand, and ``verify`` has to name it.
"""

import re

import numpy as np
import pytest

from tests.cells import FEED, STIFFNESS, cell_text

FUSION = (
    "PARTNO/'x'\nUNITS/MM\nMODE/MILL\nMULTAX/OFF\nLOADTL/1, 0, 60, 1\nSPINDL/900, RPM, CLW\n"
    "FEDRAT/300, MMPM\nRAPID\nGOTO/0, 0, 50\n"
)
APT = (
    "PARTNO/X\nUNITS/MM\nLOADTL/1\nSPINDL/900,RPM,CLW\nFEDRAT/300,MMPM\nRAPID\nGOTO/0,0,50,0,0,1\n"
)
END = "RAPID\nGOTO/0, 0, 50\nSPINDL/OFF\nFINI\n"
TAPS = '[krl.hooks]\ntap_reverse = "TAP_BACK"\n'
TWO = """
[[tools]]
number = 3
name = "mill"
cam = ["1"]
frame = { xyz_mm = [107, 0, 362], abc_deg = [0, 0, 0] }
axis = "+x"
mass_kg = 80.0
[[tools]]
number = 9
name = "long drill"
cam = ["7"]
frame = { xyz_mm = [187, 0, 362], abc_deg = [0, 0, 0] }
axis = "+x"
mass_kg = 85.0
"""


@pytest.fixture
def shop(tmp_path, run):
    """Return a function: CAM text and tables of the cell to exit code, JSON and text of ``src``."""

    def converted(text, *tables, cell="", options=()):
        for old in (tmp_path / "out").glob("*"):
            old.unlink()
        (tmp_path / "cell.toml").write_text(cell or cell_text(STIFFNESS, FEED, *tables))
        (tmp_path / "part.apt").write_text(text)
        out = tmp_path / "out"
        call = ("convert", tmp_path / "part.apt", "--cell", tmp_path / "cell.toml", "-o", out)
        code, document, _ = run(*call, *options, "--json")
        src = out / "part.src"
        return code, document, src.read_bytes().decode() if src.exists() else ""

    return converted


@pytest.fixture
def verified(tmp_path, run):
    """Return a function: text of ``src``, None as converted, to exit code and kinds found."""

    def verify(text=None):
        src = tmp_path / "out" / "part.src"
        if text is not None:
            src.write_bytes(text.encode())
        against = ("--against", tmp_path / "part.apt", "--cell", tmp_path / "cell.toml")
        code, document, _ = run("verify", src, *against, "--json")
        return code, {item["kind"] for item in document["violations"]}

    return verify


def words(document):
    return {(item["code"], item["detail"].split(" ")[0]) for item in document["failures"]}


def points(text, word="LIN"):
    """Return the last X, Y, Z of every line that begins with a word."""
    found = re.findall(rf"^{word} .*\{{X (\S+?),Y (\S+?),Z (\S+?)[,}}]", text, re.M)
    return np.array(found, dtype=float)


@pytest.mark.parametrize("sweep", [180, 360])
def test_an_arc_of_fusion_is_driven_round_and_a_chord_is_noticed(shop, verified, sweep):
    end = "-30, 0, 0" if sweep == 180 else "30, 0, 0"
    arc = (
        f"GOTO/30, -10, 0\nGOTO/30, 0, 0\nMOVARC/0, 0, 0, 0, 0, 1, 30, ANGLE, {sweep}\nGOTO/{end}\n"
    )
    code, _, text = shop(FUSION + arc + END)
    assert code == 0
    ends = np.vstack([[30.0, 0.0, 0.0], points(text, "CIRC")])
    turned = np.unwrap(np.arctan2(ends[:, 1], ends[:, 0]))
    assert np.degrees(turned[-1] - turned[0]) == pytest.approx(sweep, abs=1e-2)
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 30.0, atol=2e-4)
    assert verified() == (0, set())
    chord = re.sub(r"^CIRC \{[^}]*\},\{", "LIN {", text, flags=re.M)
    code, kinds = verified(chord)
    assert code == 1
    assert "path" in kinds


def test_the_numbers_of_a_cycle_are_feed_and_clearance_and_another_order_is_asked_back(
    shop, verified
):
    holes = "CYCLE/DRILL, 12., MMPM, 300., 5.\nGOTO/40, 0, -12\nCYCLE/OFF\n"
    code, document, text = shop(FUSION + holes + END)
    assert code == 0
    assert "$VEL.CP=0.005000" in text
    assert [z for x, _, z in points(text).tolist() if x == 40.0 and z < 0.0] == [-12.0]
    assert verified() == (0, set())
    swapped = "CYCLE/DRILL, 12., 5., MMPM, 300.\nGOTO/40, 0, 0\nCYCLE/OFF\n"
    code, document, text = shop(APT + swapped + END, options=("--dialect", "surfcam"))
    assert (code, text) == (1, "")
    assert words(document) == {("WRD001", "CYCLE/DRILL")}
    detail = document["failures"][0]["detail"]
    assert "the feed begins 300 mm above the hole" in detail
    assert "the feed is 5 mm/min" in detail


def test_a_second_tool_is_claimed_with_its_own_length_or_stops(shop, verified):
    drill = "LOADTL/7,LENGTH,180\nRAPID\nGOTO/40,0,50\nGOTO/40,0,-8\n"
    mill = "GOTO/0,0,0\nGOTO/20,0,0\nRAPID\nGOTO/20,0,50\n"
    code, _, text = shop(APT + mill + drill + END)
    assert (code, text) == (2, "")
    one = cell_text(STIFFNESS, FEED)
    head, tail = one.index("[tool]"), one.index("[workpiece]")
    cell = one[:head] + TWO + one[tail:]
    code, _, text = shop(APT + mill + drill + END, cell=cell)
    assert code == 0
    selected = re.findall(r"^BAS\(#TOOL,(\d)\)", text, re.M)
    assert list(dict.fromkeys(selected)) == ["3", "9"]
    assert points(text)[:, 2].min() == -8.0, "the tip of the longer one goes as deep as asked"
    assert verified() == (0, set())
    code, kinds = verified(text.replace("BAS(#TOOL,9)", "BAS(#TOOL,3)"))
    assert code == 1
    assert kinds & {"tool", "frame"}


PROCESSES = {
    "TAP": ("MMPM,900", [r"Z -9\.0", r"TAP_BACK\(-900\)", r"Z 3\.0", r"PP_SPINDLE_ON\(900\)"]),
    "BORE": ("MMPM,90", [r"Z -9\.0", r"PP_SPINDLE_OFF\(\)", r"Z 3\.0", r"PP_SPINDLE_ON\(900\)"]),
    "REAM": ("MMPM,90", [r"Z -9\.0", r"Z 3\.0"]),
}


@pytest.mark.parametrize(("kind", "feed", "lines"), [(k, *v) for k, v in PROCESSES.items()])
def test_the_way_out_of_a_hole_is_made_at_feed(shop, verified, kind, feed, lines):
    cycle = f"CYCLE/{kind},FEDTO,9,{feed},RAPTO,3,RTRCTO,20\nGOTO/40,0,0\nCYCLE/OFF\n"
    code, _, text = shop(APT + cycle + END, TAPS)
    assert code == 0
    bottom = text.index("Z -9.0")
    at = bottom
    for line in lines:
        at = re.compile(line).search(text, at).end()
    assert "$VEL.CP" not in text[bottom:at], "still the feed that it came with"
    assert verified() == (0, set())
    speed = text.rindex("\r\n", 0, bottom)
    out = text.index("\r\n", text.index("LIN", bottom))
    fast = (
        text[: text.index("\r\n", bottom)] + "\r\n$VEL.CP=1.0" + text[text.index("\r\n", bottom) :]
    )
    assert speed < out
    code, kinds = verified(fast)
    assert code == 1
    assert "feed" in kinds


def test_taps_without_a_routine_that_reverses_stop(shop):
    cycle = "CYCLE/TAP,FEDTO,9,MMPM,900,RAPTO,3\nGOTO/40,0,0\nCYCLE/OFF\n"
    code, document, text = shop(APT + cycle + END)
    assert (code, text) == (1, "")
    assert {code for code, _ in words(document)} == {"PRC002"}


def test_a_bore_is_left_by_a_spindle_that_stands_at_its_angle(shop, verified):
    cycle = "CYCLE/BORE, 9, MMPM, 90, 12, RAPTO, 9, ORIENT, 90\nGOTO/40, 0, -9\nCYCLE/OFF\n"
    code, document, text = shop(FUSION + cycle + END)
    assert (code, text) == (1, "")
    assert words(document) == {("WRD001", "CYCLE/ORIENT")}
    assert "spindle_orient" in document["failures"][0]["hint"]
    code, _, text = shop(FUSION + cycle + END, '[krl.hooks]\nspindle_orient = "TURN_TO"\n')
    assert code == 0
    at = text.index("Z -9.0")
    for line in (r"TURN_TO\(90\.0+\)", r"Z 3\.0", r"PP_SPINDLE_ON\(900\)"):
        at = re.compile(line).search(text, at).end()
    assert verified() == (0, set())
    for other in ("TURN_TO(45.0)", "PP_SPINDLE_OFF()"):
        code, kinds = verified(re.sub(r"TURN_TO\(.*?\)", other, text))
        assert code == 1
        assert "event" in kinds


@pytest.mark.parametrize("kind", ["DRILL", "REAM", "BORE8"])
@pytest.mark.parametrize("more", ["ORIENT,90", "SHIFT,2"])
def test_an_angle_or_a_shift_at_the_bottom_is_never_left_out(shop, kind, more):
    cycle = f"CYCLE/{kind},FEDTO,9,MMPM,90,RAPTO,3,{more}\nGOTO/40,0,0\nCYCLE/OFF\n"
    code, document, text = shop(APT + cycle + END)
    assert (code, text) == (1, "")
    assert words(document) == {("WRD001", f"CYCLE/{more.partition(',')[0]}")}


STOPPING = {
    "SPINDL/OFF": ("WRD001", "SPINDL/OFF"), "SPINDL/-3000,RPM": ("PRC001", "the"),
    "MODE/INCR,ON": ("WRD001", "MODE/INCR"), "HEAD/2": ("WRD001", "HEAD"),
    "RETRCT": ("WRD001", "RETRCT"), "CUTCOM/LEFT": ("WRD001", "CUTCOM"),
    "ROTABL/90,CLW,CAXIS": ("WRD001", "ROTABL"),
}  # fmt: skip


@pytest.mark.parametrize(("line", "finding"), STOPPING.items())
def test_a_word_that_no_program_does_stops_and_is_named_by_verify_too(
    shop, verified, line, finding
):
    code, document, text = shop(f"{APT}GOTO/0,0,0\n{line}\nGOTO/20,0,0\n{END}")
    assert (code, text) == (1, "")
    assert words(document) == {finding}
    assert document["failures"][0]["line"] == 9
    code, _, text = shop(f"{APT}GOTO/0,0,0\nGOTO/20,0,0\n{END}")
    assert code == 0
    shop(f"{APT}GOTO/0,0,0\n{line}\nGOTO/20,0,0\n{END}")
    code, kinds = verified(text)
    assert code == 1
    assert kinds & {"word", "spindle"}


def test_a_left_hand_tool_turns_the_other_way(shop, verified):
    left = 'spindle = "ccw"\n'
    code, _, text = shop(
        f"{APT.replace('900,RPM,CLW', '-900,RPM')}GOTO/0,0,0\nGOTO/20,0,0\n{END}",
        cell=cell_text(STIFFNESS, FEED, tool=left),
    )
    assert code == 0
    assert "PP_SPINDLE_ON(-900)" in text
    assert verified() == (0, set())
    code, kinds = verified(text.replace("PP_SPINDLE_ON(-900)", "PP_SPINDLE_ON(900)"))
    assert code == 1
    assert kinds & {"event", "spindle"}


def test_without_the_file_cuts_are_known_by_their_speed_and_the_rest_is_said(shop, tmp_path, run):
    code, _, text = shop(f"{APT.replace('300', '30000')}GOTO/0,0,0\nGOTO/20,0,0\n{END}")
    assert code == 0
    src = tmp_path / "out" / "part.src"
    late = text.replace("PP_SPINDLE_ON(900)", "PP_SPINDLE_OFF()")

    def alone(content):
        src.write_bytes(content.encode())
        code, document, _ = run("verify", src, "--cell", tmp_path / "cell.toml", "--json")
        told = [*document["violations"], *document["warnings"]]
        return code, [item["detail"] for item in told if item["kind"] == "spindle"]

    assert alone(text) == (0, [])
    code, told = alone(late)
    assert code == 0
    assert len(told) == 1
    assert "2 path motions, the first at 0.5 m/s: whether they cut is not known" in told[0]
    code, told = alone(late.replace("$VEL.CP=0.500000", "$VEL.CP=0.2"))
    assert code == 1
    assert told == ["a cut while the spindle stands"]


TAPPED = (
    "PARTNO/X\nUNITS/MM\nLOADTL/1\nSPINDL/300,RPM,CLW\nRAPID\nGOTO/0,0,50,0,0,1\n"
    "CYCLE/TAP,RAPTO,5,FEDTO,10,MMPM,300\n{holes}CYCLE/OFF\nRAPID\nGOTO/0,0,50,0,0,1\n"
    "SPINDL/OFF\nFINI\n"
)
RAIL = (
    '[[external_axes]]\nname = "E1"\nkind = "rail"\naxis = "+y"\nrange_mm = [-7000, 7000]\n'
    "speed_mm_s = 1000\n"
)


def holes_at(*ys):
    return "".join(f"GOTO/{20 * (k % 2)},{y},0,0,0,1\n" for k, y in enumerate(ys))


def test_every_tap_is_backed_out_of_wherever_the_rail_stands(shop, verified):
    """The spindle is started once; the rail serves the holes from several places."""
    text = TAPPED.format(holes=holes_at(*range(-6000, 6001, 1000)))
    code, document, src = shop(text, RAIL, TAPS)
    assert code == 0, document["failures"]
    places = set(re.findall(r"E1 (\S+?)[,}]", src))
    assert len(places) > 1
    assert len(re.findall(r"^TAP_BACK\(-300\)", src, re.M)) == 13
    assert len(re.findall(r"^PP_SPINDLE_ON\(300\)", src, re.M)) == 14
    assert verified() == (0, set())
    lines = src.splitlines(keepends=True)
    backs = [k for k, line in enumerate(lines) if line.startswith("TAP_BACK")]
    del lines[backs[-1]]
    code, kinds = verified("".join(lines))
    assert code == 1
    assert "event" in kinds


def test_taps_in_free_order_are_backed_out_of_one_by_one(shop, verified):
    text = TAPPED.format(holes=holes_at(0, 200, 40, 160, 80, 120))
    code, document, src = shop(text, "[optimize]\nfree_order = true\n", TAPS)
    assert code == 0, document["failures"]
    taps = re.findall(r"^TAP_BACK.*CAM line (\d+)", src, re.M)
    assert len(taps) == 6
    assert taps != sorted(taps, key=int)
    assert verified() == (0, set())
    lines = src.splitlines(keepends=True)
    backs = [k for k, line in enumerate(lines) if line.startswith("TAP_BACK")]
    for k, above in ((backs[2], backs[1]), (backs[3], backs[4])):  # one too early, one too late
        moved = list(lines)
        moved.insert(above + (k < above), moved[k])
        del moved[k + (k > above)]
        code, kinds = verified("".join(moved))
        assert code == 1
        assert "event" in kinds


STEPS = (
    '[krl.hooks]\ntap_reverse = "TAP_BACK"\nclamp = "CLAMP"\ndrill = "DRILL"\nunclamp = "LET_GO"\n'
    '[process]\nhole = ["clamp", "drill", "unclamp"]\n'
)


@pytest.mark.parametrize(
    ("cycle", "below"), [("TAP", "TAP_BACK"), ("BORE", "PP_SPINDLE_OFF")], ids=["tap", "bore"]
)
def test_a_part_is_let_go_when_the_spindle_turns_as_before(shop, verified, cycle, below):
    text = TAPPED.format(holes=holes_at(0, 60)).replace("CYCLE/TAP", f"CYCLE/{cycle}")
    code, document, src = shop(text, STEPS)
    assert code == 0, document["failures"]
    called = re.findall(r"^ *(CLAMP|DRILL|LET_GO|TAP_BACK|PP_SPINDLE_\w+)\(", src, re.M)
    hole = ["CLAMP", "DRILL", below, "PP_SPINDLE_ON", "LET_GO"]
    assert called == ["PP_SPINDLE_ON", *hole, *hole, "PP_SPINDLE_OFF"]
    assert verified() == (0, set())
