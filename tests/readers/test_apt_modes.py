"""What holds until when: axes, frames, rapids, feeds, cycles, in each dialect."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from postproc.errors import ReadError
from postproc.model.toolpath import EventKind, MotionKind
from postproc.readers import read


def mm(toolpath):
    return np.round(toolpath.points * 1e3, 9).tolist()


@pytest.fixture(scope="module")
def modes(fixtures):
    return read(fixtures / "nx_modes.cls")


def test_msys_turns_the_head_upside_down(modes):
    assert mm(modes)[:3] == [[100, 210, -20], [100, 210, 25], [100, 210, 30]]
    np.testing.assert_allclose(modes.axes[0], [0, 0, -1], atol=1e-15)


def test_nx_keeps_the_axis_until_the_next_path(modes):
    expected = [(0, 0, -1)] + [(0, 0.6, -0.8)] * 3 + [(-0.6, 0, -0.8)] * 3 + [(0, 0, 1)] * 2
    np.testing.assert_allclose(modes.axes, expected, atol=1e-15)


def test_rapid_is_for_the_next_motion_and_a_feed_cancels_it_in_nx(modes):
    rapid = MotionKind.RAPID
    assert (modes.kind == rapid).tolist() == [True, True, False, False, False, False, False, True,
                                              False]  # fmt: skip
    assert np.nanmax(np.abs(modes.feed[~np.isnan(modes.feed)] * 60e3 - 300)) < 1e-9


def test_helix_of_one_turn_comes_back_and_rises(modes):
    (index,) = np.flatnonzero(modes.kind == MotionKind.ARC)
    assert np.degrees(modes.arcs.sweep[0]) == pytest.approx(360.0)
    assert modes.points[index, 2] - modes.points[index - 1, 2] == pytest.approx(2e-3)


def test_select_is_no_change_and_the_same_name_is_the_same_tool(modes):
    changes = [e.value for e in modes.events if e.kind is EventKind.TOOL_CHANGE]
    assert changes == [4.0]
    assert len(modes.tools) == 1


def test_dwell_stands_before_the_motion_after_it(modes):
    (dwell,) = [e for e in modes.events if e.kind is EventKind.DWELL]
    assert (dwell.index, dwell.value) == (8, 1.5)


def test_machine_only_words_are_warned_about(modes):
    assert {"APT110", "APT121"} == {finding.code for finding in modes.warnings}


def test_solidworks_axis_comes_from_the_setup_not_from_the_last_point(fixtures):
    toolpath = read(fixtures / "solidworks_setups.apt")
    np.testing.assert_allclose(toolpath.axes[:3], [(0.6, 0, 0.8)] * 3)
    np.testing.assert_allclose(toolpath.axes[3:], [(0, 0, 1)] * 3)
    assert mm(toolpath)[2] == [5, 0, 0], "CSYS does not move the points"
    assert [o.name for o in toolpath.operations] == ["SETUP 1", "SETUP 2"]
    stops = [e for e in toolpath.events if e.kind is EventKind.STOP]
    assert [(e.index, e.text) for e in stops] == [(4, "STOP  change clamp")]
    spindle = next(e for e in toolpath.events if e.kind is EventKind.SPINDLE_ON)
    assert spindle.value == pytest.approx(-4000 / 60), "counterclockwise is negative"
    assert toolpath.cycles[0].retract == pytest.approx(0.0275)


def test_catia_matrices_multax_and_tlaxis(fixtures):
    toolpath = read(fixtures / "catia_frames.aptsource")
    assert mm(toolpath) == [
        [100, 210, 50], [100, 210, 10], [100, 220, 10], [100, 230, 10], [1, -3, 7],
    ]  # fmt: skip
    np.testing.assert_allclose(
        toolpath.axes,
        [(0, 0, 1), (0, 0.6, 0.8), (0, 0.6, 0.8), (0, 0, 1), (0, -1, 0)],
        atol=1e-15,
    )
    assert toolpath.events[0].text == "SUPPORT COT\u00c9 A"


def test_camworks_tilts_each_feature_anew(fixtures):
    toolpath = read(fixtures / "camworks_tilt.clt")
    np.testing.assert_allclose(toolpath.points[0] * 1e3, [10, -25, 20], atol=1e-9)
    np.testing.assert_allclose(toolpath.points[2:4] * 1e3, [(0, 0, 0), (0, 0, 10)], atol=1e-9)
    np.testing.assert_allclose(toolpath.points[-1] * 1e3, [1, 2, 3], atol=1e-9)
    np.testing.assert_allclose(toolpath.axes[:7], [(0, -1, 0)] * 7, atol=1e-12)
    np.testing.assert_allclose(toolpath.axes[7], (0, 0, 1))


def test_camworks_word_that_goes_against_both_cuts_is_reported(fixtures):
    toolpath = read(fixtures / "camworks_tilt.clt")
    found = [finding for finding in toolpath.warnings if finding.code == "APT132"]
    assert [finding.source.line for finding in found] == [23]
    np.testing.assert_allclose(np.degrees(toolpath.arcs.sweep), [270, 90])


def test_camworks_g99_ends_at_the_lower_height(fixtures):
    (cycle,) = read(fixtures / "camworks_tilt.clt").cycles
    assert (cycle.clearance, cycle.retract) == (pytest.approx(3e-3), pytest.approx(3e-3))


def test_nx_cycles_are_signed_and_change_on_the_way(fixtures):
    toolpath = read(fixtures / "nx_cycles.clsf")
    depths = [toolpath.cycles[i].depth for i in toolpath.cycle[:3]]
    np.testing.assert_allclose(depths, [0.072, 0.0745, 0.005])
    assert [c.kind for c in toolpath.cycles] == ["deep", "deep", "drill"]
    assert [c.retract for c in toolpath.cycles] == pytest.approx([0.003, 0.003, 0.025])
    assert toolpath.cycles[2].dwell == 0.2
    assert toolpath.kind.tolist() == [3, 3, 3, 1]


def test_feeds_per_turn_follow_the_spindle(fixtures):
    toolpath = read(fixtures / "plain_inch.apt")
    inch, minute = 0.0254, 60.0
    turns = 200 * 12 * inch / (np.pi * 0.5 * inch) / minute  # 200 ft/min on a half-inch cutter
    expected = [0.004 * inch * turns, 0.004 * inch * 1200 / minute, 20 * inch / minute,
                30 * inch / minute, 0.508 / minute, 0.508 / minute]  # fmt: skip
    np.testing.assert_allclose(toolpath.feed, expected, rtol=1e-12)
    assert toolpath.units == "inch"
    np.testing.assert_allclose(toolpath.points[:, 0], np.arange(1, 7) * inch)
    dwell = next(e for e in toolpath.events if e.kind is EventKind.DWELL)
    assert dwell.value == pytest.approx(24 / 20.0), "24 turns at 1200 rpm"


def test_unknown_words_are_kept_and_counted(fixtures):
    toolpath = read(fixtures / "plain_inch.apt")
    assert toolpath.unknown_words == {"AUXFUN": 1, "MYWORD": 2}
    kept = [(e.index, e.text) for e in toolpath.events if e.kind is EventKind.UNKNOWN]
    assert kept == [(5, "MYWORD/ 1, TWO"), (5, "AUXFUN/42"), (5, "MYWORD")]


def test_case_blanks_comments_and_continuation(fixtures):
    toolpath = read(fixtures / "plain_words.apt")
    assert mm(toolpath) == [[1, -0.5, 0], [25, 0, 0.25], [1, 2, 3], [4, 4, 0], [5, 5, 0]]
    assert toolpath.kind.tolist() == [1, 1, 0, 3, 3]
    assert [c.depth for c in toolpath.cycles] == pytest.approx([0.006, 0.007])
    assert toolpath.line.tolist() == [4, 5, 8, 11, 14]


def spline_truth(start, control, interior):
    """Return scipy's clamped cubic through the same numbers."""
    points = np.array([start, *control], dtype=float)
    knots = np.array([0.0] * 4 + interior + [1.0] * 4)
    return BSpline(knots, points, 3)


