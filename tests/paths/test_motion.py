"""Joint paths against independent truth: joints that are known before the text is written."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from postproc.controller import World, run
from postproc.controller.runtime import pose_of
from postproc.geometry.frames import inverse, kuka_from_transform
from postproc.kinematics import build
from postproc.paths import joint_paths, run_in_cell
from tests.samples import cell_in, modules

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"))


@pytest.fixture(scope="module")
def kinematics(cell):
    return build(cell.robot)


def paths(cell, kinematics, *lines):
    tools = {1: pose_of(cell.tool.T_flange_tcp)}
    bases = {1: pose_of(cell.T_robroot_base)}
    head = ("BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,1)", "$VEL.CP=0.1")
    trace = run(modules(*head, *lines), "T", kinematics, World(tools, bases))
    assert not trace.findings
    return joint_paths(trace, cell, kinematics)


def ptp(q):
    return "PTP {" + ",".join(f"A{i} {v:.9f}" for i, v in enumerate(np.degrees(q), 1)) + "}"


def frame_text(cell, kinematics, q):
    """The TCP pose in the base, as its six numbers."""
    T = inverse(cell.T_robroot_base) @ kinematics.fk(q) @ cell.tool.T_flange_tcp
    xyz, abc = kuka_from_transform(T)
    names = zip("XYZABC", [*xyz, *abc], strict=True)
    return ",".join(f"{name} {value:.9f}" for name, value in names)


def random_joints(robot, rng, count):
    low, high = robot.q_min + 5 * DEG, robot.q_max - 5 * DEG
    q = rng.uniform(low, high, (count, 6))
    return q[np.abs(q[:, 4]) > 5 * DEG]


def test_status_and_turn_give_the_joints_back(cell, kinematics):
    """Random joints, all turns included: text with S and T, and out come the same joints."""
    rng = np.random.default_rng(7)
    q = random_joints(cell.robot, rng, 400)
    q = q[(np.abs(q) > 2.5 * DEG).all(axis=1)]
    slots, valid = kinematics.ik(kinematics.fk(q))
    principal = (q + np.pi) % (2 * np.pi) - np.pi
    near = np.abs((slots - principal[:, None] + np.pi) % (2 * np.pi) - np.pi).max(axis=2)
    branch = np.where(valid, near, np.inf).argmin(axis=1)
    turns = (q < 0.0) @ (1 << np.arange(6))
    lines = [
        f"PTP {{{frame_text(cell, kinematics, row)},S {s},T {t}}}"
        for row, s, t in zip(q, branch, turns, strict=True)
    ]
    found = paths(cell, kinematics, *lines)
    assert not found.findings
    assert len(found.q) > 200
    assert np.abs(found.q - q).max() < 1e-7


def test_the_status_bits_are_those_of_the_manual(cell, kinematics):
    """S of a floor robot's usual pose is 2 with A5 > 0 and 6 with A5 < 0; overhead adds 1."""
    home = np.array([10.0, -80.0, 100.0, 15.0, 40.0, 20.0]) * DEG
    down = home * [1, 1, 1, 1, -1, 1]
    for q, status, turn in ((home, 2, 0b10), (down, 6, 0b10010)):
        text = frame_text(cell, kinematics, q)
        found = paths(cell, kinematics, f"PTP {{{text},S {status},T {turn}}}")
        assert np.abs(found.q[0] - q).max() < 1e-7


def test_without_status_the_branch_stays_and_the_turn_is_the_nearest(cell, kinematics):
    start = np.array([10.0, -80.0, 100.0, 200.0, 40.0, -250.0]) * DEG
    end = start + np.array([5.0, 3.0, -4.0, 10.0, 5.0, -8.0]) * DEG
    found = paths(cell, kinematics, ptp(start), f"PTP {{{frame_text(cell, kinematics, end)}}}")
    assert np.abs(found.q[1] - end).max() < 1e-7


