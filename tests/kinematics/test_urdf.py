"""URDF arms: recognised, solved in closed form or numerically, wrong files refused."""

import numpy as np
import pinocchio
import pytest

from postproc.cell.robotfile import load_robot
from postproc.cell.urdf.file import read_urdf_robot
from postproc.errors import CellError, SourceRef
from postproc.geometry.frames import rotation_about, transform
from postproc.kinematics import build
from postproc.kinematics.numeric import PolishedSolver
from postproc.kinematics.singular import smallest_singular_value, wrist_distance
from tests.kinematics.test_inverse import check_some_branches
from tests.kinematics.urdf_text import joint, maker_style_urdf, urdf_of

UR10_LIKE = [
    ("0 0 0.1273", "0 0 0"),
    ("0 0 0", "1.5707963267948966 0 0"),
    ("-0.612 0 0", "0 0 0"),
    ("-0.5723 0 0.163941", "0 0 0"),
    ("0 0 0", "1.5707963267948966 0 0"),
    ("0 0 0.1157", "-1.5707963267948966 0 0"),
]
"""Three parallel axes, no spherical wrist."""


def written(folder, text):
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def parallel_axes_urdf():
    lines = ['<robot name="ur"><link name="base"/>']
    parent = "base"
    for i, (xyz, rpy) in enumerate(UR10_LIKE, start=1):
        lines.append(f'<link name="link_{i}"/>')
        lines.append(joint(f"joint_{i}", "revolute", parent, f"link_{i}", xyz, rpy))
        parent = f"link_{i}"
    lines.append(
        '<link name="flange"/>' + joint("end", "fixed", parent, "flange", "0 0 0.0922", "0 0 0")
    )
    return "\n".join([*lines, "</robot>"])


def apart(a, b):
    return np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1)


def check_against_pinocchio(path, kinematics, q, tip):
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    frame = model.getFrameId(tip)
    frames, T, J = kinematics.link_frames(q), kinematics.fk(q), kinematics.jacobian(q)
    for i, angles in enumerate(q):
        pinocchio.computeJointJacobians(model, data, angles)
        pinocchio.updateFramePlacements(model, data)
        np.testing.assert_allclose(T[i], data.oMf[frame].homogeneous, atol=1e-12)
        wanted = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(J[i], wanted, atol=1e-12)
        for link in range(1, 7):
            np.testing.assert_allclose(frames[i, link], data.oMi[link].homogeneous, atol=1e-12)


def test_maker_style_urdf_is_recognised_and_equals_the_built_in_arm(tmp_path):
    path = written(tmp_path, maker_style_urdf())
    arm = build(read_urdf_robot(path))
    built_in = build(load_robot("kuka_kr500_r2830"))
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (2000, 6))
    assert arm.is_closed_form
    check_against_pinocchio(path, arm, q[:50], "tool0")
    np.testing.assert_allclose(arm.fk(q), built_in.fk(q), atol=1e-12)
    np.testing.assert_array_equal(arm.slot(q), built_in.slot(q))
    ours, valid = arm.ik(built_in.fk(q))
    theirs, their_valid = built_in.ik(built_in.fk(q))
    np.testing.assert_array_equal(valid, their_valid)
    assert np.quantile(apart(ours[valid], theirs[valid]), 0.999) < 1e-9


@pytest.mark.parametrize("digits", [17, 6])
def test_every_built_in_arm_written_as_urdf_is_recognised(robot, tmp_path, digits):
    chain = build(robot).chain
    path = written(tmp_path, urdf_of(chain.placements, chain.axes, digits))
    arm = build(read_urdf_robot(path))
    assert arm.is_closed_form
    q = np.random.default_rng(2).uniform(-3.0, 3.0, (500, 6))
    branches, valid = arm.ik(arm.fk(q))
    own = np.arange(len(q)), arm.slot(q)
    assert valid[own].all()
    assert np.quantile(apart(branches[own], q), 0.99) < 1e-8