def test_nurbs_stay_within_the_chord_tolerance(fixtures):
    toolpath = read(fixtures / "nx_nurbs.clsf")
    first = spline_truth((0, 0, 0), [(0, 10, 0), (10, 20, 0), (20, 20, 0)], [])
    second = spline_truth((20, 20, 0), [(30, 20, 0), (40, 30, 5), (40, 40, 5), (40, 50, 0)], [0.5])
    rows = np.flatnonzero((toolpath.line == 10) | (toolpath.line == 16))
    path = np.vstack([[0, 0, 0], toolpath.points[rows] * 1e3])
    for spline in (first, second):
        for point in spline(np.linspace(0, 1, 400)):
            a, b = path[:-1], path[1:]
            t = np.clip(np.einsum("ni,ni->n", point - a, b - a)
                        / np.einsum("ni,ni->n", b - a, b - a), 0, 1)  # fmt: skip
            gap = np.linalg.norm(point - (a + t[:, None] * (b - a)), axis=1).min()
            assert gap <= 0.0101
    np.testing.assert_allclose(path[-1], [40, 50, 0], atol=1e-9)
    assert (toolpath.kind[rows] == MotionKind.LINEAR).all()


def test_events_and_arcs_keep_their_place_beside_splines(fixtures):
    toolpath = read(fixtures / "nx_nurbs.clsf")
    n = len(toolpath)
    assert [(e.kind, e.index) for e in toolpath.events] == [
        (EventKind.SPINDLE_ON, 2), (EventKind.COOLANT_OFF, n - 2),
    ]  # fmt: skip
    assert toolpath.arc.tolist() == [-1] * (n - 1) + [0]
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(90.0)