def test_the_first_of_each_stretch_out_of_reach_are_listed(cell, kinematics):
    """Between Cartesian PTP targets: 20 each, whatever parts the check takes them in."""
    q = np.radians([0.0, -90.0, 90.0, 0.0, 45.0, 0.0])
    near, far = f"PTP {{{frame_text(cell, kinematics, q)}}}", "LIN {X 9000,Y 0,Z 0}"
    found = paths(cell, kinematics, ptp(q), *[far] * 30, near, *[far] * 25).findings
    rows = [f.message for f in found if "leaves the reach" in f.message]
    assert len(rows) == 40
    assert sum("30 such motions" in row for row in rows) == 20
    assert sum("25 such motions" in row for row in rows) == 20


def test_impossible_turns_and_reaches_are_findings(cell, kinematics):
    q = np.array([10.0, -80.0, 100.0, 15.0, 40.0, 20.0]) * DEG
    text = frame_text(cell, kinematics, q)
    wrong_turn = paths(cell, kinematics, f"PTP {{{text},S 2,T 0}}")  # A2 is never positive here
    assert [f.code for f in wrong_turn.findings] == ["turn"]
    far = paths(cell, kinematics, "PTP {X 9000.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0,S 2,T 2}")
    assert [f.code for f in far.findings] == ["unreachable"]
    lost = paths(cell, kinematics, ptp(q), "LIN {X 9000.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}")
    assert [f.code for f in lost.findings] == ["unreachable"]


def test_a_first_motion_that_does_not_fix_the_pose_is_a_finding(cell, kinematics):
    q = np.array([10.0, -80.0, 100.0, 15.0, 40.0, 20.0]) * DEG
    text = frame_text(cell, kinematics, q)
    for line in (f"PTP {{{text}}}", f"LIN {{{text}}}"):
        assert [f.code for f in paths(cell, kinematics, line).findings] == ["start"]


def test_a_line_is_straight_and_turns_about_one_axis(cell, kinematics):
    start = np.array([20.0, -70.0, 105.0, 170.0, 50.0, -100.0]) * DEG
    end = np.array([-15.0, -85.0, 115.0, 190.0, 65.0, -60.0]) * DEG
    text = frame_text(cell, kinematics, end)
    found = paths(cell, kinematics, ptp(start), f"LIN {{{text}}}")
    T = kinematics.fk(found.q_sample) @ cell.tool.T_flange_tcp
    T_a = kinematics.fk(start) @ cell.tool.T_flange_tcp
    T_b = kinematics.fk(end) @ cell.tool.T_flange_tcp
    share = found.share[:, None]
    straight = T_a[:3, 3] + share * (T_b[:3, 3] - T_a[:3, 3])
    assert np.abs(T[:, :3, 3] - straight).max() < 1e-9
    slerp = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([T_a[:3, :3], T_b[:3, :3]])))
    off = Rotation.from_matrix(T[:, :3, :3]) * slerp(found.share).inv()
    assert off.magnitude().max() < 1e-8
    # continuous, and one arm pose throughout
    steps = np.abs(np.diff(np.vstack([start, found.q_sample]), axis=0))
    assert steps.max() < 5 * DEG
    assert len(set(kinematics.slot(found.q_sample).tolist())) == 1
    assert np.abs(found.q_sample[-1] - end).max() < 1e-7


def test_the_turn_follows_the_path_beyond_a_full_turn(cell, kinematics):
    """Lines in steps of 60 degrees about the tool axis wind A6 up, past its principal value."""
    q = np.array([0.0, -80.0, 110.0, 90.0, 60.0, 0.0]) * DEG
    T = inverse(cell.T_robroot_base) @ kinematics.fk(q) @ cell.tool.T_flange_tcp
    lines = [ptp(q)]
    for k in range(1, 6):
        turned = T.copy()
        turned[:3, :3] = T[:3, :3] @ Rotation.from_euler("x", 30.0 * k, degrees=True).as_matrix()
        xyz, abc = kuka_from_transform(turned)
        names = zip("XYZABC", [*xyz, *abc], strict=True)
        lines.append("LIN {" + ",".join(f"{n} {v:.9f}" for n, v in names) + "}")
    found = paths(cell, kinematics, *lines)
    q_all = np.vstack([found.q[0], found.q_sample])
    assert np.abs(np.diff(q_all, axis=0)).max() < 15 * DEG
    T_end = kinematics.fk(found.q[-1]) @ cell.tool.T_flange_tcp
    assert np.abs(T_end - kinematics.fk(q_all[-1]) @ cell.tool.T_flange_tcp).max() < 1e-12


