"""Outlines of arms: which body an arm gets, and that checks say where it is another one's."""

import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import load_cell, load_robot
from postproc.cli import app
from postproc.collision import Scene
from postproc.collision.outlines import is_measured, upright_solids
from postproc.kinematics import build
from tests.cells import cell_text


def sizes(robot):
    solids = upright_solids(robot, robot.geometry)
    return np.array([np.ptp(np.vstack([m.vertices for m in link]), axis=0) for link in solids])


@pytest.mark.parametrize(
    ("name", "twin", "is_own"),
    [
        ("kuka_kr600_r2830", "kuka_kr600_r2830", True),
        ("kuka_kr500_r2830", "kuka_kr600_r2830", True),
        ("kuka_kr500_3", "kuka_kr600_r2830", True),
        ("kuka_kr1000_titan", None, False),
        ("kuka_kr420_r3330", None, False),  # as long as one that carries 240 kg alone
    ],
)
def test_arms_of_the_same_castings_share_an_outline(name, twin, is_own):
    robot = load_robot(name)
    assert is_measured(robot) == is_own
    if twin is not None:
        np.testing.assert_allclose(sizes(robot), sizes(load_robot(twin)), atol=1e-9)
    heavier = replace(robot, name="own", payload=2000.0)
    assert not is_measured(heavier)


@pytest.mark.parametrize(("name", "told"), [("kuka_kr500_r2830", 0), ("kuka_kr1000_titan", 1)])
def test_check_says_where_an_outline_is_that_of_a_size(name, told, tmp_path, capsys):
    speeds = f'model = "{name}"\nspeed_deg_s = {[50] * 6}\n'
    text = cell_text(robot=name).replace(f'model = "{name}"\n', speeds)
    (tmp_path / "cell.toml").write_text(text)
    app.run(["check", str(tmp_path / "cell.toml"), "--json"])
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert [f["code"] for f in findings].count("CEL144") == told


@pytest.mark.parametrize(
    ("name", "solids", "told"),
    [
        ("kuka_kr500_r2830", "outline", 0),
        ("kuka_kr6_r900_sixx", "outline", 1),
        ("kuka_kr6_r900_sixx", "simple", 0),
    ],
)
def test_check_names_the_pair_that_light_arms_leave_out(name, solids, told, tmp_path, capsys):
    speeds = f'model = "{name}"\nspeed_deg_s = {[50] * 6}\nsolids = "{solids}"\n'
    text = cell_text(robot=name).replace(f'model = "{name}"\n', speeds)
    (tmp_path / "cell.toml").write_text(text)
    cell = load_cell(tmp_path / "cell.toml")
    pairs = Scene.build(cell, build(cell.robot)).pairs
    assert (("link 0", "link 2") in pairs) == (solids == "simple")
    app.run(["check", str(tmp_path / "cell.toml"), "--json"])
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert [f["code"] for f in findings].count("CEL145") == told
