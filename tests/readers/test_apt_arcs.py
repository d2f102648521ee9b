"""Arcs of every seat against closed forms: any plane, any sweep, both senses, helices."""

import numpy as np
import pytest

from postproc.errors import ReadError
from postproc.model.toolpath import MotionKind

MM = "PARTNO X\nUNITS/MM\n"
PLANES = [(0, 0, 1), (1, 0, 0), (0, -1, 0), (0.6, 0, 0.8), (0.48, -0.6, 0.64)]
SWEEPS = [1.0, 30.0, 90.0, 180.0, 270.0, 359.0]
RADIUS = 12.5
CENTRE = np.array([3.0, -40.0, 7.0])


def circle_in(plane):
    """Return a function of an angle [deg] to a point, counterclockwise about ``plane``."""
    n = np.array(plane, dtype=float)
    u = np.cross(n, [0.36, 0.48, 0.8])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)

    def at(degrees, rise=0.0):
        angle = np.radians(degrees)
        return CENTRE + RADIUS * (np.cos(angle) * u + np.sin(angle) * v) + rise * n

    return at


def text(values, digits=9):
    return ",".join(f"{value:.{digits}f}" for value in np.ravel(values))


def drawn(toolpath, share):
    """Return the point [mm] of the only arc at a share of its way, from the model's own columns."""
    (tag,) = np.flatnonzero(toolpath.kind == MotionKind.ARC)
    arc = toolpath.arcs
    start, end = toolpath.points[tag - 1], toolpath.points[tag]
    n, c = arc.normal[0], arc.centre[0]
    rise = (end - start) @ n
    r = start - c
    height = (r @ n) * n
    flat = r - height
    angle = share * arc.sweep[0]
    turned = np.cos(angle) * flat + np.sin(angle) * np.cross(n, flat)
    return (c + height + turned + share * rise * n) * 1e3


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("degrees", SWEEPS)
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("digits", [4, 6])
def test_movarc_with_an_angle_takes_the_sense_that_meets_the_end(
    read_text, plane, degrees, sense, digits
):
    """The vector does not hold the sense in the posts of 2011: the end does, but of half turns."""
    at = circle_in(plane)
    end = at(sense * degrees)
    before = 2 * at(0) - at(0) - sense * 5 * np.cross(plane, at(0) - CENTRE) / RADIUS
    arc = f"MOVARC/{text(CENTRE, digits)},{text(plane)},{RADIUS},ANGLE,{degrees:.{digits}f}\n"
    cw = {"arc_sense": "cw"} if (degrees, sense) == (180.0, -1) else {}
    toolpath = read_text(
        f"{MM}GOTO/{text(before, digits)}\nGOTO/{text(at(0), digits)}\n{arc}"
        f"GOTO/{text(end, digits)}\nFINI\n",
        **cw,
    )
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(degrees, abs=2e-3)
    middle = at(sense * degrees / 2)
    assert np.linalg.norm(drawn(toolpath, 0.5) - middle) < 3 * 10.0**-digits
    assert toolpath.dialect == "fusion"
    assert toolpath.warnings == ()


@pytest.mark.parametrize("degrees", [180, 360])
def test_half_and_full_turns_without_a_neighbour_go_ccw_and_say_so(read_text, degrees):
    at = circle_in((0, 0, 1))
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nMOVARC/{text(CENTRE)},0,0,1,{RADIUS},ANGLE,{degrees}\n"
        f"GOTO/{text(at(degrees))}\nFINI\n"
    )
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(degrees / 2)) < 1e-6
    assert [(f.code, f.source.line) for f in toolpath.warnings] == [("APT133", 4)]


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("written_at", [0.0, 4.0])
@pytest.mark.parametrize("degrees", [40.0, -200.0])
def test_helix_with_its_centre_at_either_height(read_text, plane, written_at, degrees):
    at = circle_in(plane)
    centre = CENTRE + written_at * np.array(plane)
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nMOVARC/{text(centre)},{text(plane)},{RADIUS},ANGLE,"
        f"{abs(degrees)}\nGOTO/{text(at(degrees, 4.0))}\nFINI\n"
    )
    for share in (0.25, 0.5, 1.0):
        assert np.linalg.norm(drawn(toolpath, share) - at(share * degrees, share * 4.0)) < 1e-6


def test_helix_of_more_than_a_turn(read_text):
    at = circle_in((0, 0, 1))
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nMOVARC/{text(CENTRE)},0,0,1,{RADIUS},ANGLE,765\n"
        f"GOTO/{text(at(45, -9.0))}\nFINI\n"
    )
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(765)
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(382.5, -4.5)) < 1e-6


