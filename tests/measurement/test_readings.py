"""Readings of any form: what the file says, what a point would read, and its slopes."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.cell import Instrument
from postproc.errors import DataError
from postproc.measurement import only_points, read_campaign, readings_of
from postproc.measurement.file import read_measurements

Q = "10,-60,90,0,45,180"
HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"


def write(folder, header, rows, name="meas.csv"):
    path = folder / name
    lines = [f"{HEAD},{header}", *(f"{Q},{row}" for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def of_points(folder, points, sigma=None):
    """Return a file in which each point is read in every form, and the readings."""
    rng = np.random.default_rng(5)
    way = np.round(rng.normal(size=points.shape), 4)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    post, far = np.array([2.0, -1.0, 0.5]), np.array([-0.5, 1.2, 2.0])
    header = "x_mm,y_mm,z_mm,u_mm,ux,uy,uz,length_mm,from_x_mm,from_y_mm,from_z_mm,from_id,plane"
    rows = []
    for k, (p, w) in enumerate(zip(1e3 * points, way, strict=True)):
        cells = [""] * 13
        form = k % 5
        if form in (0, 4):
            cells[:3] = [repr(float(v)) for v in p]
        if form == 1:
            cells[0], cells[1] = repr(float(p[0])), repr(float(p[1]))
        if form in (2, 4):
            cells[3:7] = [repr(float(p @ w)), *(repr(float(v)) for v in w)]
        if form == 3 and k % 2:
            cells[7:11] = [repr(float(np.linalg.norm(p - 1e3 * post))), "2000", "-1000", "500"]
        if form == 3 and not k % 2:
            cells[7], cells[11] = repr(float(np.linalg.norm(p - 1e3 * far))), "far"
        rows.append(",".join(cells))
    return readings_of(read_measurements(write(folder, header, rows)), sigma=sigma), far


def test_points_that_are_true_read_what_was_read(tmp_path):
    points = np.random.default_rng(1).uniform(-1, 1, (60, 3))
    readings, far = of_points(tmp_path, points)
    assert np.bincount(readings.row, minlength=60).tolist() == [3, 2, 1, 1, 4] * 12
    x = readings.start(points)
    assert [name for _, name in readings.names] == ["far"]
    np.testing.assert_allclose(x, far, atol=1e-9)
    np.testing.assert_allclose(readings.misfit(points, x), 0.0, atol=1e-12)
    assert np.isnan(readings.sigma).all()


def test_slopes_are_those_of_differences(tmp_path):
    rng = np.random.default_rng(2)
    points = rng.uniform(-1, 1, (40, 3))
    readings, _ = of_points(tmp_path, points, 2e-5)
    rows = [f"{p[0]},{p[1]},{p[2]},face{k % 2}" for k, p in enumerate(1e3 * points)]
    touched = readings_of(read_measurements(write(tmp_path, "x_mm,y_mm,z_mm,plane", rows)))
    for some in (readings, touched):
        x = some.start(points) + rng.normal(0, 0.1, some.size)
        moved = rng.normal(0, 1e-6, points.shape)
        change = some.misfit(points + moved, x) - some.misfit(points - moved, x)
        np.testing.assert_allclose(
            np.einsum("mi,mi->m", some.slopes(points, x), 2.0 * moved[some.row]), change, atol=1e-11
        )
        for k in range(some.size):
            step = 1e-6 * np.eye(some.size)[k]
            change = (some.misfit(points, x + step) - some.misfit(points, x - step)) / 2e-6
            np.testing.assert_allclose(some.unknown_slopes(points, x)[:, k], change, atol=1e-7)


def test_a_plane_that_was_touched_is_found(tmp_path):
    """The floor, through the origin; and one that is tilted."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (30, 3))
    points[:15, 2] = 0.0
    points[15:, 0] = 0.3 + 0.2 * points[15:, 1]
    rows = [",".join(["floor"] if k < 15 else ["wall"]) for k in range(30)]
    readings = readings_of(read_measurements(write(tmp_path, "plane", rows)))
    x = readings.start(points)
    np.testing.assert_allclose(readings.misfit(points, x), 0.0, atol=1e-12)
    floor = x[:4] / np.linalg.norm(x[:3])
    np.testing.assert_allclose(np.abs(floor), [0, 0, 1, 0], atol=1e-12)


def test_a_tracker_errs_along_its_beam_otherwise_than_across(tmp_path):
    """The sum of squared residuals is the Mahalanobis distance by the covariance itself."""
    rng = np.random.default_rng(4)
    points, off = rng.uniform(1, 3, (8, 3)), rng.normal(0, 1e-5, (8, 3))
    rows = [",".join(repr(float(v)) for v in p) for p in 1e3 * points]
    stands = np.array([0.2, -0.3, 0.1])
    device = Instrument(range_sigma=1e-5, range_rate=2e-6, angle_sigma=6e-6, stands=stands)
    readings = readings_of(read_measurements(write(tmp_path, "x_mm,y_mm,z_mm", rows)), device)
    residual = readings.misfit(points + off) / readings.sigma
    for k, (p, e) in enumerate(zip(points, off, strict=True)):
        away = np.linalg.norm(p - stands)
        beam = np.outer(p - stands, p - stands) / away**2
        C = (1e-5 + 2e-6 * away) ** 2 * beam + (6e-6 * away) ** 2 * (np.eye(3) - beam)
        expected = e @ np.linalg.solve(C, e)
        assert np.sum(residual[readings.row == k] ** 2) == pytest.approx(expected, rel=1e-6)


