"""Feeds, spindles, setups and homes of every seat; how a seat is recognised."""

import numpy as np
import pytest

from postproc.errors import UsageError
from postproc.model.toolpath import EventKind
from postproc.readers import ReadOptions, read

MM = "$$ plate\nUNITS/MM\n"


def refused(toolpath):
    return [(use.word, use.lines) for use in toolpath.word_uses if use.refused]


def reads(read_text, body, **options):
    return read_text(f"{MM}{body}GOTO/1,2,3\nFINI\n", **options)


@pytest.mark.parametrize(
    ("units", "feed", "scale"), [("INCHES", "MMPM", 1.0), ("MM", "IPM", 25.4), ("INCHES", "IPM", 0)]
)
def test_a_feed_that_contradicts_the_units_is_asked_back(read_text, units, feed, scale):
    """35 mm/min at 30,000 rpm are 0.0006 mm a tooth; 35 inch/min are meant."""
    text = f"UNITS/{units}\nFEDRAT/35., {feed}\nGOTO/1,2,3\nFEDRAT/35., {feed}\nGOTO/4,5,6\nFINI\n"
    toolpath = read_text(text)
    if not scale:
        assert refused(toolpath) == []
        return
    (use,) = (use for use in toolpath.word_uses if use.refused)
    assert (use.word, use.lines) == ("FEDRAT", (2, 4))
    assert "--feed-units mm or --feed-units inch" in use.hint
    np.testing.assert_allclose(toolpath.feed * 60e3, 35 * scale)
    for unit, factor in (("mm", 1.0), ("inch", 25.4)):
        chosen = read_text(text, feed_units=unit)
        assert refused(chosen) == []
        np.testing.assert_allclose(chosen.feed * 60e3, 35 * factor)
    assert toolpath.units == ("inch" if units == "INCHES" else "mm")


def test_an_unknown_unit_of_feed_is_a_wrong_call():
    with pytest.raises(UsageError, match="no unit of feed 'ft'"):
        ReadOptions(feed_units="ft")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("3000,RPM,CLW", 50), ("RPM,3000,CCLW", -50), ("-3000,RPM", -50), ("RPM,-3000,CLW", -50),
        ("3000", 50), ("RPM,3000,CLW,MAXRPM,6000", 50), ("HIGH,3000,CLW", 50),
    ],
)  # fmt: skip
def test_a_negative_speed_is_counterclockwise(read_text, words, expected):
    (event,) = reads(read_text, f"SPINDL/{words}\n").events
    assert event.kind is EventKind.SPINDLE_ON
    assert event.value == pytest.approx(expected)


def test_bare_on_is_the_last_speed_and_direction(read_text):
    body = "SPINDL/600,RPM,CCLW\nSPINDL/OFF\nSPINDL/ON\nSPINDL/RPM,1200\nSPINDL/CLW\n"
    values = [event.value for event in reads(read_text, body).events]
    assert values == pytest.approx([-10, 0, -10, -20, 20])


def test_an_oriented_spindle_is_refused_and_its_angle_is_no_speed(read_text):
    toolpath = reads(read_text, "SPINDL/600,RPM\nSPINDL/ORIENT,90\nSPINDL/LOCK\n")
    assert [event.value for event in toolpath.events] == [10]
    assert refused(toolpath) == [("SPINDL/ORIENT", (4,)), ("SPINDL/LOCK", (5,))]


def test_a_spindle_within_the_tool_change_of_catia(read_text):
    toolpath = reads(read_text, "LOADTL/10,ADJUST,1,SPINDL,15915.49,MILL\n")
    values = {event.kind: event.value for event in toolpath.events}
    assert values[EventKind.TOOL_CHANGE] == 10
    assert values[EventKind.SPINDLE_ON] == pytest.approx(15915.49 / 60)


@pytest.mark.parametrize(
    ("words", "seconds"), [("2.5", 2.5), ("DWELL,2.5", 2.5), ("30,REV", 3), ("REV,30", 3)]
)
def test_delays_in_seconds_and_turns(read_text, words, seconds):
    body = f"SPINDL/600,RPM,CLW\nDELAY/{words}\n"
    assert reads(read_text, body).events[1].value == pytest.approx(seconds)


