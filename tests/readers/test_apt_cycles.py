"""Drill cycles of every seat: what their words mean, and which readings are asked back."""

from math import nan

import numpy as np
import pytest

from postproc.model.toolpath import MotionKind

MM = "PARTNO X\nUNITS/MM\n"
SPINDLE = "SPINDL/600,RPM,CLW\n"


def holes(read_text, cycle, dialect, z=0.0, before="", **options):
    text = f"{MM}{before}CYCLE/{cycle}\nGOTO/10,20,{z}\nGOTO/30,20,{z}\nCYCLE/OFF\nFINI\n"
    return read_text(text, dialect=dialect, **options)


def refused(toolpath):
    return [use for use in toolpath.word_uses if use.refused]


# kind, top, depth, feed begins, ends, feed [mm/min], peck, dwell
ROWS = [
    ("fusion", "DRILL, 12., MMPM, 300., 5.", -12, ("drill", 0, 12, 5, 5, 300, 0, 0)),
    ("fusion", "DRILL, 12., MMPM, 300., 25., RAPTO, 20.", -2, ("drill", 10, 12, -5, 15, 300, 0, 0)),
    ("fusion", "REAM, 12., MMPM, 90., 15., RAPTO, 12., DWELL, 1.", -12,
     ("ream", 0, 12, 3, 15, 90, 0, 1)),
    ("fusion", "BRKCHP, 12., INCR, 4., MMPM, 90., 15., RAPTO, 12.", -12,
     ("brkchp", 0, 12, 3, 15, 90, 4, 0)),
    ("fusion", "TAP, 12., MMPM, 600., 5.", -12, ("tap", 0, 12, 5, 5, 600, 0, 0)),
    ("hsmworks", "DRILL, 12, MMPM, 300.0, 27, RAPTO, 10", 0, ("drill", 0, 12, 5, 15, 300, 0, 0)),
    ("mfgsuite", " DRILL, DEPTH, 12, PERMIN, 300, CLEAR, 15, RETURN, 15, RAPTO, 10", 0,
     ("drill", 0, 12, 5, 15, 300, 0, 0)),
    ("mfgsuite", " FACE, DEPTH, 12, PERMIN, 300, CLEAR, 15, RETURN, 15, DWELL, .2", 0,
     ("face", 0, 12, 15, 15, 300, 0, 0.2)),
    ("camplete", "DRILL, FEDTO, 12, MMPM, 300, CLEAR, 45, RTRCTO,15, RAPTO, 5", 30,
     ("drill", 30, 12, 5, 15, 300, 0, 0)),
    ("camplete", "BRKCHP, FEDTO, 12, INCR, 4, MMPM, 300, CLEAR, 45", 30,
     ("brkchp", 30, 12, 15, 15, 300, 4, 0)),
    ("manusnc", "DRILL, FEDTO, 12., MMPM, 300., CLEAR, 45., RETURN, 45., RAPTO, 5.", 30,
     ("drill", 30, 12, 5, 15, 300, 0, 0)),
    ("postworks", "DRILL,FEDTO,12,MMPM,300,RAPTO,5,RTRCTO,15", 0,
     ("drill", 0, 12, 5, 15, 300, 0, 0)),
    ("postworks", "DRILL,FEDTO,12,MMPM,300,5", 0, ("drill", 0, 12, 5, 5, 300, 0, 0)),
    ("postworks", "DEEP,FEDTO,12,MMPM,300,RAPTO,5,STEP,4", 0, ("brkchp", 0, 12, 5, 5, 300, 4, 0)),
    ("postworks", "THRU,FEDTO,12,MMPM,300,RAPTO,5,STEP,4", 0, ("deep", 0, 12, 5, 5, 300, 4, 0)),
    ("surfcam", "DRILL,12,300,MMPM,5", 0, ("drill", 0, 12, 5, 5, 300, 0, 0)),
    ("catia", "DRILL, 12., 5., 300., MMPM", 0, ("drill", 0, 12, 5, 5, 300, 0, 0)),
    ("nx", "DRILL,DEEP,STEP,4,CLEAR,5.,FEDTO,-12.,RTRCTO,15,MMPM,300.", 0,
     ("deep", 0, 12, 5, 15, 300, 4, 0)),
    ("solidworks", "DRILL,FEDTO,12,MMPM,300,RAPTO,5,RTRCTO,15,DWELL,.5", 0,
     ("drill", 0, 12, 5, 15, 300, 0, 0.5)),
    ("creo", " DEEP, DEPTH, 12, STEP, 4, MMPM, 300, CLEAR, 5", 0, ("deep", 0, 12, 5, 5, 300, 4, 0)),
    ("camworks", " DRILL,G98,12,PECKING,4,4,MMPM,300,5,15 15 DWELL,.5", 0,
     ("deep", 0, 12, 5, 15, 300, 4, 0.5)),
    ("apt", "DRILL,DEPTH,12,PERMIN,300,CLEAR,5,RETURN,15", 0, ("drill", 0, 12, 5, 15, 300, 0, 0)),
]  # fmt: skip