@pytest.mark.parametrize("degrees", [90.0, 180.0, 270.0])
@pytest.mark.parametrize("axis", [1, -1])
def test_movarc_with_an_axis_goes_ccw_about_it(read_text, degrees, axis):
    at = circle_in((0, 0, 1))
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nMOVARC/ CENTER,{text(CENTRE)},AXIS,0,0,{axis},RADIUS,{RADIUS}\n"
        f"GOTO/{text(at(axis * degrees))}\nFINI\n"
    )
    assert toolpath.dialect == "mfgsuite"
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(axis * degrees / 2)) < 1e-6


def test_arcslp_is_the_rise_of_the_arc_that_follows(read_text):
    at = circle_in((0, 0, 1))
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nARCSLP/ 3\nMOVARC/ CENTER,{text(CENTRE)},AXIS,0,0,-1,"
        f"RADIUS,{RADIUS}\nGOTO/{text(at(-90, -3))}\nFINI\n"
    )
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(-45, -1.5)) < 1e-6


@pytest.mark.parametrize("block", [1 << 22, 8])
@pytest.mark.parametrize("dialect", ["mfgsuite", "creo"])
def test_a_rise_is_of_the_next_arc_however_it_is_written(read_text, block, dialect, monkeypatch):
    monkeypatch.setattr("postproc.readers.text.blocks.BLOCK_BYTES", block)
    at = circle_in((0, 0, 1))
    arc = f"CIRCLE/{text(CENTRE)},0,0,1"
    helix = f"{MM}GOTO/{text(at(0))}\nARCSLP/{{}}\n{arc}\nGOTO/{text(at(90, 3))}\n"
    above = CENTRE + np.array([0, 0, 3])
    flat = f"CIRCLE/{text(above)},$\n0,0,1\nGOTO/{text(at(120, 3))}\nFINI\n"
    toolpath = read_text(helix.format(3) + flat, dialect=dialect, units="mm")
    assert np.degrees(toolpath.arcs.sweep) == pytest.approx([90.0, 30.0])
    with pytest.raises(ReadError, match=r"APT086.*rise of 2\.0000 mm"):
        read_text(helix.format(2) + flat, dialect=dialect, units="mm")


def test_movarc_of_eight_numbers_ends_in_its_sweep(read_text):
    at = circle_in((0, 0, 1))
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nMOVARC/{text(CENTRE)},0,0,1,{RADIUS},70\n"
        f"GOTO/{text(at(-70))}\nFINI\n"
    )
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(-35)) < 1e-6


@pytest.mark.parametrize(
    ("head", "eighth", "dialect"),
    [
        ("MCS/1,0,0,0,1,0,0,0,1,0,0,0\n", "{}", "camplete"),
        ("START/'OPERATION'\n", "{}", "manusnc"),
        ("TOOL PATH/A,TOOL,B\n", "0.06", "nx"),
        ("", "{}", "apt"),
        ("", "0.06", "apt"),
    ],
)
@pytest.mark.parametrize("degrees", [20.0, 180.0, 270.0])
def test_circle_of_eleven_numbers_goes_clockwise(read_text, head, eighth, dialect, degrees):
    at = circle_in((0, 0, 1))
    arc = f"CIRCLE/{text(CENTRE)},0,0,1,{RADIUS},{eighth.format(degrees)},0,0,0\n"
    end = "END-OF-PATH\n" if dialect == "nx" else "FINI\n"
    toolpath = read_text(f"{MM}{head}GOTO/{text(at(0))}\n{arc}GOTO/{text(at(-degrees))}\n{end}")
    assert toolpath.dialect == dialect
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(-degrees / 2)) < 1e-6