def test_relative_joint_motion_behind_a_path(cell, kinematics):
    start = np.array([20.0, -70.0, 105.0, 170.0, 50.0, -100.0]) * DEG
    end = np.array([10.0, -75.0, 108.0, 175.0, 55.0, -90.0]) * DEG
    lines = (ptp(start), f"LIN {{{frame_text(cell, kinematics, end)}}}", "PTP_REL {A1 5.0}")
    head = ("BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,1)")
    trace = run_in_cell(modules(*head, *lines), "T", cell, kinematics)
    found = joint_paths(trace, cell, kinematics)
    assert np.abs(found.q[2] - (end + np.array([5.0, 0, 0, 0, 0, 0]) * DEG)).max() < 1e-7


def test_points_are_given_in_the_part(cell, kinematics):
    q = np.array([0.0, -80.0, 110.0, 0.0, -60.0, 0.0]) * DEG
    pose = "A 0.0,B 0.0,C 180.0"
    found = paths(cell, kinematics, ptp(q), f"LIN {{X 10.0,Y 20.0,Z 30.0,{pose}}}")
    assert np.allclose(found.end_point[1], [0.010, 0.020, 0.030], atol=1e-12)
    assert np.allclose(found.end_axis[1], [1, 0, 0], atol=1e-12)
    assert np.allclose(found.point[-1], found.end_point[1], atol=1e-12)


# ------------------------------------------------------------------------------------- circles


def test_circ_with_an_angle_ends_there(cell, kinematics):
    q = np.array([0.0, -80.0, 110.0, 0.0, -60.0, 0.0]) * DEG
    pose = "A 0.0,B 0.0,C 180.0"
    start = f"LIN {{X 0.0,Y 100.0,Z 0.0,{pose}}}"
    arc = f"CIRC {{X 0.0,Y 0.0,Z 100.0}},{{X 0.0,Y -100.0,Z 0.0,{pose}}}"
    half = paths(cell, kinematics, ptp(q), start, arc)
    assert np.allclose(half.end_point[2], [0, -0.1, 0], atol=1e-9)
    points = half.point[half.row == 2]
    assert np.allclose(np.linalg.norm(points, axis=1), 0.1, atol=1e-9)
    assert (points[:-1, 2] > 0).all()
    for angle, end in ((90.0, [0, 0, 0.1]), (360.0, [0, 0.1, 0]), (-90.0, [0, 0, -0.1])):
        turned = paths(cell, kinematics, ptp(q), start, f"{arc},CA {angle}", "LIN_REL {Z 0.0}")
        assert np.allclose(turned.end_point[2], end, atol=1e-9)
        points = turned.point[turned.row == 2]
        assert np.allclose(np.linalg.norm(points, axis=1), 0.1, atol=1e-9)


def test_splines_pass_their_points_and_stay_smooth(cell, kinematics):
    q = np.array([0.0, -80.0, 110.0, 0.0, -60.0, 0.0]) * DEG
    pose = "A 0.0,B 0.0,C 180.0"
    angle = np.linspace(0.0, np.pi, 9)
    points = [
        f"  SPL {{X 0.0,Y {100 * np.cos(a):.6f},Z {100 * np.sin(a):.6f},{pose}}}" for a in angle[1:]
    ]
    found = paths(
        cell,
        kinematics,
        ptp(q),
        f"LIN {{X 0.0,Y 100.0,Z 0.0,{pose}}}",
        "SPLINE",
        *points,
        "ENDSPLINE",
    )
    assert np.allclose(np.linalg.norm(found.end_point[2:], axis=1), 0.1, atol=1e-8)
    between = found.points_at(np.arange(3, 9), np.full(6, 0.5))
    assert np.abs(np.linalg.norm(between, axis=1) - 0.1).max() < 0.2e-3  # a chord is 1.9 mm off