@pytest.mark.parametrize(("dialect", "cycle", "z", "expected"), ROWS)
def test_each_seat_in_its_own_order(read_text, dialect, cycle, z, expected):
    toolpath = holes(read_text, cycle, dialect, z)
    kind, top, depth, feed_from, ends, feed, peck, dwell = expected
    (read,) = toolpath.cycles
    assert read.kind == kind
    np.testing.assert_allclose(toolpath.points[:, 2] * 1e3, top, atol=1e-9)
    found = np.array([read.depth, read.clearance, read.retract, read.peck]) * 1e3
    np.testing.assert_allclose(found, [depth, max(feed_from, 0), ends, peck], atol=1e-9)
    assert read.feed * 60e3 == pytest.approx(feed)
    assert read.dwell == dwell
    assert bool(refused(toolpath)) == (feed_from < 0)


def test_an_absolute_clearance_and_a_tilted_axis(read_text):
    """The height counts along the tool axis: 0.6 * 30 + 0.8 * 40 = 50 at the bottom."""
    text = (
        f"{MM}CYCLE/DRILL, 12., MMPM, 300., 70., RAPTO, 5.\nGOTO/30,0,40,0.6,0,0.8\n"
        "GOTO/30,9,40,0.6,0,0.8\nGOTO/0,0,49,0,0,1\nCYCLE/OFF\nFINI\n"
    )
    toolpath = read_text(text, dialect="fusion")
    np.testing.assert_allclose(toolpath.points[0] * 1e3, [37.2, 0, 49.6], atol=1e-9)
    heights = [(c.clearance * 1e3, c.retract * 1e3) for c in toolpath.cycles]
    np.testing.assert_allclose(heights, [(3, 8), (4, 9)], atol=1e-9)
    assert toolpath.cycle.tolist() == [0, 0, 1]


DOUBTS = [
    ("fusion", "DRILL, 12., MMPM, 300., 300.", -12, "300 mm above the hole"),
    ("fusion", "DRILL, 12., MMPM, 300., 5.", 0, "7 mm below the surface"),
    ("fusion", "DRILL, 12., MMPM, 5., 15.", -12, "feed is 5 mm/min"),
    ("hsmworks", "DRILL, 12, MMPM, 300.0, 5", 0, "7 mm below the surface"),
    ("camplete", "DRILL, FEDTO, 12, MMPM, 300, CLEAR, 5", 30, "25 mm below the surface"),
    ("surfcam", "DRILL,12,5,MMPM,300", 0, "300 mm above the hole, the feed is 5 mm/min"),
    ("catia", "DRILL,126.,85.,1.,MMPM", 0, "feed is 1 mm/min"),
    ("solidworks", "DRILL,FEDTO,12,MMPM,5,RAPTO,3,RTRCTO,25", 0, "feed is 5 mm/min"),
]


@pytest.mark.parametrize(("dialect", "cycle", "z", "doubt"), DOUBTS)
def test_what_can_hardly_be_meant_is_asked_back_with_the_reading(
    read_text, dialect, cycle, z, doubt
):
    (use,) = refused(holes(read_text, cycle, dialect, z))
    assert doubt in use.reason
    assert "read as a drill cycle" in use.reason
    assert "first hole, heights along the tool axis: approach" in use.reason
    assert "--dialect" in use.hint
    assert "--cycle-words" in use.hint
    assert use.lines == (3,)


def test_the_order_that_the_user_names_counts_and_is_not_asked_back(read_text):
    cycle = "DRILL,126.,85.,1.,MMPM"
    toolpath = holes(read_text, cycle, "catia", cycle_words="depth clearance feed")
    assert toolpath.cycles[0].clearance == pytest.approx(0.085)
    assert refused(toolpath) == []
    toolpath = holes(
        read_text, "DRILL, 12., MMPM, 300., 5.", None, cycle_words="depth feed clearance"
    )
    (read,) = toolpath.cycles
    np.testing.assert_allclose((read.depth, read.clearance, read.feed), (12e-3, 5e-3, 5e-3))
    assert refused(toolpath) == []


