"""Limits, singularities, speeds, blending, time, collisions: on programs made for the purpose."""

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import read_urdf_robot
from postproc.kinematics import build, dynamics_of
from postproc.verification.verify import verify
from tests.kinematics.urdf_text import heavy_urdf
from tests.samples import AT_PART, HEAD, START, at, cell_in, modules, path_of

DEG = np.pi / 180.0
POSE = "PTP {{A1 {0},A2 {1},A3 {2},A4 {3},A5 {4},A6 {5}}}"


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"), **AT_PART)


def check(cell, *lines, toolpath=None, collisions=False):
    return verify(modules(*HEAD, *lines), "T", cell, toolpath, collisions=collisions)


def kinds(report):
    return {violation.code for violation in report.violations}


def warned(report):
    return {warning.code for warning in report.warnings if not warning.headline}


def test_joint_limits_with_margin(cell):
    low, high = cell.robot.q_min[0] / DEG, cell.robot.q_max[0] / DEG
    for a1, expected in (
        (high - 2.1, set()),
        (high - 1.9, {"joint_limit"}),
        (low - 1, {"joint_limit"}),
    ):
        report = check(cell, POSE.format(a1, -80, 100, 0, 30, 0))
        assert kinds(report) == expected
        assert report.worst["joint_margin"].value == pytest.approx(min(high - a1, a1 - low))
        assert report.worst["joint_margin"].detail == "A1"
    assert report.violations[0].source.line == len(HEAD) + 2
    assert "beyond its limit" in report.violations[0].message


def test_a_path_between_good_ends_may_pass_a_singularity(cell):
    kinematics = build(cell.robot)
    up, down = (np.array([0, -80, 100, 0, a5, 0]) * DEG for a5 in (20.0, -20.0))
    report = check(cell, POSE.format(0, -80, 100, 0, 20, 0), *moved_to(cell, kinematics, down))
    assert "singularity" in kinds(report)
    assert report.worst["wrist_singularity"].value < 3.0
    joint = check(cell, POSE.format(0, -80, 100, 0, 20, 0), POSE.format(0, -80, 100, 0, -20, 0))
    assert kinds(joint) == set()  # a joint motion may pass it
    assert "wrist_singularity" not in joint.worst
    del up


def moved_to(cell, kinematics, q):
    from postproc.geometry.frames import inverse, kuka_from_transform

    T = inverse(cell.T_robroot_base) @ kinematics.fk(q) @ cell.tool.T_flange_tcp
    names = zip("XYZABC", np.concatenate(kuka_from_transform(T)), strict=True)
    return ["LIN {" + ",".join(f"{n} {v:.6f}" for n, v in names) + "}"]


@pytest.mark.parametrize(("cdis_mm", "expected"), [(5, set()), (300, {"corner"})])
def test_a_corner_may_not_come_near_the_straight_wrist(tmp_path, cdis_mm, expected):
    """The joint motion to the corner may pass it, what is cut off behind its middle may not."""
    cell = cell_in(tmp_path, SOLIDS, **AT_PART)
    poses = [POSE.format(30, -90, 100, 0, a5, 0) for a5 in (2.5, 6.0)]
    end = moved_to(cell, build(cell.robot), np.array([30, -90, 100, 0, 9, 0]) * DEG)
    lines = [poses[0], f"$APO.CDIS={cdis_mm}.0", f"{poses[1]} C_DIS", *end]
    report = check(cell, *lines, collisions=True)
    assert kinds(report) - {"setup"} == expected  # the cell asks for no such distance
    corner = [found.message for found in report.violations if found.code == "corner"]
    assert all("A5 may come within 2.29" in text for text in corner)


def test_a_stretched_arm_is_a_warning(cell):
    kinematics = build(cell.robot)
    stretched = kinematics.branches.elbow_angle(np.zeros(6))
    q = np.array([0.0, -60.0, 0.0, 0.0, 40.0, 0.0]) * DEG
    q[2] = -float(stretched) + 4.0 * DEG
    report = check(cell, POSE.format(*np.degrees(q)), "LIN_REL {X -1.0}")
    assert report.worst["stretched_arm"].value == pytest.approx(4.0, abs=0.5)
    q[2] = -float(stretched) + 2.0 * DEG
    assert "stretched" in warned(check(cell, POSE.format(*np.degrees(q)), "LIN_REL {X -1.0}"))