@pytest.mark.parametrize(
    ("body", "word"),
    [
        ("FEDRAT/5,INVERS\n", "FEDRAT/INVERS"), ("FEDRAT/.1,MMPR\n", "FEDRAT"),
        ("FEDRAT/100,MMPM,LOCK\n", "FEDRAT/LOCK"), ("SPINDL/SFM,200\n", "SPINDL/SFM"),
        ("GOHOME/CHECK\n", "GOHOME/CHECK"), ("MODE/INCR,ON\n", "MODE/INCR"),
        ("POSITN/XAXIS,5\n", "POSITN"), ("ORIGIN/1,2,3\n", "ORIGIN"),
        ("CLRSRF/PLANE,SF1\n", "CLRSRF"), ("PLUNGE\n", "PLUNGE"),
        ("MCS/0,1,0,-1,0,0,0,0,1,0,0,0\n", "MCS"), ("MCS2/0,1,0,-1,0,0,0,0,1\n", "MCS2"),
        ("MCSYS/ NUM,2,POINT,0,0,5,VECTOR,1,0,0,VECTOR,0,1,0\n", "MCSYS"),
    ],
)  # fmt: skip
def test_what_moves_or_feeds_otherwise_is_refused(read_text, body, word):
    toolpath = reads(read_text, body)
    assert refused(toolpath) == [(word, (3,))]
    np.testing.assert_allclose(toolpath.points * 1e3, [(1, 2, 3)])


def test_a_setup_of_mcs_has_its_axes_first_and_its_origin_last(read_text):
    toolpath = reads(read_text, "MCS/0,1,0, -1,0,0, 0,0,1, $\n10,20,30\n")
    (setup,) = toolpath.setups
    assert (setup.name, setup.line) == ("MCS", 3)
    expected = [(0, -1, 0, 0.01), (1, 0, 0, 0.02), (0, 0, 1, 0.03)]
    np.testing.assert_allclose(setup.matrix, expected, atol=1e-15)
    assert not setup.is_identity


def test_a_setup_of_mcsys_has_its_number_for_a_name(read_text):
    toolpath = reads(read_text, "MCSYS/ NUM,2,POINT,0,0,0,VECTOR,1,0,0,VECTOR,0,1,0\n")
    assert [(setup.name, setup.is_identity) for setup in toolpath.setups] == [("2", True)]
    assert refused(toolpath) == []


def test_a_second_work_offset_is_refused_the_first_is_the_part_s(read_text):
    toolpath = reads(read_text, "ZERO/1\nGOTO/0,0,0\nZERO/1\nGOTO/0,0,1\nZERO/2\n")
    assert [setup.name for setup in toolpath.setups] == ["1", "2"]
    assert refused(toolpath) == [("ZERO", (7,))]


def test_homes_at_the_ends_are_the_robot_s_own_between_motions_they_are_refused(read_text):
    text = f"{MM}GOHOME\nGOTO/1,2,3\n{{}}GOTO/4,5,6\nGOHOME/0,0,90\nFINI\n"
    assert refused(read_text(text.format(""))) == []
    assert refused(read_text(text.format("GOHOME\n"))) == [("GOHOME", (5,))]


def test_catia_places_the_points_by_its_origin(read_text):
    toolpath = reads(read_text, "ORIGIN/1,2,3\n", dialect="catia")
    np.testing.assert_allclose(toolpath.points * 1e3, [(2, 4, 6)])
    assert refused(toolpath) == []


def test_operations_of_mfgsuite_have_their_names(fixtures):
    toolpath = read(fixtures / "part_mfgsuite.apt")
    assert [operation.name for operation in toolpath.operations] == ["contour", "holes"]


SEATS = ["fusion", "hsmworks", "mfgsuite", "camplete", "manusnc", "postworks", "surfcam"]


@pytest.mark.parametrize("seat", SEATS)
def test_a_plain_file_of_a_seat_needs_nothing_to_be_accepted(fixtures, seat):
    toolpath = read(fixtures / f"part_{seat}.apt")
    assert refused(toolpath) == []
    shown = [use.reason for use in toolpath.word_uses if use.word.startswith("CYCLE")]
    assert len(shown) == 1
    assert "approach 3, surface 0, bottom -8, retract 12 mm" in shown[0]
