"""Hand-written programs against hand-made CAM data: what counts as the same path, and what not."""

import json

import numpy as np
import pytest

from postproc.model.toolpath import Arcs, Cycle, Event, EventKind
from postproc.verification import Tolerances
from postproc.verification.cam.matching import match
from postproc.verification.verify import verify
from tests.samples import AT_PART, DRILL, HEAD, START, at, cell_in, modules, path_of

SQUARE = [(-50, 0, 0), (0, 0, 0), (0, 40, 0), (0, 40, 40), (0, 0, 40)]


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"), **AT_PART)


def check(cell, toolpath, *lines, tolerances=None, **others):
    head = (*HEAD, START)
    return verify(
        modules(*head, *lines, **others), "T", cell, toolpath, tolerances, collisions=False
    )


def kinds(report):
    return {violation.code for violation in report.violations}


def cuts(*points):
    return [at(*point) for point in points]


# ----------------------------------------------------------------------------------- cuts


def test_the_same_path_is_good(cell):
    report = check(cell, path_of(SQUARE), *cuts(*SQUARE))
    assert kinds(report) == set()
    assert (report.tags, report.matched) == (5, 5)
    assert report.position_error < 1e-9
    assert report.ok


def test_more_points_on_the_lines_are_good(cell):
    more = [(-50, 0, 0), (-20, 0, 0), (0, 0, 0), (0, 10, 0), (0, 25, 0), (0, 40, 0)]
    report = check(cell, path_of(SQUARE), *cuts(*more, (0, 40, 40), (0, 0, 40)))
    assert kinds(report) == set()


def test_going_to_and_fro_on_a_line_is_good(cell):
    more = [*SQUARE[:2], (0, 30, 0), (0, 10, 0), *SQUARE[2:]]
    assert kinds(check(cell, path_of(SQUARE), *cuts(*more))) == set()


def test_a_point_that_the_file_repeats_is_wanted_once(cell):
    repeated = [*SQUARE[:3], SQUARE[2], SQUARE[2], *SQUARE[3:]]
    assert kinds(check(cell, path_of(repeated), *cuts(*SQUARE))) == set()


def test_reentry_along_the_axis_is_good(cell):
    """The tool leaves a cut along its axis, moves as it likes, and goes on where it left."""
    lines = [
        *cuts((-50, 0, 0), (0, 0, 0), (0, 20, 0), (-80, 20, 0)),
        START,
        *cuts((-80, 20, 0), (0, 20, 0), (0, 40, 0), (0, 40, 40), (0, 0, 40)),
    ]
    assert kinds(check(cell, path_of(SQUARE), *lines)) == set()


def test_reentry_by_a_joint_motion_is_not(cell):
    """It may come from anywhere, through the part as well."""
    back = at(0, 20, 0).replace("LIN", "PTP")
    lines = [*cuts((-50, 0, 0), (0, 0, 0), (0, 20, 0), (-80, 20, 0)), START, back]
    report = check(cell, path_of(SQUARE), *lines, *cuts(*SQUARE[2:]))
    assert kinds(report) == {"entry", "path"}
    assert "comes back by a joint motion" in report.violations[1].message


@pytest.mark.parametrize("place", ["behind", "inside"])
@pytest.mark.parametrize("extra", [[(0, 10, 60), (0, 30, 60)], [(0, 10, 60)], [(5, 0, 40)]])
def test_a_cut_too_many(cell, place, extra):
    """Another line, another plunge, deeper than asked: nothing of the file asks for it."""
    above = [(-80, *point[1:]) for point in (extra[0], extra[-1])]
    more = [*cuts(above[0], *extra, above[1])]
    if place == "behind":
        lines = [*cuts(*SQUARE, (-50, 0, 40)), START, *more]
    else:
        lines = [*cuts(*SQUARE[:2], (0, 20, 0), (-80, 20, 0)), START, *more, START]
        lines += cuts((-80, 20, 0), (0, 20, 0), *SQUARE[2:], (-50, 0, 40))
    report = check(cell, path_of(SQUARE), *lines)
    assert kinds(report) == {"path"}
    assert "does not ask for" in report.violations[0].message