def test_axis_speeds_are_those_of_the_jacobian(cell):
    """The needed axis speed of a line is v times a column of the inverse Jacobian."""
    kinematics = build(cell.robot)
    report = check(cell, START, at(-50, 0, 0), "$VEL.CP=0.2", "$ACC.CP=1000.0", at(0, 0, 0))
    q = np.array([-5.14, -73.15, 101.79, -174.35, -61.92, -7.83]) * DEG
    T_robroot_flange = cell.T_robroot_base @ np.eye(4)
    J = kinematics.jacobian(q, cell.tool.T_flange_tcp[:3, 3])
    v = np.concatenate([T_robroot_flange[:3, :3] @ [0.2, 0, 0], np.zeros(3)])
    share = np.abs(np.linalg.solve(J, v) / cell.robot.qd_max)
    assert report.worst["axis_speed"].value == pytest.approx(100 * share.max(), rel=0.15)
    assert report.worst["axis_speed"].detail == f"A{share.argmax() + 1}"


def test_too_fast_for_an_axis(cell):
    cell = replace(cell, accept=("$ACC.CP", "$VEL.ORI1"))
    fast = [START, at(-50, 0, 0), "$VEL.CP=0.2", "$ACC.CP=1000.0", at(0, 0, 0)]
    spin = at(0, 0, 0).replace("C 175.0", "C 120.0")
    turning = check(cell, *fast, "$VEL.ORI1=4000.0", spin)
    assert "axis_speed" in kinds(turning) | warned(turning)
    assert kinds(check(cell, *fast, "$VEL.ORI1=20.0", spin)) == set()


def test_no_speed_is_no_motion(cell):
    report = check(cell, START, at(-50, 0, 0), "$VEL.CP=0.0", at(0, 0, 0))
    assert "speed" in kinds(report)
    assert np.isfinite(report.cycle_time)


def test_blending(cell):
    points = [START, at(-50, 0, 0), at(0, 0, 0, "C_DIS"), at(0, 40, 0, "C_DIS"), at(0, 40, 40)]
    good = check(cell, *points)
    assert (kinds(good), warned(good)) == (set(), set())
    # a quarter turn blended at 1 mm passes its corner by 1 mm * |u + v| / 2 at most
    assert good.worst["corner_rounding"].value == pytest.approx(np.sqrt(2) / 2, rel=1e-6)
    assert "blend_end" in kinds(check(cell, *points, at(0, 0, 0, "C_DIS")))
    assert "blend_cut" in warned(check(cell, points[0], "$APO.CDIS=30.0", *points[1:]))
    lost = [*points[:3], "WAIT SEC 0.1", *points[3:]]
    assert "blend_lost" in warned(check(cell, *lost))


def test_circles_that_are_none(cell):
    start = [START, at(0, 0, 0)]
    pose = "A 0.0,B 0.0,C 175.0"
    flat = f"CIRC {{X 0.0,Y 10.0,Z 0.0}},{{X 0.0,Y 20.0,Z 0.0,{pose}}}"
    assert kinds(check(cell, *start, flat)) == {"circle"}


def test_half_turns_of_the_tool(cell):
    q = np.array([10.0, -80.0, 100.0, 15.0, 40.0, 20.0])
    turned = "LIN_REL {X 1.0,C 180.0} #TOOL"
    assert "half_turn" in kinds(check(cell, POSE.format(*q), turned))


def test_time_of_a_joint_motion_and_of_a_line(cell):
    still = [POSE.format(0, -80, 100, 0, 30, 0)] * 2
    base = check(cell, *still).cycle_time
    top, push = cell.robot.qd_max[0], cell.robot.qdd_max[0]
    way = 60.0 * DEG
    one = check(cell, still[0], POSE.format(60, -80, 100, 0, 30, 0)).cycle_time - base
    half_top = 0.5 * top
    assert one == pytest.approx(way / half_top + half_top / push + 0.1, rel=0.05)
    half = check(cell, still[0], "BAS(#VEL_PTP,25)", POSE.format(60, -80, 100, 0, 30, 0))
    assert half.cycle_time > one + base
    line = [START, at(-50, 0, 0), "$VEL.CP=0.01", at(0, 0, 0)]
    waiting = check(cell, *line, "WAIT SEC 2.5").cycle_time - check(cell, *line).cycle_time
    assert waiting == pytest.approx(2.5)
    first = check(cell, *line[:2]).cycle_time
    # jerk-limited ramps to a speed below a * t_jerk: each takes 2 * sqrt(v * t_jerk / a)
    ramp = 2.0 * np.sqrt(0.01 * 0.1 / 2.3)
    assert check(cell, *line).cycle_time - first == pytest.approx(5.0 + ramp, rel=1e-4)