@pytest.mark.parametrize(
    ("cycle", "first", "second"),
    [
        ("DRILL, 12., MMPM, 300., 5.", "Fusion", "HSMWorks"),
        ("DRILL, 12., 300., 5.", "SURFCAM", "CATIA"),
    ],
)
def test_numbers_of_an_unknown_seat_stop_and_name_two_readings(read_text, cycle, first, second):
    toolpath = holes(read_text, cycle, None)
    assert toolpath.dialect == "apt"
    (use,) = refused(toolpath)
    assert first in use.reason
    assert second in use.reason
    assert "--dialect" in use.hint
    (read,) = toolpath.cycles
    np.testing.assert_allclose((read.depth, read.clearance, read.feed), (12e-3, 5e-3, 5e-3))


def test_a_rapid_is_no_hole_and_on_brings_the_cycle_back(read_text):
    text = (
        f"{MM}CYCLE/DRILL,FEDTO,5,MMPM,100,RAPTO,2\nGOTO/1,0,0\nRAPID\nGOTO/1,0,60\nGOTO/2,0,0\n"
        "CYCLE/OFF\nGOTO/3,0,60\nCYCLE/ON\nGOTO/4,0,0\nCYCLE/ON,FEDTO,7\nGOTO/5,0,0\nCYCLE/OFF\n"
        "FINI\n"
    )
    toolpath = read_text(text)
    hole, rapid, line = MotionKind.HOLE, MotionKind.RAPID, MotionKind.LINEAR
    assert toolpath.kind.tolist() == [hole, rapid, hole, line, hole, hole]
    assert [c.depth for c in toolpath.cycles] == pytest.approx([5e-3, 7e-3])
    assert toolpath.cycle.tolist() == [0, -1, 0, -1, 0, 1]


@pytest.mark.parametrize("dialect", ["apt", "nx", "catia", "fusion", "solidworks", "postworks"])
@pytest.mark.parametrize("word", ["DRILL,FEDTO,5,MMPM,100,RAPTO,2", "ON"])
@pytest.mark.parametrize("block", [1 << 22, 8])
def test_a_rapid_before_the_cycle_goes_to_its_first_hole(
    read_text, dialect, word, block, monkeypatch
):
    """Only behind the CYCLE does RAPID take a point out of it; blocks of reading do not matter."""
    monkeypatch.setattr("postproc.readers.text.blocks.BLOCK_BYTES", block)
    depth = -5 if dialect == "nx" else 5
    word = word.replace("5", str(depth), 1)
    first = f"CYCLE/DRILL,FEDTO,{depth},MMPM,100,RAPTO,2\nGOTO/0,0,0\nCYCLE/OFF\n"
    text = (
        f"{MM}{first}RAPID\nGOTO/0,0,50\nRAPID\nCYCLE/{word}\nGOTO/0,0,0\n"
        f"RAPID\nGOTO/5,0,0\nGOTO/6,0,0\nRAPID\nCYCLE/OFF\nGOTO/6,0,9\nFINI\n"
    )
    hole, rapid = MotionKind.HOLE, MotionKind.RAPID
    kinds = read_text(text, dialect=dialect, units="mm", recover=True).kind.tolist()
    assert kinds == [hole, rapid, hole, rapid, hole, rapid]


def test_mill_makes_no_hole(read_text):
    toolpath = holes(read_text, "MILL", None)
    assert (toolpath.kind == MotionKind.LINEAR).all()
    assert refused(toolpath) == []
    (use,) = refused(holes(read_text, "MILL,FEDTO,5", None))
    assert (use.word, use.lines) == ("CYCLE/MILL", (3,))