def test_a_joint_motion_back_to_where_a_cut_ended(cell):
    back = at(0, 0, 40).replace("LIN", "PTP")
    lines = [*cuts(*SQUARE, (-50, 0, 40)), START, back, *cuts((-50, 0, 40))]
    report = check(cell, path_of(SQUARE), *lines)
    assert "a joint motion back to where a cut has ended" in report.violations[0].message


def test_reentry_from_the_side_is_not(cell):
    lines = cuts((-50, 0, 0), (0, 0, 0), (0, 20, 0), (-30, 60, 30), (0, 20, 0), *SQUARE[2:])
    assert kinds(check(cell, path_of(SQUARE), *lines)) == {"path"}


def test_reentry_too_far_ahead_leaves_a_gap(cell):
    lines = [
        *cuts((-50, 0, 0), (0, 0, 0), (0, 20, 0), (-80, 20, 0), (-80, 30, 0), (0, 30, 0)),
        *cuts(*SQUARE[2:]),
    ]
    report = check(cell, path_of(SQUARE), *lines)
    assert kinds(report) == {"path"}
    assert "10.000 mm of it are left out" in report.violations[0].message


def test_moved_by_more_than_the_tolerance(cell):
    for off, expected in ((0.009, set()), (0.02, {"position"})):
        moved = [*SQUARE[:2], (0, 40 + off, 0), *SQUARE[3:]]
        report = check(cell, path_of(SQUARE), *cuts(*moved))
        assert kinds(report) == expected
        assert report.position_error == pytest.approx(off * 1e-3, rel=1e-6)
    wide = check(cell, path_of(SQUARE), *cuts(*moved), tolerances=Tolerances(position=1e-4))
    assert kinds(wide) == set()


def test_missing_swapped_and_extra_points(cell):
    assert kinds(check(cell, path_of(SQUARE), *cuts(*SQUARE[:2], *SQUARE[3:]))) == {"position"}
    swapped = [*SQUARE[:2], SQUARE[3], SQUARE[2], SQUARE[4]]
    assert "order" in kinds(check(cell, path_of(SQUARE), *cuts(*swapped)))
    extra = [*SQUARE[:3], (0, 60, 20), *SQUARE[3:]]
    assert kinds(check(cell, path_of(SQUARE), *cuts(*extra))) == {"path"}
    reverse = check(cell, path_of(SQUARE), *cuts(*SQUARE[::-1]))
    assert "order" in kinds(reverse)


def test_a_closed_contour_with_a_lost_point_is_not_skipped_whole(cell):
    angles = np.linspace(0, 2 * np.pi, 25)
    loop = [(-50, 0, 0), *[(0, 50 * np.cos(a), 50 * np.sin(a)) for a in angles]]
    lost = loop[:1] + loop[2:]
    report = check(cell, path_of(loop), *cuts(*lost))
    assert report.matched == len(loop) - 1
    assert len([v for v in report.violations if v.code in ("position", "order")]) == 1


def test_no_motion_at_all(cell):
    report = verify(modules("HALT"), "T", cell, path_of(SQUARE), collisions=False)
    assert kinds(report) == {"missed"}
    document = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert document["max_position_error_mm"] is None
    assert not document["ok"]


def test_the_tool_axis(cell):
    for tilt, expected in ((0.004, set()), (0.01, {"axis"})):
        lines = cuts(*SQUARE)
        lines[2] = lines[2].replace("B 0.0", f"B {tilt}")
        report = check(cell, path_of(SQUARE), *lines)
        assert kinds(report) == expected
        assert np.degrees(report.axis_error) == pytest.approx(tilt, rel=1e-4)
    turned = [line.replace("C 175.0", "C 150.0") for line in cuts(*SQUARE)]
    assert kinds(check(cell, path_of(SQUARE), *turned)) == set()  # the turn about it is free