def test_an_arm_that_stands_askew_with_turned_flange_is_recognised(tmp_path):
    chain = build(load_robot("kuka_kr210_r2700_2")).chain
    placements = chain.placements.copy()
    rng = np.random.default_rng(3)
    foot = transform(rotation_about(np.array([0.6, 0.0, 0.8]), 0.5), [0.3, -0.2, 0.7])
    placements[0] = foot @ placements[0]
    placements[6] = placements[6] @ transform(
        rotation_about(np.array([0.0, 0.8, 0.6]), 1.1), [0.01, 0.02, 0.03]
    )
    arm = build(read_urdf_robot(written(tmp_path, urdf_of(placements, chain.axes))))
    assert arm.is_closed_form
    q = rng.uniform(-3.0, 3.0, (500, 6))
    branches, valid = arm.ik(arm.fk(q))
    row, slot = np.nonzero(valid)
    np.testing.assert_allclose(arm.fk(branches[row, slot]), arm.fk(q)[row], atol=1e-9)
    assert valid[np.arange(len(q)), arm.slot(q)].all()


def check_single_branches(arm, T, branches):
    for slot in range(8):
        one, valid = arm.ik_in(T, np.full(len(T), slot))
        np.testing.assert_allclose(one, branches[:, slot], rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(valid, np.isfinite(branches[:, slot, 0]))
    check_some_branches(arm, T, branches, np.isfinite(branches[:, :, 0]))


def test_a_calibrated_arm_with_slightly_wrong_axes_is_polished(tmp_path):
    chain = build(load_robot("kuka_kr500_r2830")).chain
    placements = chain.placements.copy()
    rng = np.random.default_rng(4)
    for i in range(6):
        axis = rng.normal(size=3)
        turn = rotation_about(axis / np.linalg.norm(axis), 2e-4)
        placements[i] = placements[i] @ transform(turn, rng.normal(scale=2e-4, size=3))
    arm = build(read_urdf_robot(written(tmp_path, urdf_of(placements, chain.axes))))
    assert isinstance(arm.solver, PolishedSolver)
    q = rng.uniform(-2.5, 2.5, (300, 6))
    q = q[(smallest_singular_value(arm, q) > 0.05)]
    branches, valid = arm.ik(arm.fk(q))
    row, slot = np.nonzero(valid)
    np.testing.assert_allclose(arm.fk(branches[row, slot]), arm.fk(q)[row], atol=2e-9)
    own = np.arange(len(q)), arm.slot(q)
    assert valid[own].mean() > 0.99
    assert np.nanquantile(apart(branches[own], q), 0.99) < 1e-6
    check_single_branches(arm, arm.fk(q), branches)


def test_an_arm_with_three_parallel_axes_is_solved_numerically(tmp_path):
    path = written(tmp_path, parallel_axes_urdf())
    arm = build(read_urdf_robot(path))
    assert not arm.is_closed_form
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (150, 6))
    check_against_pinocchio(path, arm, q[:30], "flange")
    T = arm.fk(q)
    branches, valid = arm.ik(T)
    row, slot = np.nonzero(valid)
    np.testing.assert_allclose(arm.fk(branches[row, slot]), T[row], atol=2e-9)
    np.testing.assert_array_equal(arm.slot(branches[row, slot]), slot)
    own = np.arange(len(q)), arm.slot(q)
    assert valid[own].mean() > 0.99
    assert np.nanquantile(apart(branches[own], q), 0.98) < 1e-6
    assert (
        np.isin(valid.sum(axis=1), (2, 4, 6, 8)).mean() > 0.95
    )  # this kind of arm solves in pairs
    assert (wrist_distance(arm, branches[row, slot]) >= 0.0).all()
    check_single_branches(arm, T[:20], branches[:20])


def test_numeric_solutions_are_repeatable(tmp_path):
    arm = build(read_urdf_robot(written(tmp_path, parallel_axes_urdf())))
    again = build(read_urdf_robot(written(tmp_path, parallel_axes_urdf())))
    T = arm.fk(np.random.default_rng(6).uniform(-3.0, 3.0, (20, 6)))
    np.testing.assert_array_equal(arm.ik(T)[0], again.ik(T)[0])


