"""The built-in robots: complete, consistent, every number with its origin."""

import tomllib
from importlib.resources import files

import numpy as np
import pytest

from postproc.cell.cell import Provenance
from postproc.cell.file import load_cell
from postproc.cell.robotfile import (
    LENGTHS,
    find_robot,
    load_robot,
    missing_numbers,
    robot_names,
    robot_notes,
    robot_title,
)
from postproc.errors import CellError
from postproc.units import DEG, MM
from tests.arms import DETAILED, table_rows

REACH_MM = {
    "kuka_kr500_r2830": 2826.5, "kuka_kr500_r2800_2": 2800.3, "kuka_kr360_r2830": 2826.5,
    "kuka_kr600_r2830": 2826.5, "kuka_kr240_r2900_2": 2905.4, "kuka_kr210_r2700_2": 2705.4,
    "kuka_kr6_r900_sixx": 901.5, "kuka_kr6_r900_2": 900.7,
}  # fmt: skip
"""Published reach, rounded to 0.1 mm."""


def test_an_arm_is_read_alone_as_it_stands_in_the_whole_file():
    whole = tomllib.loads((files("postproc.cell") / "robots.toml").read_text(encoding="utf-8"))
    assert robot_names() == tuple(whole["arms"])
    for name, row in whole["arms"].items():
        assert robot_title(name) == row["title"]
        assert robot_notes(name).note == row.get("note", "")
        assert load_robot(name).geometry.c2 == pytest.approx(row["lengths_mm"][4] * MM, abs=1e-12)


def test_all_promised_robots_are_there():
    assert set(DETAILED) <= set(robot_names())
    assert len(robot_names()) >= 150


def test_lengths_limits_and_speeds_are_those_of_the_table():
    rows = table_rows()
    assert {row["id"] for row in rows} == set(robot_names())
    for row in rows:
        robot = load_robot(row["id"])
        lengths = [getattr(robot.geometry, key) / MM for key in LENGTHS]
        np.testing.assert_allclose(lengths, [float(row[key]) for key in LENGTHS], atol=1e-9)
        for found, end in ((robot.q_min, "min"), (robot.q_max, "max")):
            wanted = [float(row[f"A{axis}{end}"] or "nan") for axis in range(1, 7)]
            np.testing.assert_allclose(found / DEG, wanted, atol=1e-9)
        if row["id"] not in DETAILED:
            wanted = [float(row[f"v{axis}"] or "nan") for axis in range(1, 7)]
            np.testing.assert_allclose(robot.qd_max / DEG, wanted, atol=1e-9)
        assert robot.origins["geometry"].trust == row["trust"]
        assert ("q_min" in robot.origins) == bool(row["A1min"])


def test_what_no_source_gives_is_unknown_and_asked_for(tmp_path):
    text = 'schema = "postproc.cell/1"\n[robot]\nmodel = "{}"\n{}'
    speeds = "speed_deg_s = [100, 100, 100, 100, 100, 100]\n"
    limits = f"limits_deg = {[[-90, 90]] * 6}\n"
    for model, keys, asked in (
        ("KR 16-3", "", "speed_deg_s"),
        ("KR 16-3", speeds, None),
        ("KR 45-2", speeds, "limits_deg"),
        ("KR 420 R3080", speeds, "limits_deg"),
        ("KR 420 R3080", speeds + limits, None),
    ):
        path = tmp_path / "cell.toml"
        path.write_text(text.format(model, keys))
        problem = missing_numbers(load_cell(path))
        assert (problem is None) == (asked is None)
        assert asked is None or f"[robot] {asked} is needed" in problem.message