def test_tool_and_base_are_compared_with_the_cell(cell):
    own = "$TOOL={X 107.0,Y 0.0,Z 362.0,A 0.0,B 0.0,C 0.0}"
    assert kinds(check(cell, own, START, at(0, 0, 0))) == set()
    other = own.replace("362.0", "362.02")
    assert kinds(check(cell, other, START, at(0, 0, 0))) == {"frame"}
    moved = "$BASE=BASE_DATA[1]:{X 0.0,Y 0.0,Z 1.0}"
    assert kinds(check(cell, moved, START, at(0, 0, 0))) == {"frame"}


def test_a_set_up_module_tells_what_the_controller_has(cell):
    setup = "DEF T_SETUP( )\nTOOL_DATA[1]={X 107.0,Y 0.0,Z 350.0,A 0.0,B 0.0,C 0.0}\nEND\n"
    found = modules(*HEAD, START, at(0, 0, 0), T_SETUP=setup)
    report = verify(found, "T", cell, collisions=False)
    assert kinds(report) == {"frame"}


SOLIDS = """
[[tool.meshes]]
box = { size_mm = [60, 60, 60] }
xyz_mm = [60, 0, 362]
[[tool.meshes]]
cylinder = { radius_mm = 4, length_mm = 40 }
xyz_mm = [86, 0, 362]
abc_deg = [0, 90, 0]
cutting = true
[[workpiece.meshes]]
box = { size_mm = [20, 200, 200] }
xyz_mm = [10, 0, 0]
[[obstacles]]
name = "post"
box = { size_mm = [20, 20, 300] }
xyz_mm = [1840, 150, 1100]
"""


def test_collisions_between_good_points(tmp_path):
    cell = cell_in(tmp_path, SOLIDS, **AT_PART)
    ends = [(-60, -40, 0), (-60, 110, 0)]
    beside = check(cell, START, at(-250, -40, 0), at(-250, 110, 0), collisions=True)
    assert (kinds(beside), beside.collisions_checked) == (set(), True)
    through = check(cell, START, at(*ends[0]), at(*ends[1]), collisions=True)
    assert kinds(through) == {"collision"}
    assert "post" in through.violations[0].message
    assert kinds(check(cell, START, at(*ends[0]), at(*ends[1]))) == set()  # not searched
    toolpath = path_of([(-60, 0, 0), (5, 0, 0)], "RL")
    drill = [START, at(-60, 0, 0), at(5, 0, 0)]
    assert kinds(check(cell, *drill, toolpath=toolpath, collisions=True)) == set()  # it cuts
    rapid = path_of([(-60, 0, 0), (5, 0, 0)], "RR")
    assert kinds(check(cell, *drill, toolpath=rapid, collisions=True)) == {"collision"}


def test_without_solids_collisions_are_not_said_to_be_checked(cell):
    assert not check(cell, START, collisions=True).collisions_checked


def test_an_arm_that_hits_itself_is_seen_in_a_cell_without_solids(cell):
    """What collides with tool and part nobody knows there: that is not said to be checked."""
    folded = [-150.0, 12.0, 136.0, 97.0, -29.0, 69.0]  # the hand in the base, as on a real arm
    report = check(cell, START, POSE.format(*folded), collisions=True)
    assert "link 0 hits link " in next(v.message for v in report.violations)
    assert not report.collisions_checked
    assert kinds(check(cell, START, POSE.format(*folded))) == set()


RAIL = """
[[external_axes]]
name = "E1"
kind = "rail"
axis = "+y"
range_mm = [-2000, 2000]
speed_mm_s = 500
"""


def with_rail(line, position):
    return line.replace("}", f",E1 {position:.3f}}}", 1)