@pytest.mark.corpus
def test_the_ur10_of_the_corpus_works(corpus):
    path = corpus / "real" / "ur10" / "ur10.urdf"
    arm = build(read_urdf_robot(path))
    q = np.random.default_rng(7).uniform(-np.pi, np.pi, (60, 6))
    check_against_pinocchio(path, arm, q, "flange")
    branches, valid = arm.ik(arm.fk(q))
    own = np.arange(len(q)), arm.slot(q)
    assert valid[own].mean() > 0.99
    assert np.nanquantile(apart(branches[own], q), 0.98) < 1e-6


SIX = maker_style_urdf()
LOOP = joint("again", "fixed", "link_6", "link_2", "0 0 0", "0 0 0") + "</robot>"
CHANGES = [
    ('"joint_6" type="revolute"', '"joint_6" type="fixed"', "not a six-axis arm"),
    ('"joint_3" type="revolute"', '"joint_3" type="prismatic"', "not a six-axis arm"),
    ('"joint_3" type="revolute"', '"joint_3" type="turny"', "unknown type 'turny'"),
    ('"foot" type="fixed"', '"foot" type="prismatic"', "joint 'foot' is prismatic"),
    ('<link name="link_4"/>', "", "names link 'link_4', which is not there"),
    ('<parent link="link_2"/>', "", "has no parent or no child"),
    ('upper="3.1"', 'upper="pi"', "upper is 'pi', expected a finite number"),
    ('lower="-3.1"', 'lower="4.1"', "no limits with lower below upper"),
    ("</robot>", LOOP, "a link hangs on two joints"),
]
WRONG = [
    ("<robot", "not valid XML"),
    ("", "not valid XML"),
    ("<sdf/>", "expected <robot>"),
    *((SIX.replace(old, new), message) for old, new, message in CHANGES),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=[message for _, message in WRONG])
def test_wrong_urdf_is_refused_with_one_clear_line(text, message, tmp_path):
    path = written(tmp_path, text)
    with pytest.raises(CellError) as caught:
        read_urdf_robot(path)
    assert caught.value.code == "CEL011"
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_tip_names_the_cell_file_line(tmp_path):
    path = written(tmp_path, SIX)
    with pytest.raises(CellError, match=r"cell.toml:4: .*no link is named 'hand'.*link_1"):
        read_urdf_robot(path, "hand", SourceRef("cell.toml", 4))


def test_several_ends_ask_for_a_name(tmp_path):
    text = SIX.replace('"tool0"', '"gripper"').replace(
        "</robot>",
        '<link name="probe"/>'
        + joint("p", "fixed", "link_6", "probe", "0 0 1", "0 0 0")
        + "</robot>",
    )
    with pytest.raises(CellError, match=r"CEL032.*gripper, probe"):
        read_urdf_robot(written(tmp_path, text))
    robot = read_urdf_robot(written(tmp_path, text), "probe")
    np.testing.assert_allclose(build(robot).fk(np.zeros(6))[2, 3], 0.99, atol=1e-9)


def test_a_tip_in_the_middle_of_the_chain_is_refused(tmp_path):
    with pytest.raises(CellError, match="4 moving joints lead to link 'link_4', expected 6"):
        read_urdf_robot(written(tmp_path, SIX), "link_4")


def test_limits_and_speeds_come_from_the_file_and_gaps_are_marked(tmp_path):
    text = SIX.replace('"joint_6" type="revolute"', '"joint_6" type="continuous"', 1)
    text = text.replace('velocity="2.0"', 'velocity="0"', 1)
    robot = read_urdf_robot(written(tmp_path, text))
    np.testing.assert_allclose(robot.q_max[:5], 3.1)
    np.testing.assert_allclose(robot.q_max[5], 2.0 * np.pi)
    np.testing.assert_allclose(robot.qd_max[1:], 2.0)
    assert robot.qd_max[0] > 0.0
    assert robot.origins["q_max"].provenance == "assumed"
    assert robot.origins["qd_max"].provenance == "assumed"
    assert robot.origins["geometry"].provenance == "user"
    assert build(robot).is_closed_form