def test_coarser_tolerance_gives_fewer_points(fixtures, read_text):
    text = (fixtures / "nx_nurbs.clsf").read_text()
    fine, coarse = read_text(text), read_text(text, chord_tolerance=1e-4)
    assert len(coarse) < len(fine) / 2


def test_a_spline_of_too_many_pieces_is_refused(fixtures, read_text):
    text = (fixtures / "nx_nurbs.clsf").read_text()
    assert "CNTRL/20.0000,20.0000," in text
    far = text.replace("CNTRL/20.0000,20.0000,", "CNTRL/20000000,20.0000,")
    with pytest.raises(ReadError, match=r"APT088: a NURBS takes more than 100000 straight"):
        read_text(far, chord_tolerance=1e-6)


def test_from_is_where_a_first_arc_starts(read_text):
    text = "UNITS/MM\nFROM/10,0,0\nCIRCLE/0,0,0,0,0,1\nGOTO/0,10,0\nFINI\n"
    toolpath = read_text(text)
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(90.0)


def test_after_a_hole_an_arc_starts_at_the_retract_height(read_text):
    text = (
        "UNITS/MM\nCYCLE/DRILL,FEDTO,5,RAPTO,2,RTRCTO,10,MMPM,100\nGOTO/10,0,-10\nCYCLE/OFF\n"
        "CIRCLE/0,0,0,0,0,1\nGOTO/0,10,0\nFINI\n"
    )
    toolpath = read_text(text)
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(90.0)


@pytest.mark.parametrize("plane", [(0, 0, 1), (1, 0, 0), (0, -1, 0), (0.6, 0, 0.8)])
@pytest.mark.parametrize("degrees", [30.0, 180.0, 200.0, 359.0])
def test_arcs_in_any_plane_and_over_half_a_turn(read_text, plane, degrees):
    n = np.array(plane, dtype=float)
    u = np.cross(n, [0.36, 0.48, 0.8])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    t = np.radians(degrees)
    centre = np.array([5.0, -2.0, 7.0])
    start, end = centre + 3 * u, centre + 3 * (np.cos(t) * u + np.sin(t) * v)

    def words(values):
        return ",".join(f"{value:.9f}" for value in values)

    circle = f"CIRCLE/{words(centre)},{words(n)}"
    text = f"UNITS/MM\nGOTO/{words(start)}\n{circle}\nGOTO/{words(end)}\nFINI\n"
    arcs = read_text(text).arcs
    assert np.degrees(arcs.sweep[0]) == pytest.approx(degrees, abs=1e-5)
    np.testing.assert_allclose(arcs.normal[0], n, atol=1e-8)


def test_units_where_nothing_says(read_text):
    text = "FEDRAT/100\nGOTO/1,2,3\nFINI\n"
    with pytest.raises(ReadError) as caught:
        read_text(text)
    assert caught.value.code == "APT010"
    assert "--units" in caught.value.hint
    assert read_text(text, units="inch").points[0, 0] == pytest.approx(0.0254)
    assert read_text(text, units="inch").feed[0] == pytest.approx(100 * 0.0254 / 60)


