"""The built-in robots: complete, consistent, every number with its origin."""

import numpy as np
import pytest

from postproc.cell.cell import Provenance
from postproc.cell.robotfile import load_robot, nearest_robot, robot_names, robot_title
from postproc.errors import CellError
from postproc.units import DEG, MM

NAMES = {
    "kuka_kr500_r2830", "kuka_kr500_r2800_2", "kuka_kr360_r2830", "kuka_kr600_r2830",
    "kuka_kr240_r2900_2", "kuka_kr210_r2700_2", "kuka_kr6_r900_sixx", "kuka_kr6_r900_2",
}  # fmt: skip
REACH_MM = {
    "kuka_kr500_r2830": 2826.5, "kuka_kr500_r2800_2": 2800.3, "kuka_kr360_r2830": 2826.5,
    "kuka_kr600_r2830": 2826.5, "kuka_kr240_r2900_2": 2905.4, "kuka_kr210_r2700_2": 2705.4,
    "kuka_kr6_r900_sixx": 901.5, "kuka_kr6_r900_2": 900.7,
}  # fmt: skip
"""Published reach, rounded to 0.1 mm."""


def test_all_promised_robots_are_there():
    assert set(robot_names()) == NAMES


@pytest.mark.parametrize("name", sorted(NAMES))
def test_reach_is_the_published_one(name):
    g = load_robot(name).geometry
    assert (g.a1 + g.c2 + np.hypot(g.c3, g.a2)) / MM == pytest.approx(REACH_MM[name], abs=0.06)


@pytest.mark.parametrize("name", sorted(NAMES))
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


@pytest.mark.parametrize(
    ("asked", "nearest"),
    [("KUKA KR500-R2830", "kuka_kr500_r2830"), ("kr210", "kuka_kr210_r2700_2"), ("", None)],
)
def test_nearest_name(asked, nearest):
    assert nearest_robot(asked) in NAMES
    assert nearest is None or nearest_robot(asked) == nearest


def test_unknown_name_is_refused_and_all_are_listed():
    with pytest.raises(CellError, match=r"CEL010.*kuka_kr600_r2830") as caught:
        load_robot("kuka_kr600_r2380")
    assert all(name in caught.value.hint for name in NAMES)


@pytest.mark.parametrize("name", sorted(NAMES))
def test_link_masses_lie_inside_the_arm(name):
    robot = load_robot(name)
    reach = REACH_MM[name] * MM
    assert robot.payload < robot.link_mass.sum() < 6.0 * max(robot.payload, 10.0)
    assert (np.abs(robot.link_com) < reach / 2.0).all()
    assert (np.abs(robot.link_com[:, 1]) < 0.12 * reach).all()
