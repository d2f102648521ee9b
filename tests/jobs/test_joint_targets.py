"""DELMIA targets by joint angles: placed where other targets prove whose angles they are."""

import json

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cell.robotfile import load_robot
from postproc.cli import app
from postproc.geometry.frames import abc_from_rotation, rotation_from_abc, transform
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.kinematics import build
from postproc.units import DEG, MM

T_FLANGE_TCP = transform(np.eye(3), np.array([107.0, 0.0, 362.0]) * MM)
JOINTS = np.array(
    [
        [5.0, -80.0, 95.0, 10.0, 50.0, 15.0],
        [0.0, -78.0, 92.0, 14.0, 46.0, 10.0],
        [-6.0, -82.0, 97.0, 4.0, 52.0, 19.0],
        [-3.0, -75.0, 90.0, -8.0, 44.0, -12.0],
        [8.0, -85.0, 99.0, 12.0, 58.0, 25.0],
    ]
)
"""[deg]; the second and the last stand in the file by joint angles only."""
ONLY = (1, 4)


def olp(joints, poses, only=ONLY):
    lines = []
    for i, (q, T) in enumerate(zip(joints, poses, strict=True)):
        x, y, z = T[:3, 3]
        roll, pitch, yaw = np.array(abc_from_rotation(T[:3, :3])) / DEG
        pose = (
            f'<CartesianTarget><Position Units="m" X="{x:.9f}" Y="{y:.9f}" Z="{z:.9f}"/>'
            f'<Orientation Units="deg" Roll="{roll:.9f}" Pitch="{pitch:.9f}" Yaw="{yaw:.9f}"/>'
            "</CartesianTarget>"
        )
        angles = "".join(
            f'<Joint DOFNumber="{k}" Units="deg"><JointValue>{v:.9f}</JointValue></Joint>'
            for k, v in enumerate(q, start=1)
        )
        lines.append(
            f'<Activity ActivityType="DNBRobotMotionActivity" Operation="P.{i}">'
            "<MotionAttributes><MotionType>Joint</MotionType></MotionAttributes>"
            f"<Target>{'' if i in only else pose}<JointTarget>{angles}</JointTarget></Target>"
            "</Activity>"
        )
    task = '<ActivityList Task="T">\n' + "\n".join(lines) + "\n</ActivityList>"
    return f"<OLPData>\n<Resource>\n{task}\n</Resource>\n</OLPData>\n"


@pytest.fixture
def home(cell):
    """The cell with its base frame in the robot root, as the recording robot had it."""
    cell.write_text(cell.read_text().replace("xyz_mm = [1700, 0, 700]", "xyz_mm = [0, 0, 0]"))
    return cell


@pytest.fixture
def poses():
    return build(load_robot("kuka_kr500_r2830")).fk(JOINTS * DEG) @ T_FLANGE_TCP


def read_job(tmp_path, home, text):
    (tmp_path / "job.xml").write_text(text)
    source = str(tmp_path / "job.xml")
    return read_toolpath(ConvertRequest(source, str(home)), load_cell(home))


def test_placed_where_the_others_agree(tmp_path, home, poses):
    toolpath = read_job(tmp_path, home, olp(JOINTS, poses))
    assert np.abs(toolpath.points - poses[:, :3, 3]).max() < 1e-7
    assert np.abs(toolpath.rotations - poses[:, :3, :3]).max() < 1e-7
    assert np.abs(toolpath.axes + poses[:, :3, 0]).max() < 1e-7
    (said,) = [finding for finding in toolpath.warnings if finding.code == "CNV011"]
    assert "2 targets by joint angles are placed" in said.message


def test_they_convert_and_verify(tmp_path, home, poses, capsys):
    (tmp_path / "job.xml").write_text(olp(JOINTS, poses))
    out, cell = tmp_path / "out", ["--cell", str(home)]
    source = str(tmp_path / "job.xml")
    assert app.run(["convert", source, *cell, "-o", str(out), "-q"]) == 0
    assert app.run(["verify", str(out / "job.src"), *cell, "--against", source, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["max_position_error_mm"] < 0.01


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda q: q * [1, 1, 1, -1, 1, 1], id="another sign"),
        pytest.param(lambda q: q + np.array([0, 90, 0, 0, 0, 0]), id="another zero"),
        pytest.param(lambda q: np.array([*q[:3], [0.0] * 6, q[4]]), id="one that disagrees"),
    ],
)
def test_angles_of_another_arm_are_never_used(tmp_path, home, poses, change, capsys):
    (tmp_path / "job.xml").write_text(olp(change(JOINTS), poses))
    call = ["convert", str(tmp_path / "job.xml"), "--cell", str(home), "-o", str(tmp_path / "out")]
    assert app.run([*call, "--json"]) == 1
    failures = json.loads(capsys.readouterr().out)["failures"]
    assert [(f["tag"], f["code"], f["reason"]) for f in failures] == [
        (tag, "PLN206", "unreachable") for tag in ONLY
    ]
    assert not (tmp_path / "out").exists()


def test_a_joint_that_stands_still_disproves_nothing(tmp_path, home):
    """A6 is the same at all targets with a pose: its angles are taken, with a warning."""
    joints = JOINTS.copy()
    joints[[0, 2, 3], 5] = 15.0
    poses = build(load_robot("kuka_kr500_r2830")).fk(joints * DEG) @ T_FLANGE_TCP
    toolpath = read_job(tmp_path, home, olp(joints, poses))
    assert np.abs(toolpath.points - poses[:, :3, 3]).max() < 1e-7
    assert any(finding.code == "CNV011" for finding in toolpath.warnings)


def test_few_targets_are_taken_with_a_warning(tmp_path, home, poses):
    toolpath = read_job(tmp_path, home, olp(JOINTS[:3], poses[:3], only=(1,)))
    assert np.abs(toolpath.points[1] - poses[1, :3, 3]).max() < 1e-7
    assert any(finding.code == "CNV011" for finding in toolpath.warnings)


def test_orientation_of_the_file_is_that_of_the_arm():
    """The helper's angles mean R = Rz(roll) Ry(pitch) Rx(yaw)."""
    R = rotation_from_abc(np.array([0.3, -0.2, 0.9]))
    assert np.allclose(rotation_from_abc(np.array(abc_from_rotation(R))), R)