def test_feeds(cell):
    fast = ["$VEL.CP=0.0101", *cuts(*SQUARE)]
    report = check(cell, path_of(SQUARE), *fast)
    assert kinds(report) == {"feed"}
    assert "606.00 mm/min" in report.violations[0].message
    one = [*cuts(*SQUARE[:3]), "$VEL.CP=0.02", at(*SQUARE[3]), "$VEL.CP=0.01", at(*SQUARE[4])]
    report = check(cell, path_of(SQUARE), *one)
    assert [v.source.line for v in report.violations] == [len(HEAD) + 7]
    no_feed = path_of(SQUARE, feed=np.nan)
    assert kinds(check(cell, no_feed, *cuts(*SQUARE))) == set()  # 600 mm/min from the cell
    rapid = ["$VEL.CP=1.0", at(*SQUARE[0]), "$VEL.CP=0.01", *cuts(*SQUARE[1:])]
    assert kinds(check(cell, path_of(SQUARE), *rapid)) == set()


# ----------------------------------------------------------------------------------- arcs


def ring(sweep, start=(0, 30, 0), kind="RLA", normal=(1.0, 0.0, 0.0)):
    """A toolpath with an arc about the origin."""
    a = sweep * np.sign(normal[0])
    end = (0, 30 * np.cos(a), 30 * np.sin(a))
    arcs = Arcs(np.zeros((1, 3)), np.array([normal]), np.array([0.03]), np.array([sweep]))
    return path_of([(-50, 30, 0), start, end], kind, arcs=arcs)


def arc(share_aux, share_end, radius=30.0):
    a, e = 2 * np.pi * share_aux, 2 * np.pi * share_end
    return (
        f"CIRC {{X 0.0,Y {radius * np.cos(a):.5f},Z {radius * np.sin(a):.5f}}},"
        f"{{X 0.0,Y {radius * np.cos(e):.5f},Z {radius * np.sin(e):.5f},A 0.0,B 0.0,C 175.0}}"
    )


ENTRY = [(-50, 30, 0), (0, 30, 0)]


def test_arcs(cell):
    quarter = ring(np.pi / 2)
    assert kinds(check(cell, quarter, *cuts(*ENTRY), arc(0.1, 0.25))) == set()
    assert kinds(check(cell, quarter, *cuts(*ENTRY), arc(0.05, 0.1), arc(0.2, 0.25))) == set()
    wrong_way = check(cell, quarter, *cuts(*ENTRY), arc(-0.3, 0.25))
    assert kinds(wrong_way) == {"path"}
    other_normal = ring(3 * np.pi / 2, normal=(-1.0, 0.0, 0.0))
    assert kinds(check(cell, other_normal, *cuts(*ENTRY), arc(-0.3, -0.75))) == set()


def test_full_circles(cell):
    full = ring(2 * np.pi)
    two = [arc(0.25, 0.5), arc(0.75, 1.0)]
    assert kinds(check(cell, full, *cuts(*ENTRY), *two)) == set()
    assert "path" in kinds(check(cell, full, *cuts(*ENTRY), arc(-0.25, -0.5), arc(-0.75, -1.0)))
    assert kinds(check(cell, full, *cuts(*ENTRY))) != set()
    by_angle = f"{arc(0.25, 0.5)},CA 360.0"
    assert kinds(check(cell, full, *cuts(*ENTRY), by_angle)) == set()


def test_arcs_by_lines(cell):
    quarter = ring(np.pi / 2)
    for pieces, expected in ((40, set()), (4, {"path"})):
        angles = np.linspace(0, np.pi / 2, pieces + 1)[1:]
        lines = cuts(*[(0, 30 * np.cos(a), 30 * np.sin(a)) for a in angles])
        report = check(cell, quarter, *cuts(*ENTRY), *lines)
        assert kinds(report) == expected
        sagitta = 30.0 * (1 - np.cos(np.pi / 4 / pieces))
        assert report.worst["path"].value == pytest.approx(sagitta, rel=0.02)