@pytest.mark.parametrize(
    ("spelling", "name"),
    [
        ("KR 210 R2700-2", "kuka_kr210_r2700_2"),
        ("kr210r2700_2", "kuka_kr210_r2700_2"),
        ("KUKA KR QUANTEC KR 210 R2700-2", None),
        ("KUKA KR210 R2700-2", "kuka_kr210_r2700_2"),
        ("#KR210R2700_2 C4 FLR", "kuka_kr210_r2700_2"),
        ("#KR210R2700 PRIME C4 FLR", "kuka_kr210_r2700_prime"),
        ("#KR6R900 C4SR FLR 230", "kuka_kr6_r900_sixx"),
        ("#KR125_3_TJ G C2 FLR ZH05", "kuka_kr125_3"),
        ("#KR16_2 C2 FLR", "kuka_kr16_2"),
        ("kr 500 r2830", "kuka_kr500_r2830"),
        ("KR 500-3", "kuka_kr500_3"),
        ("KR 210 R2700", None),
        ("KR 16", None),
        ("#KR6R900 C4SR", None),
        ("", None),
        ("ABB", None),
    ],
)
def test_arms_are_found_by_any_usual_spelling(spelling, name):
    if name is None:
        with pytest.raises(CellError, match="CEL010"):
            find_robot(spelling)
    else:
        assert find_robot(spelling) == name


def test_every_title_and_trafoname_finds_its_own_arm():
    for name in robot_names():
        assert find_robot(robot_title(name).split(" (")[0]) == name
        known = robot_notes(name).trafoname
        assert not known or find_robot(known) == name


@pytest.mark.parametrize("name", sorted(DETAILED))
def test_reach_is_the_published_one(name):
    g = load_robot(name).geometry
    assert (g.a1 + g.c2 + np.hypot(g.c3, g.a2)) / MM == pytest.approx(REACH_MM[name], abs=0.06)


@pytest.mark.parametrize("name", sorted(DETAILED))
def test_every_number_has_an_origin_with_a_source(name):
    robot = load_robot(name)
    fields = ("geometry", "q_min", "q_max", "qd_max", "qdd_max", "payload", "link_mass", "link_com")
    for field in fields:
        assert robot.origins[field].source
    assert ("repeatability" in robot.origins) == np.isfinite(robot.repeatability)
    assert ("joint_stiffness" in robot.origins) == (robot.joint_stiffness is not None)
    assert (robot.q_min < robot.q_max).all()
    assert (robot.qd_max > 0.0).all()
    assert (robot.qdd_max > 0.0).all()
    assert robot_title(name).startswith("KUKA KR ")


def test_unpublished_speeds_of_the_kr500_are_marked_assumed():
    origins = load_robot("kuka_kr500_r2830").origins
    kinds = [origins[f"qd_max.A{axis}"].provenance for axis in range(1, 7)]
    assert kinds == [Provenance.PUBLISHED] * 3 + [Provenance.ASSUMED] * 3
    assert origins["qd_max"].provenance is Provenance.ASSUMED
    assert origins["qdd_max"].provenance is Provenance.ASSUMED
    assert origins["geometry"].provenance is Provenance.PUBLISHED


def test_limits_of_the_kr500():
    robot = load_robot("kuka_kr500_r2830")
    np.testing.assert_allclose(robot.q_min / DEG, [-185, -130, -100, -350, -120, -350])
    np.testing.assert_allclose(robot.q_max / DEG, [185, 20, 144, 350, 120, 350])
    np.testing.assert_allclose(robot.geometry.a2 / MM, 55.0)


def test_unknown_name_is_refused_and_all_are_listed():
    with pytest.raises(CellError, match=r"CEL010.*kuka_kr600_r2830") as caught:
        load_robot("kuka_kr600_r2380")
    assert "postproc robots" in caught.value.hint


@pytest.mark.parametrize("name", sorted(DETAILED))
def test_link_masses_lie_inside_the_arm(name):
    robot = load_robot(name)
    reach = REACH_MM[name] * MM
    assert robot.payload < robot.link_mass.sum() < 6.0 * max(robot.payload, 10.0)
    assert (np.abs(robot.link_com) < reach / 2.0).all()
    assert (np.abs(robot.link_com[:, 1]) < 0.12 * reach).all()