def test_sigmas_come_from_the_row_before_the_device(tmp_path):
    header = "x_mm,y_mm,z_mm,sx_mm,sy_mm,sz_mm"
    rows = ["1000,2000,500,0.01,0.02,0.03", "1000,2000,500,,,", "1000,,500,0.01,,0.03"]
    told = readings_of(read_measurements(write(tmp_path, header, rows)), None, 4e-5)
    np.testing.assert_allclose(1e3 * told.sigma, [0.01, 0.02, 0.03, *[0.04] * 3, 0.01, 0.03])


@pytest.mark.parametrize(
    ("header", "row", "code", "line"),
    [
        ("x_mm,y_mm,z_mm", ",,", "MEA007", 3),
        ("u_mm,ux,uy,uz", "5,,,", "MEA010", 3),
        ("u_mm,ux,uy,uz", "5,0,0,0", "MEA010", 3),
        ("u_mm,ux,uy,uz", "5,1,,0", "MEA010", 3),
        ("length_mm,from_id", "5,", "MEA010", 3),
        ("length_mm,from_id", "-5,post", "MEA008", 3),
        ("length_mm,from_x_mm,from_y_mm,from_z_mm,from_id", "5,1,,2,post", "MEA010", 3),
        ("x_mm,y_mm,z_mm,sx_mm", "5,6,7,0", "MEA008", 3),
        ("x_mm,y_mm,z_mm,u_mm", "5,6,inf,", "MEA007", 3),
    ],
)
def test_a_reading_that_lacks_something_is_refused(tmp_path, header, row, code, line):
    good = {"u_mm": "5,0,0,1", "plane": "a", "x_mm": "1,2,3"}
    first = good.get(header.split(",")[0], "900,1,2,3,post" if "from_x" in header else "900,post")
    first += "," * (header.count(",") - first.count(","))
    first = first[:-1] + ",0.1" if header.endswith("sx_mm") else first
    with pytest.raises(DataError) as caught:
        read_measurements(write(tmp_path, header, [first, row]))
    assert (caught.value.code, caught.value.source.line) == (code, line)


def test_temperatures_may_be_missing(tmp_path):
    """A quarter and more lie between the rows around, in time; most of them: not logged."""
    rows = ["1,2,3,0,20", "1,2,3,30,", "1,2,3,10,", "1,2,3,40,24"]
    found = read_measurements(write(tmp_path, "x_mm,y_mm,z_mm,time_s,temp_C", rows))
    np.testing.assert_allclose(found.temperature, [20.0, 23.0, 21.0, 24.0])
    assert [(r.kind, r.ids) for r in found.remarks] == [("blank", ("2", "3"))]
    rows[3] = "1,2,3,40,"
    found = read_measurements(write(tmp_path, "x_mm,y_mm,z_mm,time_s,temp_C", rows))
    assert found.temperature is None
    assert "not used" in found.remarks[0].text


def test_tools_and_fixtures_are_names(tmp_path):
    rows = ["1,2,3,1,A,250.5", "1,2,3,2,B,"]
    first = write(tmp_path, "x_mm,y_mm,z_mm,tool_no,fixture,e1_mm", rows)
    second = write(tmp_path, "x_mm,y_mm,z_mm,length_mm,from_id", ["1,2,3,,", ",,,5,p"], "b.csv")
    found = read_campaign([first, second])
    assert found.extra["tool_no"] == ("1", "2", "", "")
    assert found.extra["fixture"] == ("A", "B", "", "")
    np.testing.assert_array_equal(found.extra["e1_mm"], [250.5, np.nan, np.nan, np.nan])
    assert found.from_id == ("", "", "", "p")
    np.testing.assert_array_equal(np.isfinite(found.position[:, 0]), [True] * 3 + [False])


def test_points_are_asked_for_where_they_are_needed(tmp_path):
    whole = ["1,2,3,"] * 9
    few = read_measurements(write(tmp_path, "x_mm,y_mm,z_mm,plane", [*whole, ",,,a"]))
    assert len(only_points(few)) == 9
    assert only_points(few).remarks[-1].ids == ("10",)
    many = read_measurements(write(tmp_path, "x_mm,y_mm,z_mm,plane", [*whole[:3], *[",,,a"] * 3]))
    with pytest.raises(DataError, match="3 of 6 rows lack") as caught:
        only_points(many)
    assert caught.value.code == "MEA013"
    assert caught.value.source.line == 5