@pytest.mark.parametrize(
    ("cycle", "word"),
    [
        ("CIRCUL,DEPTH,5,RADIUS,20,ON", "CYCLE/CIRCUL"), ("SPIRAL,FEDTO,5", "CYCLE/SPIRAL"),
        ("BORE7,FEDTO,5,MMPM,100,RAPTO,2", "CYCLE/BORE7"),
        ("BORE9,FEDTO,5,MMPM,100,RAPTO,2", "CYCLE/BORE9"),
        ("BORE,FEDTO,5,MMPM,100,RAPTO,2,ORIENT,90", "CYCLE/ORIENT"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,CAM,3", "CYCLE/CAM"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,TIMES,3", "CYCLE/REPEAT"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,PARAMS,1,2", "CYCLE/PARAMS"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,AVOID", "CYCLE/AVOID"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,FLUTE,7", "CYCLE/FLUTE"),
        ("DRILL,FEDTO,5,MMPR,.1,RAPTO,2", "FEDRAT"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,DWELL,3,REV", "CYCLE/DWELL"),
        ("DRILL,FEDTO,5,MMPM,100,RAPTO,2,STEP,3,1", "CYCLE/STEP"),
    ],
)  # fmt: skip
def test_what_is_not_carried_out_is_refused_by_name(read_text, cycle, word):
    toolpath = holes(read_text, cycle, None)
    assert [(use.word, use.lines) for use in refused(toolpath)] == [(word, (3,))]
    assert len(toolpath) == 2


def test_feeds_dwells_and_pitches_in_turns_follow_the_speed(read_text):
    cycle = "DRILL,FEDTO,5,MMPR,.1,RAPTO,2,DWELL,3,REV"
    (read,) = holes(read_text, cycle, None, before=SPINDLE).cycles
    np.testing.assert_allclose((read.feed_per_turn, read.feed, read.dwell), (1e-4, 1e-3, 0.3))
    (tap,) = holes(read_text, "TAP,FEDTO,5,TPI,20,RAPTO,2", "postworks", before=SPINDLE).cycles
    np.testing.assert_allclose((tap.pitch, tap.feed), (5e-5, 5e-4))
    (tap,) = holes(read_text, "TAP,FEDTO,5,TPI,.75,RAPTO,2", "postworks", before=SPINDLE).cycles
    np.testing.assert_allclose((tap.pitch, tap.feed), (7.5e-4, 7.5e-3))


@pytest.mark.parametrize(
    ("cycle", "spindle", "kind"),
    [
        ("TAP, DEPTH, 9, MMPM, 600, CLEAR, 5, RETURN, 5", "RPM,600,CLW", "tap"),
        ("TAP, DEPTH, 9, MMPM, 600, CLEAR, 5, RETURN, 5", "RPM,-600,CLW", "tap_left"),
        ("RIGID, DEPTH, 9, PITCH, 1, CLEAR, 5, RETURN", "RPM,600,CLW", "rigid_tap"),
        ("RIGID, DEPTH, 9, PITCH, 1, CLEAR, 5, RETURN, 5", "RPM,-600,CLW", "rigid_tap_left"),
        ("REVERS, DEPTH, 9, MMPM, 600, CLEAR, 5", "RPM,600,CLW", "tap_left"),
    ],
)
def test_taps_know_their_hand_and_pitch(read_text, cycle, spindle, kind):
    (tap,) = holes(read_text, cycle, "manusnc", before=f"SPINDL/{spindle}\n").cycles
    assert tap.kind == kind
    assert tap.feed == pytest.approx(0.01)
    assert tap.pitch == pytest.approx(1e-3 if "PITCH" in cycle else nan, nan_ok=True)


def test_a_countersink_by_diameter_and_angle(read_text):
    (sink,) = holes(read_text, "CSINK,FEDTO,10,100,MMPM,50,RAPTO,2", "postworks").cycles
    assert sink.kind == "csink"
    assert sink.depth * 1e3 == pytest.approx(5 / np.tan(np.radians(50)))
    assert sink.diameter == pytest.approx(0.01)


def test_a_bore_with_shift_keeps_its_numbers(read_text):
    cycle = "BORE, 12., MMPM, 50., 20., 0.3, RAPTO, 15., ORIENT, 90., DWELL, 2."
    toolpath = holes(read_text, cycle, "fusion", -12)
    (bore,) = toolpath.cycles
    np.testing.assert_allclose(
        (bore.shift, bore.orient, bore.clearance, bore.retract, bore.dwell),
        (3e-4, np.pi / 2, 5e-3, 20e-3, 2.0),
    )
    assert [use.word for use in refused(toolpath)] == ["CYCLE/ORIENT", "CYCLE/SHIFT"]


def test_deep_of_an_unknown_seat_retracts_fully_and_says_so(read_text):
    toolpath = holes(read_text, "DEEP,FEDTO,9,STEP,3,MMPM,100,RAPTO,2", None)
    assert not toolpath.cycles[0].break_chip
    assert "CYCLE/DEEP" in {use.word for use in toolpath.word_uses if not use.refused}


def test_an_approach_from_below_the_level_of_feed_is_asked_back(read_text):
    text = f"{MM}RAPID\nGOTO/1,2,5\nCYCLE/DRILL,FEDTO,9,MMPM,100,RAPTO,{{}}\nGOTO/1,2,0\nFINI\n"
    assert refused(read_text(text.format(5))) == []
    (use,) = refused(read_text(text.format(8)))
    assert "stands 5 mm above the hole" in use.reason


def test_one_entry_for_equal_cycles_with_all_their_lines(read_text):
    text = MM + "CYCLE/DRILL,FEDTO,5,MMPM,5,RAPTO,2\nGOTO/1,0,0\nCYCLE/OFF\n" * 3 + "FINI\n"
    toolpath = read_text(text)
    assert len(toolpath.cycles) == 1
    assert [use.lines for use in refused(toolpath)] == [(3, 6, 9)]