def test_a_helix_rises(cell):
    rise = 10.0
    arcs = Arcs(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), np.array([0.03]), np.array([4 * np.pi]))
    toolpath = path_of([(-50, 30, 0), (0, 30, 0), (rise, 30, 0)], "RLA", arcs=arcs)
    angles = np.linspace(0, 4 * np.pi, 401)[1:]
    turns = [(rise * a / (4 * np.pi), 30 * np.cos(a), 30 * np.sin(a)) for a in angles]
    assert kinds(check(cell, toolpath, *cuts(*ENTRY, *turns))) == set()
    flat = [(rise * a / (4 * np.pi), 30, 0) for a in angles]
    assert kinds(check(cell, toolpath, *cuts(*ENTRY, *flat))) == {"path"}
    one_turn = [p for p, a in zip(turns, angles, strict=True) if a <= 2 * np.pi]
    once = [*one_turn, (rise, 30, 0)]
    assert kinds(check(cell, toolpath, *cuts(*ENTRY, *once))) == {"path"}


# ----------------------------------------------------------------------------------- holes

HOLES = [(0, 0, 0), (0, 40, 0)]


def hole(y, bottom=8.0, clear=3.0, feed=0.0025, dwell=0.5, top=30.0, blend=""):
    return [
        "$VEL.CP=1.0",
        at(-top, y, 0),
        at(-clear, y, 0, blend),
        f"$VEL.CP={feed}",
        at(bottom, y, 0),
        f"WAIT SEC {dwell}",
        "$VEL.CP=1.0",
        at(-top, y, 0),
    ]


def drilled(cell, *lines, cycle=DRILL):
    return check(cell, path_of(HOLES, "HH", cycles=[cycle]), *lines)


def test_holes(cell):
    report = drilled(cell, *hole(0), *hole(40))
    assert kinds(report) == set()
    assert report.worst["feed"].value < 0.01


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"bottom": 7.5}, "depth"),
        ({"bottom": 8.5}, "depth"),
        ({"clear": 1.0}, "feed"),
        ({"feed": 0.003}, "feed"),
        ({"dwell": 0.1}, "dwell"),
        ({"blend": "C_DIS"}, "blended_plunge"),
    ],
)
def test_wrong_holes(cell, change, kind):
    wanted = {kind} if kind != "feed" or "clear" not in change else {"feed"}
    assert kinds(drilled(cell, *hole(0), *hole(40, **change))) == wanted


def test_holes_from_the_side_and_without_a_way_out(cell):
    low = ["$VEL.CP=0.0025", at(-1, 40, 0), at(8, 40, 0), "WAIT SEC 0.5", at(-30, 40, 0)]
    assert "plunge" in kinds(drilled(cell, *hole(0), *low))
    early = [*hole(40)[:-1], at(-10, 40, 0), at(-10, 80, 0)]
    assert "retract" in kinds(drilled(cell, *hole(0), *early))


def test_blended_bottom(cell):
    bottom = "LIN {X 8.0000,Y 40"
    lines = [f"{line} C_DIS" if line.startswith(bottom) else line for line in hole(40)]
    assert "blended_plunge" in kinds(drilled(cell, *hole(0), *lines))


