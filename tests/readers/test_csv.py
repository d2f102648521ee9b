"""Point lists in the dialects found in the wild; the expected points are written down here."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.errors import ReadError
from postproc.model.toolpath import EventKind, MotionKind
from postproc.readers import ReadOptions, read
from postproc.readers.csv.columns import column_of

POINTS = np.array([(0, 0, 10), (25.4, 0, 10), (50, 5.5, 9.5)]) * 1e-3
AXES = np.array([(0, 0, 1), (0.6, 0, 0.8), (0, -0.6, 0.8)])
HOLES = ["holes_header.csv", "holes_semicolon.csv", "holes_tab.csv"]
POINT_FILES = [
    *HOLES,
    "points_blank.csv",
    "points_named.csv",
    "points_decimal_comma_blank.csv",
    "points_quoted.csv",
    "points_repeated.csv",
]


@pytest.mark.parametrize("name", POINT_FILES)
def test_the_same_points_in_every_dialect(name, fixtures):
    toolpath = read(fixtures / name)
    np.testing.assert_allclose(toolpath.points, POINTS, atol=1e-12)
    np.testing.assert_allclose(toolpath.axes, AXES, atol=1e-12)
    assert (toolpath.format, toolpath.dialect, toolpath.units) == ("csv", "csv", "mm") or (
        name == "holes_tab.csv"
    )
    assert toolpath.recovered == ()


@pytest.mark.parametrize("name", HOLES)
def test_holes_have_depth_diameter_feed_and_operation(name, fixtures):
    toolpath = read(fixtures / name)
    assert (toolpath.kind == MotionKind.HOLE).all()
    cycles = [toolpath.cycles[i] for i in toolpath.cycle]
    assert [c.depth for c in cycles] == pytest.approx([0.006, 0.006, 0.008])
    assert [c.diameter for c in cycles] == pytest.approx([0.0048, 0.0048, 0.0056])
    np.testing.assert_allclose(toolpath.extra["diameter"], [0.0048, 0.0048, 0.0056])
    np.testing.assert_allclose(toolpath.feed, np.array([120, 120, 90]) / 60e3)
    assert [o.name for o in toolpath.operations] == ["skin", "rib"]
    assert toolpath.operation.tolist() == [0, 0, 1]
    assert toolpath.names == ("H1", "H2", "H3")


def test_lines_are_those_of_the_file(fixtures):
    assert read(fixtures / "holes_header.csv").line.tolist() == [3, 4, 5]
    assert read(fixtures / "points_blank.csv").line.tolist() == [1, 2, 3]


def test_repeated_measurements_become_one_point(fixtures):
    toolpath = read(fixtures / "points_repeated.csv")
    assert toolpath.names == ("P1", "P2", "P3")
    assert toolpath.line.tolist() == [2, 4, 5]
    assert "CSV140" in {finding.code for finding in toolpath.warnings}


def test_one_hole_in_two_operations_is_no_repeat(read_text):
    rows = "id,x,y,z,i,j,k,depth,operation\nA,1,2,3,0,0,1,5,drill\nA,1,2,3,0,0,1,5,ream\n"
    assert len(read_text(rows, "h.csv")) == 2


def test_empty_fields_repeat_the_row_before(fixtures):
    toolpath = read(fixtures / "points_unchanged.csv")
    assert toolpath.kind.tolist() == [3, 3, 3, 0]
    np.testing.assert_allclose(toolpath.feed[:3] * 60e3, [120, 120, 90])
    assert np.isnan(toolpath.feed[3])
    assert [toolpath.tools[i].number for i in toolpath.tool] == [3, 3, 4, 4]
    changes = [(e.index, e.value) for e in toolpath.events if e.kind is EventKind.TOOL_CHANGE]
    assert changes == [(0, 3.0), (2, 4.0)]


def test_heights_of_a_hole(read_text):
    default = read_text("x,y,z,i,j,k,depth\n1,2,3,0,0,1,5\n", "a.csv").cycles[0]
    assert (default.clearance, default.retract) == pytest.approx((2e-3, 10e-3))
    given = read_text(
        "x,y,z,i,j,k,depth,clearance,retract,peck,dwell\n1,2,3,0,0,1,5,1,30,2,0.5\n", "b.csv"
    ).cycles[0]
    values = (given.clearance, given.retract, given.peck, given.peck_first, given.dwell)
    assert values == pytest.approx((1e-3, 30e-3, 2e-3, 2e-3, 0.5))
    assert given.kind == "deep"


@pytest.mark.parametrize("tool_axis", [(1, 0, 0), (0, 0, 1), (0, -1, 0)])
def test_orientations_in_every_form(fixtures, tool_axis):
    truth = Rotation.from_euler("ZYX", [30, -20, 10], degrees=True).as_matrix()
    options = ReadOptions(tool_axis=tool_axis)
    abc = read(fixtures / "poses_abc.csv", options=options)
    wpr = read(
        fixtures / "poses_wpr.csv",
        options=ReadOptions(tool_axis=tool_axis, columns="x,y,z,w,p,r,id"),
    )
    for toolpath in (abc, wpr):
        np.testing.assert_allclose(toolpath.rotations[1], truth, atol=1e-12)
        np.testing.assert_allclose(toolpath.axes[1], -truth @ tool_axis, atol=1e-12)


def test_quaternions_are_scalar_first(fixtures):
    toolpath = read(fixtures / "poses_quaternion.csv")
    rows = (fixtures / "poses_quaternion.csv").read_text().splitlines()[1:]
    q_wxyz = np.array([[float(v) for v in row.split(",")[3:]] for row in rows])
    truth = Rotation.from_quat(q_wxyz[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(toolpath.rotations, truth, atol=1e-12)
    np.testing.assert_allclose(toolpath.axes, -truth[:, :, 0], atol=1e-12)


def test_normals_come_from_the_surface_where_there_is_one(fixtures):
    with pytest.raises(ReadError) as caught:
        read(fixtures / "points_only.csv")
    assert caught.value.code == "CSV020"
    assert "mesh" in caught.value.hint
    seen = []

    def surface(points):
        seen.append(points)
        return np.tile([0.0, 0.6, 0.8], (len(points), 1))

    toolpath = read(fixtures / "points_only.csv", options=ReadOptions(surface_normals=surface))
    np.testing.assert_allclose(seen[0] * 1e3, [(0.5, 1.5, 2.5), (3.5, 4.5, 5.5)])
    np.testing.assert_allclose(toolpath.axes, [(0, 0.6, 0.8)] * 2)


def test_points_of_another_frame_are_warned_about(fixtures):
    toolpath = read(fixtures / "points_far.csv")
    (finding,) = toolpath.warnings
    assert finding.code == "CSV110"
    assert "frame" in finding.message
    np.testing.assert_allclose(toolpath.points[0] * 1e3, [76802.2963, 1025416.557, 148])


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1e-3), ("inch", 0.0254), ("m", 1.0)])
def test_units_option(read_text, unit, factor):
    toolpath = read_text("1,2,3,0,0,1\n", "p.csv", units=unit)
    np.testing.assert_allclose(toolpath.points[0], np.array([1, 2, 3]) * factor)
    assert toolpath.units == unit


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("X", "x"), ("MX Coord.", "x"), ("Pos X", "x"), ("X-Koordinate", "x"), ("x_mm", "x"),
        ("X [mm]", "x"), ("Coord. Y", "y"), ("Z (inch)", "z"), ("Normal Z", "k"), ("nx", "i"),
        ("Axis_J", "j"), ("A", "a"), ("B [deg]", "b"), ("Rx", "roll"), ("W", "roll"),
        ("Yaw (rad)", "yaw"), ("qw", "qw"), ("Hole ID", "id"), ("Point name", "id"),
        ("Element Name", "id"), ("Depth", "depth"), ("Hole Depth [mm]", "depth"),
        ("Dia.", "diameter"), ("Feed rate", "feed"), ("Vorschub [mm/min]", "feed"),
        ("Operation", "operation"),
        ("X LOC", "x"), ("Dir Z", "k"), ("Vector_X", "i"),
        ("Number", ""), ("Deviation", ""), ("", ""), ("x2", ""),
    ],
)  # fmt: skip
def test_column_names(name, role):
    assert column_of(name).role == role


def test_header_units_need_not_be_the_same(read_text):
    toolpath = read_text("X (m);Y [mm];Z in;I;J;K;Feed [m/s]\n1;2;3;0;0;1;0.5\n", "a.csv")
    np.testing.assert_allclose(toolpath.points[0], [1.0, 0.002, 3 * 0.0254])
    assert toolpath.feed[0] == 0.5


def test_columns_option_overrides_the_header(read_text):
    text = "p,q,r,s,t,u,v\n9,1,2,3,0,0,1\n"
    toolpath = read_text(text, "a.csv", format="csv", columns="-,x,y,z,i,j,k")
    np.testing.assert_allclose(toolpath.points[0] * 1e3, [1, 2, 3])


def test_large_files_cross_block_borders(read_text, monkeypatch):
    rows = [(i * 0.5, -i * 0.25, 7.0 + i % 3, 0, 0.6, 0.8) for i in range(500)]
    text = "x,y,z,i,j,k\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)
    whole = read_text(text, "a.csv")
    monkeypatch.setattr("postproc.readers.text.blocks.BLOCK_BYTES", 97)
    parts = read_text(text, "b.csv")
    np.testing.assert_array_equal(whole.points, parts.points)
    np.testing.assert_array_equal(whole.line, parts.line)
    assert all(b - a == 1 for a, b in pairwise(parts.line.tolist()))


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_line_ends_and_a_byte_order_mark(fixtures, read_text, ending):
    text = (fixtures / "holes_header.csv").read_text().replace("\n", ending)
    toolpath = read_text(b"\xef\xbb\xbf" + text.encode(), "a.csv")
    np.testing.assert_allclose(toolpath.points, POINTS, atol=1e-12)


def test_recover_takes_what_has_one_meaning(read_text):
    text = "x,y,z,i,j,k,depth\n1,2,3,0,0,1,-5\n,4,3,0,0,1.2,5\n5,5,5,0,0,1,5\n"
    toolpath = read_text(text, "a.csv", recover=True)
    np.testing.assert_allclose(toolpath.points[1] * 1e3, [1, 4, 3])
    assert {finding.code for finding in toolpath.recovered} == {"CSV005", "CSV022", "CSV030"}
    assert [c.depth for c in toolpath.cycles] == [0.005]


def test_points_of_robodk_with_a_speed_that_may_stay_as_it_was(read_text):
    toolpath = read_text(
        "-98,-99.02,0,\n-98,-99.02,10,50\n-90,-99.02,10,\n", "p.csv", points_only=True
    )
    np.testing.assert_allclose(toolpath.points[2] * 1e3, [-90.0, -99.02, 10.0])
    np.testing.assert_allclose(toolpath.feed * 1e3, [np.nan, 50.0, 50.0])
    assert any(w.code == "CSV122" for w in toolpath.warnings)


def test_four_numbers_without_a_header_and_without_gaps_are_not_guessed(read_text):
    with pytest.raises(ReadError, match="CSV013"):
        read_text("1,2,3,50\n4,5,6,60\n", name="p.csv")


@pytest.mark.parametrize(
    "header",
    [
        "Name,X,Y,Z,U95X,U95Y,U95Z,{}",
        "Target,X,Y,Z,Ux,Uy,Uz,{}",
        "Name,X,Y,Z,Ux (95%),Uy (95%),Uz (95%),{}",
        "Name,X,Y,Z,U(95) X,U(95) Y,U(95) Z,{}",
        "Fastener,X,Y,Z,U(X),U(Y),U(Z),{}",
        "Hole,X,Y,Z,X (U95),Y (U95),Z (U95),{}",
        "name,x,y,z,sigma_x,sigma_y,sigma_z,{}",
        "Rivet,X [mm],Y [mm],Z [mm],X Uncertainty,Y Uncertainty,Z Uncertainty,{}",
    ],
)
@pytest.mark.parametrize("normal", [True, False])
def test_uncertainties_of_trackers_are_no_axes(header, normal, read_text):
    more, values = ("i,j,k", "0,0.6,0.8") if normal else ("U(95)", "0.05")
    text = (
        f"{header.format(more)}\nF1,1,2,3,0.02,0.02,0.03,{values}\nF2,9,2,3,0.01,0,0.1,{values}\n"
    )
    toolpath = read_text(text, name="p.csv", points_only=not normal)
    np.testing.assert_allclose(toolpath.points * 1e3, [[1, 2, 3], [9, 2, 3]])
    assert list(toolpath.names) == ["F1", "F2"]
    if normal:
        np.testing.assert_allclose(toolpath.axes, [[0, 0.6, 0.8]] * 2)
    else:
        assert np.isnan(toolpath.axes).all()


def test_unit_vectors_called_ux_are_axes(read_text):
    toolpath = read_text("X,Y,Z,Ux,Uy,Uz\n1,2,3,0,0.6,0.8\n", name="p.csv")
    np.testing.assert_allclose(toolpath.axes, [[0, 0.6, 0.8]])


def test_sizes_of_holes_have_no_sign(tmp_path):
    wrong = []
    for role in ("depth", "clearance", "retract", "peck", "dwell", "diameter"):
        path = tmp_path / f"{role}.csv"
        path.write_text(
            "x,y,z,i,j,k,depth\n1,2,3,0,0,1,-5\n"
            if role == "depth"
            else f"x,y,z,i,j,k,depth,{role}\n1,2,3,0,0,1,5,-2\n"
        )
        try:
            read(path)
            wrong.append(f"{role}: read")
        except ReadError as error:
            if "CSV030" not in str(error) or f"a {role} of -" not in str(error):
                wrong.append(f"{role}: {error}")
    assert not wrong


def test_rows_in_front_of_the_first_depth_are_said_to_be_no_holes(tmp_path):
    said = {}
    for depths in ("--5", "----"):
        path = tmp_path / "holes.csv"
        rows = (f"{i},0,0,0,0,1,{d.strip('-')}\n" for i, d in enumerate(depths))
        path.write_text("x,y,z,i,j,k,depth\n" + "".join(rows))
        told = " ".join(w.message for w in read(path).warnings if w.code == "CSV121")
        said[depths] = [n for n in ("2 empty", "4 empty", "no hole") if n in told]
    assert said == {"--5": ["2 empty", "no hole"], "----": ["4 empty", "no hole"]}
    path.write_text("x,y,z,i,j,k,depth\n0,0,0,0,0,1,5\n9,0,0,0,0,1,\n")
    with pytest.raises(ReadError, match=r"CSV123.*1 rows behind a hole"):
        read(path)