def test_nx_feeds_in_inches_say_inch(read_text):
    text = "TOOL PATH/A,TOOL,B\nFEDRAT/IPM,10\nGOTO/1,0,0\nEND-OF-PATH\n"
    toolpath = read_text(text)
    assert toolpath.units == "inch"
    assert [finding.code for finding in toolpath.warnings] == ["APT110"]


def test_a_turning_table_is_reported_not_followed(read_text):
    text = "UNITS/MM\nGOTO/1,2,3\nROTATE/TABLE,90\nROTABL/1.57,AAXIS,TABLE\nGOTO/4,5,6\nFINI\n"
    toolpath = read_text(text)
    assert mm(toolpath) == [[1, 2, 3], [4, 5, 6]]
    assert toolpath.unknown_words == {"ROTABL": 1, "ROTATE": 1}
    assert [(use.word, use.refused) for use in toolpath.word_uses] == [
        ("ROTATE", True), ("ROTABL", True),
    ]  # fmt: skip


def test_a_creo_csys_that_moves_is_warned_about(fixtures, read_text):
    text = (fixtures / "part.ncl.3").read_text()
    at = text.index("0.0000000000,  $")
    moved = text[:at] + "9" + text[at + 1 :]
    toolpath = read_text(moved, "a.ncl.1")
    assert [finding.code for finding in toolpath.warnings] == ["APT160"]
    assert toolpath.points[1, 0] == pytest.approx(0.010)


def test_siemens_cycles_in_their_three_spellings(read_text):
    spellings = {
        "CYCLE81/10,0,2,-6": "CYCLE/OFF",
        "CYCLE/CYCLE81,10,0,2,-6": "CYCLE/OFF",
        "MCALL CYCLE81(10,0,2,-6)": "MCALL",
    }
    for first, last in spellings.items():
        toolpath = read_text(f"UNITS/MM\n{first}\nGOTO/1,2,0\n{last}\nGOTO/1,2,50\nFINI\n")
        assert toolpath.kind.tolist() == [MotionKind.HOLE, MotionKind.LINEAR]
        (cycle,) = toolpath.cycles
        assert (cycle.depth, cycle.clearance, cycle.retract) == pytest.approx((6e-3, 2e-3, 10e-3))


@pytest.mark.parametrize(("times", "degrees"), [("", 90), (",TIMES,1", 90), (",TIMES,3", 810)])
def test_times_counts_the_turns_that_are_begun(times, degrees, read_text):
    text = f"UNITS/MM\nGOTO/10,0,6\nCIRCLE/0,0,0,0,0,1,10{times}\nGOTO/0,10,0\nFINI\n"
    toolpath = read_text(text)
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(degrees)


FUSION = "PARTNO/'X'\nMODE/MILL\nUNITS/MM\nPPRINT/'T1'\nLOADTL/5, 0, 100., 0.\n"


@pytest.mark.parametrize(("dialect", "axis"), [("fusion", (0, 0, 1)), ("catia", (0.6, 0, 0.8))])
def test_an_operation_behind_multax_off_stands_along_z_where_the_post_says_so(
    read_text, dialect, axis
):
    toolpath = read_text(
        f"{FUSION}MULTAX/ON\nGOTO/0,0,50,0.6,0,0.8\nMULTAX/OFF\nGOTO/100,0,50\nFINI\n",
        dialect=dialect,
    )
    np.testing.assert_allclose(toolpath.axes[-1], axis, atol=1e-9)
    np.testing.assert_allclose(toolpath.axes[0], (0.6, 0, 0.8), atol=1e-9)


@pytest.mark.parametrize("between", ["", "GOTO/0,0,40\n"])
def test_a_feed_per_turn_may_stand_before_the_speed_of_the_spindle(read_text, between):
    """But no point may lie between the two."""
    toolpath = read_text(
        "PARTNO X\nUNITS/MM\nRAPID\nGOTO/0,0,50\nFEDRAT/.1,MMPR\n"
        f"{between}SPINDL/1000,RPM,CLW\nGOTO/0,0,0\nFINI\n"
    )
    assert toolpath.feed[-1] == pytest.approx(0.1 / 60.0)
    assert ("FEDRAT" in [use.word for use in toolpath.word_uses]) == bool(between)