def test_pecks_may_go_back_fast_where_it_is_drilled(cell):
    cycle = Cycle("deep", depth=12e-3, clearance=3e-3, retract=30e-3, peck=4e-3, feed=0.0025)

    def deep(y, back=0.5):
        lines = ["$VEL.CP=1.0", at(-30, y, 0), at(-3, y, 0)]
        for depth in (4, 8, 12):
            lines += ["$VEL.CP=0.0025", at(depth, y, 0), "$VEL.CP=1.0", at(-3, y, 0)]
            lines += [at(depth - back, y, 0)] if depth < 12 else []
        return [*lines, at(-30, y, 0)]

    assert kinds(drilled(cell, *deep(0), *deep(40), cycle=cycle)) == set()
    # fast onto the bottom of the last peck
    assert kinds(drilled(cell, *deep(0), *deep(40, back=0.0), cycle=cycle)) == {"feed"}
    # fast into the material: half a millimetre beyond what is drilled
    assert kinds(drilled(cell, *deep(0), *deep(40, back=-0.5), cycle=cycle)) == {"feed", "peck"}
    # a peck left out, and one behind which the tool stays down
    for lost in (slice(9, 12), slice(4, 6)):
        lines = deep(40)
        del lines[lost]
        assert "peck" in kinds(drilled(cell, *deep(0), *lines, cycle=cycle)), lost


@pytest.mark.parametrize(
    ("depths", "lift", "expected"),
    [
        ((4, 8, 12), 1.0, set()),
        ((4, 8, 12), 7.0, set()),
        ((2, 6, 10, 12), 1.0, {"peck"}),
        ((4, 7, 11, 12), 1.0, {"peck"}),
        ((4.3, 8.3, 12), 1.0, {"peck"}),
        ((3.7, 7.7, 11.7, 12), 1.0, {"peck"}),
        ((4, 8, 12), 0.0, {"peck"}),
    ],
)
def test_pecks_are_as_deep_as_ordered_and_the_chip_is_broken(cell, depths, lift, expected):
    cycle = Cycle(
        "deep", depth=12e-3, clearance=3e-3, retract=30e-3, peck=4e-3, feed=0.0025,
        break_chip=True,
    )  # fmt: skip
    program = []
    for y in (0, 40):
        program += ["$VEL.CP=1.0", at(-30, y, 0), at(-3, y, 0)]
        for depth in depths:
            program += ["$VEL.CP=0.0025", at(depth, y, 0), "$VEL.CP=1.0"]
            program += [at(depth - lift, y, 0)] if lift and depth < 12 else []
        program += [at(-30, y, 0)]
    assert kinds(drilled(cell, *program, cycle=cycle)) == expected


def test_nothing_goes_deeper_than_the_hole(cell):
    lines = hole(40)
    plunge = next(i for i, line in enumerate(lines) if "X 8.0000" in line)
    deeper = [*lines[:plunge], at(17, 40, 0), at(-3, 40, 0), *lines[plunge:]]
    assert "depth" in kinds(drilled(cell, *hole(0), *deeper))
    by_shift = [*lines[:plunge], "LIN_REL {X 20}", at(-3, 40, 0), *lines[plunge:]]
    assert "depth" in kinds(drilled(cell, *hole(0), *by_shift))
    aside = [*lines[:1], "PTP_REL {A1 0.5}", *lines[1:]]
    assert "path" in kinds(drilled(cell, *hole(0), *aside))


def test_nothing_moves_sideways_in_a_hole(cell):
    cycle = Cycle("deep", depth=12e-3, clearance=3e-3, retract=30e-3, peck=6e-3, feed=0.0025)

    def deep(lift):
        pecks = ["$VEL.CP=0.0025", at(6, 40, 0), "$VEL.CP=1.0", *lift, at(5.5, 40, 0)]
        down = [at(-30, 40, 0), at(-3, 40, 0), *pecks, at(-3, 40, 0), at(5.5, 40, 0)]
        return [*down, "$VEL.CP=0.0025", at(12, 40, 0), "$VEL.CP=1.0", at(-30, 40, 0)]

    first = ["$VEL.CP=1.0", at(-30, 0, 0), at(-3, 0, 0), "$VEL.CP=0.0025", at(6, 0, 0)]
    first += ["$VEL.CP=1.0", at(-3, 0, 0), "$VEL.CP=0.0025", at(12, 0, 0)]
    first += ["$VEL.CP=1.0", at(-30, 0, 0)]
    good = drilled(cell, *first, *deep([at(-3, 40, 0)]), cycle=cycle)
    assert kinds(good) == set()
    for lift in ([at(2, 43, 0)], [START], [at(-3, 90, 0)]):
        assert "plunge" in kinds(drilled(cell, *first, *deep(lift), cycle=cycle))