def test_arc_ends_in_its_own_point(read_text):
    """Without a sense in the record, or a neighbour that shows it, a file is asked back."""
    at = circle_in((0, 0, 1))
    numbers = f"{text(CENTRE)},0,0,1,{RADIUS},{text(at(80))}"
    toolpath = read_text(f"{MM}GOTO/{text(at(0))}\nARC/{numbers}\nFINI\n")
    (use,) = (use for use in toolpath.word_uses if use.refused)
    assert (use.word, use.lines) == ("ARC", (4,))
    assert "counterclockwise (read so) or clockwise" in use.reason
    along = -np.cross((0, 0, 1), at(0) - CENTRE)
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0) - along)}\nGOTO/{text(at(0))}\nARC/{numbers}\nFINI\n"
    )
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(-140)) < 1e-6
    assert toolpath.word_uses == ()


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("degrees", [50.0, -180.0, 270.0])
def test_catia_arc_on_a_cylinder(read_text, plane, degrees):
    at = circle_in(plane)
    sense = np.sign(degrees)
    tangent = sense * np.cross(plane, at(0) - CENTRE)
    second = "ON,2,INTOF" if abs(degrees) > 180 else "ON"
    statement = (
        f"PSIS/(PLANE/(POINT/{text(CENTRE)}),PERPTO,(VECTOR/{text(plane)}))\n"
        f"INDIRV/{text(tangent)}\nTLON,GOFWD/ (CYLNDR/{text(CENTRE)},$\n{text(plane)},{RADIUS}),"
        f"{second},(PLANE/PERPTO,(PLANE/(POINT/{text(CENTRE)}),PERPTO,(VECTOR/{text(plane)})),$\n"
        f"(POINT/{text(CENTRE)}),(POINT/{text(at(degrees))}))\n"
    )
    toolpath = read_text(f"{MM}GOTO/{text(at(0))}\n{statement}FINI\n")
    assert toolpath.dialect == "catia"
    assert np.degrees(toolpath.arcs.sweep[0]) == pytest.approx(abs(degrees), abs=1e-6)
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(degrees / 2)) < 1e-6


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize(("degrees", "second"), [(50.0, ""), (-120.0, ""), (230.0, ",2,INTOF")])
def test_ncl_arc_ends_in_its_plane(read_text, plane, degrees, second):
    """The plane stands across the circle through its axis and the end: met 180 degrees apart."""
    at = circle_in(plane)
    tangent = np.sign(degrees) * np.cross(plane, at(0) - CENTRE)
    across = np.cross(plane, at(degrees) - CENTRE) / RADIUS
    statement = (
        f"INDIRP/{text(at(0) + tangent)}\nTLON,GOFWD/(CIRCLE/CANON,{text(CENTRE)},{text(plane)},"
        f"{RADIUS}),ON{second},(PLANE/{text([*across, across @ CENTRE])})\n"
    )
    toolpath = read_text(f"{MM}GOTO/{text(at(0))}\n{statement}FINI\n")
    assert toolpath.dialect == "postworks"
    assert np.linalg.norm(toolpath.points[-1] * 1e3 - at(degrees)) < 1e-6
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(degrees / 2)) < 1e-6


def test_moves_to_a_clearance_plane_along_a_tilted_axis(read_text):
    toolpath = read_text(
        f"{MM}CLRSRF/50\nGOTO/0,0,10,0.6,0,0.8\nRETRCT\nGOTO/1,0,10\nRETRCT/5\nFINI\n"
    )
    np.testing.assert_allclose(toolpath.points[1] * 1e3, [30, 0, 50], atol=1e-9)
    assert toolpath.kind.tolist() == [1, 0, 1]
    assert [(use.word, use.lines) for use in toolpath.word_uses if use.refused] == [
        ("RETRCT", (7,))
    ]


def test_increments_and_where_the_tool_stands(read_text):
    toolpath = read_text(
        f"{MM}FROM/1,2,3\nGOTO/1,2,3\nGODLTA/1,1,1,0,0.6,0.8\nGODLTA/5\nFROM/9,9,9\nGOTO/0,0,0\n"
        "FINI\n"
    )
    np.testing.assert_allclose(toolpath.start * 1e3, [1, 2, 3])
    np.testing.assert_allclose(
        toolpath.points * 1e3, [(1, 2, 3), (2, 3, 4), (2, 6, 8), (0, 0, 0)], atol=1e-9
    )
    np.testing.assert_allclose(toolpath.axes[1:3], [(0, 0.6, 0.8)] * 2)
    assert [(use.word, use.refused) for use in toolpath.word_uses] == [
        ("GODLTA", True), ("FROM", False),
    ]  # fmt: skip


@pytest.mark.parametrize("sense", [1, -1])
def test_a_circle_of_plain_apt_goes_on_as_the_cuts_beside_it(read_text, sense):
    """Systems differ in the sense that CIRCLE has; a quarter must not become three quarters."""
    at = circle_in((0, 0, 1))
    start, end = at(0), at(sense * 90)
    lead, out = (sense * 5 * np.cross((0, 0, 1), p - CENTRE) / RADIUS for p in (start, end))
    toolpath = read_text(
        f"{MM}GOTO/{text(start - lead)}\nGOTO/{text(start)}\nCIRCLE/{text(CENTRE)},0,0,1,{RADIUS}\n"
        f"GOTO/{text(end)}\nGOTO/{text(end + out)}\nFINI\n"
    )
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(sense * 45)) < 1e-6
    said = [(f.code, f.source.line) for f in toolpath.warnings]
    assert said == ([] if sense > 0 else [("APT134", 5)])


def test_a_circle_of_plain_apt_that_nothing_decides_is_told(read_text):
    at = circle_in((0, 0, 1))
    toolpath = read_text(
        f"{MM}GOTO/{text(at(0))}\nCIRCLE/{text(CENTRE)},0,0,1,{RADIUS}\nGOTO/{text(at(90))}\nFINI\n"
    )
    assert np.linalg.norm(drawn(toolpath, 0.5) - at(45)) < 1e-6
    assert [(f.code, f.source.line) for f in toolpath.warnings] == [("APT133", 4)]