def test_a_rail_carries_the_robot(tmp_path):
    cell = cell_in(tmp_path, RAIL, **AT_PART)
    points = [(-50, 0, 0), (0, 0, 0), (0, 40, 0)]
    here = [with_rail(line, 0.0) for line in (START, *[at(*p) for p in points])]
    assert kinds(check(cell, *here, toolpath=path_of(points))) == set()
    # half a metre along the rail the same part is reached in another pose of the arm
    a1 = START.replace("A1 -5.14", "A1 -25.0")
    there = [with_rail(line, 300.0) for line in (a1, *[at(*p) for p in points])]
    report = check(cell, *there, toolpath=path_of(points))
    assert kinds(report) == set()
    assert report.position_error < 1e-9
    assert kinds(check(cell, *[with_rail(line, 2500.0) for line in (START,)])) == {"joint_limit"}
    assert warned(check(cell, START, at(0, 0, 0))) == {"external"}


def test_joints_that_forget_the_rail_miss_the_part(tmp_path):
    """The same joints a metre along the rail put the tool a metre beside the part."""
    cell = cell_in(tmp_path, RAIL, **AT_PART)
    zero = check(cell, with_rail(START, 0.0)).run.paths.end_point[0]
    moved = check(cell, with_rail(START, 1000.0)).run.paths.end_point[0]
    assert moved - zero == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


def test_collisions_of_a_carried_robot(tmp_path):
    post = SOLIDS.replace("xyz_mm = [1840, 150, 1100]", "xyz_mm = [1840, 1150, 1100]")
    cell = cell_in(tmp_path, RAIL + post, **AT_PART)
    ends = [(-250, -40, 0), (-60, -40, 0), (-60, 110, 0)]
    lines = [at(*p) for p in ends]
    at_zero = check(cell, *[with_rail(line, 0.0) for line in (START, *lines)], collisions=True)
    assert kinds(at_zero) == set()
    travel = [with_rail(START, 0.0), with_rail(START, 1500.0)]
    hit = check(
        cell, *[with_rail(line, 0.0) for line in (START, lines[1])], *travel[1:], collisions=True
    )
    assert kinds(hit) == {"collision"}
    assert "post" in hit.violations[0].message


@pytest.mark.parametrize("radius_mm", [2, 10])
def test_no_rod_is_passed_between_two_looks_at_a_travelling_robot(tmp_path, radius_mm):
    travel = [with_rail(START, 0.0), with_rail(START, 1500.0)]
    for y in (411.0, 655.5, 902.0, 1234.5):
        rod = (
            f'[[obstacles]]\nname = "rod"\nxyz_mm = [1500, {y}, 1000]\n'
            f"cylinder = {{ radius_mm = {radius_mm}, length_mm = 2000 }}\n"
        )
        cell = cell_in(tmp_path, RAIL + rod, **AT_PART)
        report = check(cell, *travel, collisions=True)
        assert kinds(report) == {"collision"}, y
        assert "rod" in report.violations[0].message


def test_torques_are_asked_of_poses_that_are_known(cell, tmp_path):
    (tmp_path / "arm.urdf").write_text(heavy_urdf(), encoding="utf-8")
    weighed = replace(cell, robot=read_urdf_robot(tmp_path / "arm.urdf"))
    far = "LIN {X 99999,Y 0,Z 0,A 0,B 0,C 0}"
    assert "torque" not in check(weighed, far).worst
    assert "torque" not in check(cell, START).worst
    report = check(weighed, START, far)
    q = np.array([float(value) for value in re.findall(r"A\d (-?[\d.]+)", START)]) * DEG
    needed = dynamics_of(weighed.robot, weighed.tool).torques(*np.stack([q, 0 * q, 0 * q])[:, None])
    share = np.abs(needed[0]) / weighed.robot.torque_max
    assert check(weighed, START).worst["torque"].value == pytest.approx(100.0 * share.max())
    assert np.isfinite(report.worst["torque"].value)


def test_an_axis_that_must_not_move_in_cuts_stands_still_there(tmp_path):
    """Only the rail moves on the second line: the tool runs as the file asks for."""
    points = [(-50, 0, 0), (0, 0, 0), (0, 40, 0)]
    for at_end, allowed, wrong in (
        (0.0, "false", set()),
        (1.0, "false", {"external"}),
        (1.0, "true", set()),
    ):
        cell = cell_in(tmp_path, f"{RAIL}moves_in_cuts = {allowed}\n", **AT_PART)
        lines = [with_rail(line, 0.0) for line in (START, *[at(*p) for p in points[:2]])]
        lines.append(with_rail(at(*points[2]), at_end))
        assert kinds(check(cell, *lines, toolpath=path_of(points))) == wrong