# ---------------------------------------------------------------------------------- events


def with_events(*events):
    return path_of(SQUARE, events=events)


ON = Event(1, EventKind.SPINDLE_ON, 50.0, "3000,RPM", 2)
OFF = Event(5, EventKind.SPINDLE_OFF, 0.0, "", 9)
FIRST, *REST = cuts(*SQUARE)


def test_events_in_their_place(cell):
    toolpath = with_events(ON, OFF)
    good = [FIRST, "PP_SPINDLE_ON(3000)", *REST, "PP_SPINDLE_OFF()"]
    assert kinds(check(cell, toolpath, *good)) == set()
    early = ["PP_SPINDLE_ON(3000)", FIRST, *REST, "PP_SPINDLE_OFF()"]
    assert kinds(check(cell, toolpath, *early)) == {"event"}
    late = [FIRST, REST[0], REST[1], "PP_SPINDLE_ON(3000)", *REST[2:], "PP_SPINDLE_OFF()"]
    assert kinds(check(cell, toolpath, *late)) == {"event", "spindle"}
    for rpm in (300, 3000.9):
        speed = [FIRST, f"PP_SPINDLE_ON({rpm})", *REST, "PP_SPINDLE_OFF()"]
        assert kinds(check(cell, toolpath, *speed)) == {"event"}
    none = check(cell, toolpath, FIRST, *REST)
    assert kinds(none) == {"event"}
    assert len(none.violations) == 2
    flying = [FIRST, "TRIGGER WHEN DISTANCE=0 DELAY=0 DO PP_SPINDLE_ON(3000) PRIO=-1"]
    assert kinds(check(cell, toolpath, *flying, *REST, "PP_SPINDLE_OFF()")) == {"spindle"}


def test_more_events_than_asked_for_are_a_warning(cell):
    calls = ("PP_SPINDLE_ON(3000)", *REST, "PP_SPINDLE_OFF()")
    report = check(cell, path_of(SQUARE), FIRST, *calls)
    assert kinds(report) == set()
    assert [w.code for w in report.warnings] == ["advance", "event", "event"]
    for number, found in ((cell.tool.number, set()), (cell.tool.number + 1, {"event"})):
        assert (
            kinds(check(cell, path_of(SQUARE), f"PP_TOOL_CHANGE({number})", FIRST, *REST)) == found
        )
    again = check(cell, with_events(ON, OFF), FIRST, calls[0], *calls)
    assert (kinds(again), [w.code for w in again.warnings]) == (set(), ["advance", "event"])


def test_no_cut_runs_with_what_the_file_does_not_say(cell):
    begin, *rest, end = "PP_SPINDLE_ON(3000)", *REST, "PP_SPINDLE_OFF()"
    slower = [FIRST, begin, "PP_SPINDLE_ON(300)", *rest, end]
    back = [FIRST, begin, "PP_SPINDLE_ON(300)", begin, *rest, end]
    assert kinds(check(cell, with_events(ON, OFF), *slower)) == {"event"}
    assert kinds(check(cell, with_events(ON, OFF), *back)) == set()


def test_stops_may_be_halts(cell):
    toolpath = with_events(Event(3, EventKind.STOP, 0.0, "", 5))
    assert kinds(check(cell, toolpath, *cuts(*SQUARE[:3]), "HALT", *cuts(*SQUARE[3:]))) == set()
    assert kinds(check(cell, toolpath, *cuts(*SQUARE))) == {"event"}


def test_dwells_between_points(cell):
    toolpath = with_events(Event(3, EventKind.DWELL, 1.5, "", 5))
    there = [*cuts(*SQUARE[:3]), "WAIT SEC 1.5", *cuts(*SQUARE[3:])]
    assert kinds(check(cell, toolpath, *there)) == set()
    elsewhere = [*cuts(*SQUARE[:2]), "WAIT SEC 1.5", *cuts(*SQUARE[2:])]
    assert kinds(check(cell, toolpath, *elsewhere)) == {"dwell"}


