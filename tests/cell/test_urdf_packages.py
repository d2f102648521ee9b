"""Arms of ROS packages: macros expanded, flanges never guessed, poses as published."""

import csv

import numpy as np
import pytest

from postproc.cell import expanded, find_urdf, load_cell, load_robot, read_urdf_robot
from postproc.cli import app
from postproc.errors import CellError
from postproc.kinematics import build
from postproc.kinematics.build import load_chain
from postproc.units import DEG, MM
from tests.places import SHARED

REAL = SHARED / "real" / "urdf"


@pytest.fixture(autouse=True)
def _needs_the_packages():
    if not REAL.is_dir():
        pytest.skip("the packages are not beside the checkout")


def rows():
    lines = (REAL / "EXPECTED_fk.tsv").read_text().splitlines()
    return list(csv.DictReader((x for x in lines if not x.startswith("#")), delimiter="\t"))


def test_forward_kinematics_as_published():
    assert len(rows()) > 25
    for row in rows():
        arm = load_chain(REAL / row["file"], row["tip"])
        q = np.array([float(row[f"q{i}_deg"]) for i in range(1, 7)]) * DEG
        T = arm.fk(q)
        p = [float(row[f"{key}_mm"]) for key in "xyz"]
        R = [[float(row[f"r{i}{j}"]) for j in (1, 2, 3)] for i in (1, 2, 3)]
        np.testing.assert_allclose(T[:3, 3] / MM, p, atol=1e-4, err_msg=row["file"])
        np.testing.assert_allclose(T[:3, :3], R, atol=1e-5, err_msg=row["file"])


@pytest.mark.parametrize(
    ("file", "name", "tolerance_mm"),
    [
        ("expanded/kr210_r2700_2.urdf", "kuka_kr210_r2700_2", 1e-9),
        ("expanded/kr6_r900_sixx.urdf", "kuka_kr6_r900_sixx", 1e-9),
        ("expanded/kr500_r2800_2.urdf", "kuka_kr500_r2800_2", 1e-9),
        ("expanded/kr120_r2700_2.urdf", "kuka_kr120_r2700_2", 0.04),  # rounded rpy in the file
        ("ros_industrial/kuka_kr16_support/urdf/kr16_2.urdf", "kuka_kr16_2", 1e-9),
    ],
)
def test_built_in_arms_equal_the_packages(file, name, tolerance_mm):
    q = np.random.default_rng(8).uniform(-np.pi, np.pi, (1000, 6))
    T = build(read_urdf_robot(REAL / file, "tool0")).fk(q)
    own = build(load_robot(name)).fk(q)
    assert np.abs(T - own)[:, :3, 3].max() / MM < tolerance_mm
    assert np.abs(T - own)[:, :3, :3].max() < 1e-4


@pytest.mark.parametrize("path", ["expanded/kr210_r2700_2.urdf", "expanded/kr6_r900_sixx.urdf"])
def test_two_flanges_that_differ_are_never_chosen_between(path):
    with pytest.raises(CellError) as caught:
        read_urdf_robot(REAL / path)
    assert caught.value.code == "CEL032"
    assert "flange" in caught.value.message
    assert "tool0" in caught.value.message


@pytest.mark.parametrize(
    ("package", "plain", "base"),
    [
        ("kuka_quantec_support", "kr210_r2700_2.urdf", "world"),
        ("kuka_agilus_support", "kr6_r900_sixx.urdf", "world"),
    ],
)
def test_macros_are_expanded(package, plain, base, tmp_path):
    text = expanded(find_urdf(REAL / "xacro" / package), tmp_path)
    (tmp_path / "arm.urdf").write_bytes(text)
    ours, theirs = tmp_path / "arm.urdf", REAL / "expanded" / plain
    q = np.random.default_rng(3).uniform(-3.0, 3.0, (100, 6))
    arms = [read_urdf_robot(path, "tool0") for path in (ours, theirs)]
    np.testing.assert_allclose(build(arms[0]).fk(q), build(arms[1]).fk(q), atol=1e-12)
    np.testing.assert_allclose(arms[0].q_max, arms[1].q_max, atol=1e-12)
    assert base.encode() in text


def run(*arguments):
    return app.run([str(argument) for argument in arguments])


def test_a_cell_of_a_package(tmp_path, capsys):
    package = REAL / "xacro" / "kuka_quantec_support"
    cell = tmp_path / "cell.toml"
    assert run("new-cell", "--urdf", package, "-o", cell) == 2
    assert "error CEL032" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert run("new-cell", "--urdf", package, "--tip", "tool0", "-o", cell) == 0
    robot = load_cell(cell).robot
    assert robot.geometry.tip == "tool0"
    assert robot.geometry.path.name == "kr210_r2700_2.urdf"
    assert run("new-cell", "--urdf", package, "--tip", "tool0", "-o", cell, "--force") == 0


def test_meshes_of_a_package_are_found_from_the_new_place(tmp_path):
    package = tmp_path / "my_arm"
    (package / "meshes").mkdir(parents=True)
    (package / "meshes" / "a.stl").write_bytes(b"solid\nendsolid\n")
    text = (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">'
        '<xacro:property name="n" value="a"/><link name="l"><collision><geometry>'
        '<mesh filename="package://my_arm/meshes/${n}.stl"/></geometry></collision></link></robot>'
    )
    (package / "urdf").mkdir()
    (package / "urdf" / "r.xacro").write_text(text)
    made = expanded(package / "urdf" / "r.xacro", tmp_path / "cells").decode()
    assert 'filename="../my_arm/meshes/a.stl"' in made


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "xacro: "),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:none/></robot>', "xacro: "),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
            '<xacro:include filename="$(find no_such_package)/x.xacro"/></robot>',
            "no_such_package",
        ),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><a b="${1/0}"/></robot>',
            "xacro: ",
        ),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><a b="${open(1)}"/></robot>',
            "xacro: ",
        ),
    ],
)
def test_broken_macros_are_one_line(text, words, tmp_path, capsys):
    (tmp_path / "arm.xacro").write_text(text)
    assert run("new-cell", "--urdf", tmp_path / "arm.xacro", "-o", tmp_path / "cell.toml") == 2
    err = capsys.readouterr().err
    assert f"{tmp_path / 'arm.xacro'}:1: error CEL011: " in err
    assert words in err
    assert not (tmp_path / "cell.toml").exists()


def test_folders_without_or_with_several_robots(tmp_path):
    with pytest.raises(CellError, match=r"no \.urdf file"):
        find_urdf(tmp_path)
    with pytest.raises(CellError, match="2 robots"):
        find_urdf(REAL / "xacro")


@pytest.mark.parametrize(("name", "against"), [("kr210_r3100_ultra", "A1"), ("kr210_r2700_2", "")])
def test_axes_that_turn_against_kukas_sense_are_told(name, against, tmp_path, capsys):
    cell, urdf = tmp_path / "cell.toml", tmp_path / "arm.urdf"
    text = (REAL / "expanded" / f"{name}.urdf").read_text()
    urdf.write_text(text.replace(f'name="{name}"', 'name="my_arm"'))
    assert run("new-cell", "--urdf", urdf, "--tip", "tool0", "-o", cell) == 0
    run("check", cell)
    err = capsys.readouterr().err
    assert ("CEL143" in err) == bool(against)
    assert not against or f"{against} of this URDF" in err
