"""Compensation judged on the hidden twin: the loaded tool lands on the CAM point."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.cell.schema import Process
from postproc.compensation.compensate import compensate
from postproc.compensation.real_arm import RealArm, loads
from postproc.compensation.solve import solve
from postproc.errors import DataError
from postproc.gap import stiffness_tables
from postproc.gap.robot_model import RobotModel
from postproc.geometry.frames import transform
from postproc.model.modelfile import ModelFile, load_model, save_model
from postproc.model.plan import MoveKind, MoveRole, Plan
from postproc.model.reach import Reach
from postproc.model.toolpath import MotionKind, ToolPath
from postproc.paths.moments import Moments, directions
from postproc.stiffness.field import ConstantField
from postproc.stiffness.identify.cases import load_cases
from postproc.stiffness.identify.constant import fit_constant
from postproc.stiffness.identify.continuous import fit_continuous
from tools.dev.hidden_twin import Twin

from .conftest import K_PAPER, TCP, WEIGHT, campaign, dead_weight, wrench_of

NONE = np.zeros(0, dtype=bool)


def constant_model(path: Path, c=1.0 / K_PAPER) -> str:
    path.write_bytes(save_model(ModelFile(stiffness_tables(ConstantField(c), c))))
    return str(path)


def plan_of(cell, arm, q) -> Plan:
    """Return a plan of LIN cuts through joints (n, 6), the first a PTP."""
    n = len(q)
    base = np.linalg.inv(cell.workpiece.T_robroot_base)
    T = base @ arm.fk(q) @ cell.tool.T_flange_tcp
    nan = np.full(n, np.nan)
    none = np.full(n, -1)
    path = ToolPath(
        path="part.apt", name="part", format="apt", dialect="apt", units="mm",
        points=T[:, :3, 3], axes=-T[:, :3, 0], kind=np.full(n, MotionKind.LINEAR),
        feed=np.full(n, 0.01), line=np.arange(1, n + 1), operation=none, tool=none, arc=none,
        cycle=none,
    )  # fmt: skip
    return Plan(
        name="part", toolpath=path, kind=np.r_[MoveKind.PTP, np.full(n - 1, MoveKind.LIN)],
        role=np.r_[MoveRole.ENTRY, np.full(n - 1, MoveRole.CUT)], tag=np.arange(n), T_base_tcp=T,
        aux=np.full((n, 3), np.nan), q=q, spin=np.zeros(n), branch=arm.slot(q),
        speed=np.full(n, 0.01), ptp_fraction=nan, blend=np.zeros(n), dwell=np.zeros(n),
        duration=np.ones(n), external=np.zeros((n, 0)), stiffness=nan, stiffness_initial=nan,
        clearance=nan,
    )  # fmt: skip


def test_dead_load_is_the_tools_weight_at_its_centre(cell, arm, postures):
    twin = Twin()
    q = postures(10)
    ours = loads(q, cell, arm, np.zeros(10, dtype=bool))
    np.testing.assert_allclose(ours, wrench_of(twin, q, WEIGHT, twin.com), atol=1e-9)


def test_process_force_turns_with_the_tool_and_only_while_cutting(cell, arm, postures):
    q = postures(6)
    force = replace(cell, process=Process((-300.0, 0, 50), (0, 5, 0)))
    working = np.array([True, False] * 3)
    ours = loads(q, force, arm, working, dead=False)
    R = arm.fk(q)[:, :3, :3] @ cell.tool.T_flange_tcp[:3, :3]
    np.testing.assert_allclose(ours[0, :3], R[0] @ [-300.0, 0.0, 50.0])
    np.testing.assert_allclose(ours[0, 3:], R[0] @ [0.0, 5.0, 0.0])
    assert np.all(ours[1] == 0.0)


def test_known_constants_leave_nothing_on_the_real_arm(cell, arm, postures, tmp_path):
    twin = Twin()
    q = postures(40)
    model = RobotModel.of(arm, cell, load_model(constant_model(tmp_path / "m.toml")))
    wrench = loads(q, cell, arm, np.zeros(40, dtype=bool))
    solved = solve(model, arm, cell.tool.T_flange_tcp, q, wrench)
    before = np.linalg.norm(twin.weight(q) - twin.point(q), axis=1)
    after = np.linalg.norm(twin.weight(solved.q) - twin.point(q), axis=1)
    assert before.mean() > 2e-4
    # the twin's weight also turns with the tool: what is left is of second order
    assert after.max() < 2e-6
    assert np.all(solved.reached)
    assert solved.left.max() < 1e-7


def test_iteration_beats_a_single_step_under_a_heavy_load(cell, arm, postures, tmp_path):
    soft = 30.0 / K_PAPER
    model = RobotModel.of(arm, cell, load_model(constant_model(tmp_path / "m.toml", soft)))
    q = postures(20)
    wrench = loads(q, cell, arm, np.zeros(20, dtype=bool))
    target = model.nominal(q)
    solved = solve(model, arm, cell.tool.T_flange_tcp, q, wrench)
    landed = np.linalg.norm(model.tool_point(solved.q, wrench) - target, axis=1)
    once = target - (model.tool_point(q, wrench) - target)
    T = arm.fk(q) @ cell.tool.T_flange_tcp
    T[:, :3, 3] = once
    slots, _ = arm.ik(T @ np.linalg.inv(cell.tool.T_flange_tcp))
    one = arm.nearest(slots[np.arange(20), arm.slot(q)], q)
    single = np.linalg.norm(model.tool_point(one, wrench) - target, axis=1)
    assert landed.max() < 1e-7
    assert single.max() > 1e-5


def test_identified_field_compensates_to_the_noise(cell, arm, postures):
    twin = Twin(0, 0.55)
    sigma = 12e-6
    cases = load_cases(campaign(twin, postures(64), dead_weight(twin), sigma), arm, TCP)
    constant = fit_constant(cases)
    field = fit_continuous(cases, constant).field
    model = RobotModel.of(arm, cell, ModelFile(stiffness_tables(field, constant.c_joint)))
    q = postures(128, seed=20, spread=0.0)
    wrench = loads(q, cell, arm, np.zeros(len(q), dtype=bool))
    solved = solve(model, arm, cell.tool.T_flange_tcp, q, wrench)
    true = twin.weight(solved.q) - twin.point(q)
    rng = np.random.default_rng(0)
    read = true + rng.normal(size=true.shape) * sigma * np.sqrt(2.0)
    floor = 1.596 * sigma * np.sqrt(2.0)  # mean length of what noise alone reads
    assert np.linalg.norm(read, axis=1).mean() <= 1.3 * floor


def test_grid_field_in_the_model_predicts_what_the_field_says(cell, arm, postures):
    from postproc.stiffness.cartesian import compliance
    from postproc.stiffness.field import Grid, GridField

    grid = Grid(np.array([1.5, -0.6, 0.5]), np.full(3, 0.6), (1, 2, 1))
    c = np.vstack([1.0 / K_PAPER, 2.0 / K_PAPER])
    field = GridField(grid, c)
    model = RobotModel.of(arm, cell, ModelFile(stiffness_tables(field, c.mean(axis=0))))
    q = postures(30)
    wrench = loads(q, cell, arm, np.zeros(30, dtype=bool))
    C = compliance(arm.jacobian(q, TCP), field.compliance(q, model.nominal(q)))
    expected = (C @ wrench[..., None])[..., 0]
    np.testing.assert_allclose(model.displacement(q, wrench), expected[:, :3], atol=5e-6)


def test_plan_is_shifted_and_says_so(cell, arm, postures, tmp_path):
    q = np.linspace(postures(1)[0], postures(2, seed=1)[1], 12)
    cut = replace(cell, process=Process((-400.0, 0, 0)))
    plan = plan_of(cut, arm, q)
    done = compensate(plan, cut, constant_model(tmp_path / "model.toml"))
    assert not done.errors
    shift = np.linalg.norm(done.compensation, axis=1)
    assert 1e-4 < shift.max() < 5e-3
    np.testing.assert_allclose(
        done.T_base_tcp[:, :3, 3], plan.T_base_tcp[:, :3, 3] + done.compensation, atol=1e-12
    )
    np.testing.assert_array_equal(done.T_base_tcp[:, :3, :3], plan.T_base_tcp[:, :3, :3])
    commanded = cut.workpiece.T_robroot_base @ done.T_base_tcp
    real = arm.fk(done.q) @ cut.tool.T_flange_tcp
    np.testing.assert_allclose(commanded, real, atol=1e-9)
    for words in ("model.toml", "50 kg", "-400 0 0 N", "mm"):
        assert words in done.compensation_note
    assert str(tmp_path) not in done.compensation_note
    # the real tool lands on the CAM points
    working = np.isin(done.role, (MoveRole.CUT,))
    file = load_model(tmp_path / "model.toml")
    still, process = np.zeros_like(done.q), working[:, None] * cut.process.wrench_tcp
    moved = RealArm.of(cut, file).displacement(Moments(done.q, still, directions(done.q), process))
    landed = real[:, :3, 3] + moved
    target = (cut.workpiece.T_robroot_base @ plan.T_base_tcp)[:, :3, 3]
    assert np.linalg.norm(landed - target, axis=1).max() < 1e-6


def test_way_points_of_arcs_are_shifted_too(cell, arm, postures, tmp_path):
    q = np.linspace(postures(1)[0], postures(2, seed=1)[1], 6)
    plan = plan_of(cell, arm, q)
    kind = np.array(plan.kind)
    kind[3] = MoveKind.CIRC
    aux = np.array(plan.aux)
    aux[3] = 0.5 * (plan.T_base_tcp[2, :3, 3] + plan.T_base_tcp[3, :3, 3]) + [0.0, 0.0, 0.002]
    done = compensate(replace(plan, kind=kind, aux=aux), cell, constant_model(tmp_path / "m.toml"))
    moved = done.aux[3] - aux[3]
    ends = 0.5 * (done.compensation[2] + done.compensation[3])
    np.testing.assert_allclose(moved, ends, atol=0.1 * np.linalg.norm(ends))


def test_a_pose_that_compensation_pushes_over_a_limit_is_an_error(cell, arm, postures, tmp_path):
    q = postures(3)
    robot = replace(
        cell.robot,
        q_max=np.where(np.arange(6) == 1, q[:, 1].max(), cell.robot.q_max),
        q_min=np.where(np.arange(6) == 1, q[:, 1].max() - 1e-9, cell.robot.q_min),
    )
    tight = replace(cell, robot=robot)
    done = compensate(plan_of(tight, arm, q), tight, constant_model(tmp_path / "m.toml"))
    assert {finding.code for finding in done.errors} == {"PLN102"}


def test_a_model_without_reason_is_refused(cell, arm, postures, tmp_path):
    with pytest.raises(DataError, match="CMP001"):
        compensate(
            plan_of(cell, arm, postures(3)),
            cell,
            constant_model(tmp_path / "m.toml", 1e4 / K_PAPER),
        )


def test_an_offset_of_no_arm_is_refused_by_its_line_however_far_it_was_measured(
    cell, arm, postures, tmp_path
):
    path, q = tmp_path / "m.toml", postures(3)
    reach = Reach.around(np.random.default_rng(0).normal(9.0, 1.0, (30, 6)), 1.0, 1e-5, 2.0, {})
    offset = {"offset_deg": [0.0, 1e9, 0.0, 0.0, 0.0, 0.0]}
    arms = stiffness_tables(ConstantField(1.0 / K_PAPER), 1.0 / K_PAPER)
    path.write_bytes(save_model(ModelFile({**arms, "joint_offset": offset}, reach=reach)))
    line = path.read_text().splitlines().index("[effects.joint_offset]") + 1
    with pytest.raises(DataError, match=f"m.toml:{line}: error CMP001"):
        compensate(plan_of(cell, arm, q), cell, str(path))


def test_unseen_joints_take_the_cells_stiffness(cell, arm, postures, tmp_path):
    from postproc.compensation.real_arm import compensation_model

    c = 1.0 / K_PAPER
    c = np.where(np.arange(6) == 0, np.nan, c)
    path = tmp_path / "m.toml"
    path.write_bytes(save_model(ModelFile(stiffness_tables(ConstantField(c), c))))
    q = postures(5)
    side = np.tile([0.0, 500.0, 0.0, 0.0, 0.0, 0.0], (5, 1))
    helped = compensation_model(arm, cell, load_model(path)).displacement(q, side)
    full = RobotModel.of(arm, cell, load_model(constant_model(tmp_path / "f.toml")))
    np.testing.assert_allclose(helped, full.displacement(q, side), atol=1e-9)


def test_frames_of_the_workpiece_do_not_matter(cell, arm, postures, tmp_path):
    q = postures(4)
    name = constant_model(tmp_path / "m.toml")
    turned = replace(
        cell,
        bases=(
            replace(
                cell.workpiece,
                T_robroot_base=transform(np.diag([-1.0, -1.0, 1.0]), [2.0, 0.3, 0.1]),
            ),
        ),
    )
    one, two = (compensate(plan_of(c, arm, q), c, name) for c in (cell, turned))
    np.testing.assert_allclose(one.q, two.q, atol=1e-10)


def test_each_operation_has_its_own_force(cell, arm, postures, tmp_path):
    from postproc.compensation.compensate import process_of
    from postproc.model.toolpath import Operation

    own = replace(cell, process=Process((-50.0, 0, 0), operations={"ROUGH": np.full(6, 7.0)}))
    plan = plan_of(own, arm, postures(4))
    path = replace(
        plan.toolpath,
        operation=np.array([0, 0, 1, -1]),
        operations=(Operation("ROUGH"), Operation("FINISH")),
    )
    plan = replace(plan, toolpath=path)
    np.testing.assert_array_equal(process_of(plan, own)[:, 0], [7.0, 7.0, -50.0, -50.0])
    done = compensate(plan, own, constant_model(tmp_path / "m.toml"))
    assert "loads of 2 kinds" in done.compensation_note


def test_loads_of_operations_come_from_the_cell_file(cell_path, tmp_path):
    from postproc.cell.file import load_cell

    path = tmp_path / "cell.toml"
    text = cell_path.read_text(encoding="utf-8")
    path.write_text(
        text + '[process]\nforce_N = [1, 2, 3]\n[[process.operations]]\nname = "ROUGH"\n'
        "force_N = [4, 5, 6]\nmoment_Nm = [7, 8, 9]\n",
        encoding="utf-8",
    )
    process = load_cell(path).process
    assert process.wrench_of("ROUGH").tolist() == [4, 5, 6, 7, 8, 9]
    assert process.wrench_of("other").tolist() == [1, 2, 3, 0, 0, 0]