def test_a_dwell_at_the_end_of_a_cut_is_there(cell):
    toolpath = with_events(Event(5, EventKind.DWELL, 0.5, "", 9))
    x, y, z = SQUARE[-1]
    wait, up = "WAIT SEC 0.5", cuts((x - 50, y, z))
    assert kinds(check(cell, toolpath, FIRST, *REST, wait, *up)) == set()
    assert kinds(check(cell, toolpath, FIRST, *REST, *up, wait)) == {"dwell"}


def test_hooks_may_have_other_names(tmp_path):
    cell = cell_in(tmp_path, '[krl.hooks]\nspindle_on = "MILL_START"\n', **AT_PART)
    toolpath = with_events(ON)
    rest = (*REST, "PP_SPINDLE_OFF()")
    assert kinds(check(cell, toolpath, FIRST, "Mill_Start(3000)", *rest)) == set()
    other = check(cell, toolpath, FIRST, "PP_SPINDLE_ON(3000)", *rest)
    assert kinds(other) == {"event", "spindle", "unjudged"}
    left_on = check(cell, toolpath, FIRST, "Mill_Start(3000)", *REST)
    assert kinds(left_on) == {"event", "spindle"}


# --------------------------------------------------------------------------- sub-programs


def test_a_path_over_several_modules(cell):
    part = "\n".join(["DEF PART( )", START, *cuts(*SQUARE[2:]), "END", ""])
    report = check(cell, path_of(SQUARE), *cuts(*SQUARE[:2]), "PART( )", PART=part)
    # by PTP from point 2 to 3: that line is not cut, and it begins in material
    assert kinds(report) == {"entry", "path", "retract"}
    again = "\n".join(["DEF PART( )", START, *cuts((-50, 0, 0), *SQUARE[1:]), "END", ""])
    report = check(cell, path_of(SQUARE), *cuts(*SQUARE[:2]), at(-50, 0, 0), "PART( )", PART=again)
    assert kinds(report) == set()


# -------------------------------------------------------------------------------- matching


def test_matching_finds_the_longest_order():
    rng = np.random.default_rng(0)
    wanted = rng.normal(size=(300, 3))
    extra = rng.normal(size=(300, 3))
    visited = np.empty((600, 3))
    visited[::2], visited[1::2] = extra, wanted
    found = match(wanted, visited, 1e-6)
    assert (found.first == np.arange(300) * 2 + 1).all()
    broken = np.delete(visited, [21, 301], axis=0)
    broken[[102, 104]] = broken[[104, 102]]
    lost = match(wanted, broken, 1e-6).first
    assert (lost < 0).sum() == 3
    assert (np.diff(lost[lost >= 0]) > 0).all()


def test_matching_of_places_that_are_passed_again_and_again():
    """Brute force: the number of matched points is that of the longest common subsequence."""
    rng = np.random.default_rng(1)
    for _ in range(60):
        places = rng.normal(size=(4, 3))
        a, b = rng.integers(0, 4, 12), rng.integers(0, 4, 15)
        a = a[np.r_[True, a[1:] != a[:-1]]]
        table = np.zeros((len(a) + 1, len(b) + 1), dtype=int)
        for i, x in enumerate(a):
            for j, y in enumerate(b):
                best = max(table[i, j + 1], table[i + 1, j])
                table[i + 1, j + 1] = table[i, j] + 1 if x == y else best
        found = match(places[a], places[b], 1e-6).first
        assert (found >= 0).sum() == table[-1, -1]


def test_nothing_to_match():
    none = np.zeros((0, 3))
    assert len(match(none, np.ones((3, 3)), 1e-6).first) == 0
    assert match(np.ones((2, 3)), none, 1e-6).first.tolist() == [-1, -1]
