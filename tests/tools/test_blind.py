"""The withheld-effect check: its robots against other libraries, its answers, its marks."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from postproc.cell.file import load_cell
from postproc.kinematics import build
from tests.places import ROOT
from tools.blind import answerers, names, table
from tools.blind.__main__ import main, score
from tools.blind.beyond import OUTSIDE, make
from tools.blind.campaign import DESIGNS, Plan, drive
from tools.blind.cases import draw, kinds, wanted
from tools.blind.chain import JOINTS, SCREWS, Geometry, columns, embed, solve_pose, sweep, torques
from tools.blind.effects import LIBRARY
from tools.blind.judging import judge
from tools.blind.robots import CLASSES, COBOT, RobotClass, cell_text, urdf
from tools.blind.world import Hidden, nominal, simulate
from tools.blind.writing import generate, write_case

PLAN = Plan("wide_loads", 60, "three", 0.5, False, 0, False, 8.0)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("blind")
    generate(folder, 6, 5)
    return folder


def pinocchio_arm(robot: RobotClass) -> pin.Model:
    """The arm by joint placements, with its masses and without elastic screws."""
    model, arm, parent, before = pin.Model(), robot.arm, 0, np.zeros(3)
    for k in range(6):
        joint = pin.JointModelRevoluteUnaligned(arm.axis[k])
        placement = pin.SE3(np.eye(3), arm.point[k] - before)
        parent = model.addJoint(parent, joint, placement, f"j{k + 1}")
        body = pin.Inertia(arm.mass[k], arm.com[k] - arm.point[k], np.eye(3) * 1e-3)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        before = arm.point[k]
    flange = pin.SE3(arm.flange[:3, :3], arm.flange[:3, 3] - before)
    model.addFrame(pin.Frame("flange", parent, 0, flange, pin.FrameType.OP_FRAME))
    return model


def some_angles(robot: RobotClass, count: int = 20) -> np.ndarray:
    low, high = np.deg2rad(robot.range_deg).T
    return np.random.default_rng(3).uniform(low, high, (count, 6))


@pytest.mark.parametrize("robot", CLASSES, ids=lambda robot: robot.name)
def test_poses_jacobians_and_torques_are_those_of_pinocchio(robot: RobotClass) -> None:
    model = pinocchio_arm(robot)
    data, q = model.createData(), some_angles(robot)
    poses = sweep(Geometry.of(robot.arm, len(q)), embed(q))
    J = columns(poses, poses.flange_p)
    down = [0.0, 0.0, -9.80665]
    own = np.zeros((len(q), len(SCREWS)))
    for k in range(6):
        at = poses.body_point(int(JOINTS[k]), robot.arm.com[k])
        own += torques(
            poses, int(JOINTS[k]), at, np.tile(robot.arm.mass[k] * np.array(down), (20, 1))
        )
    model.gravity.linear = np.array(down)
    for row in range(len(q)):
        pin.computeJointJacobians(model, data, q[row])
        pin.updateFramePlacements(model, data)
        pose = data.oMf[model.getFrameId("flange")]
        np.testing.assert_allclose(poses.flange_p[row], pose.translation, atol=1e-12)
        np.testing.assert_allclose(poses.flange_turn[row], pose.rotation, atol=1e-12)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        outside = pin.getFrameJacobian(model, data, model.getFrameId("flange"), frame)
        np.testing.assert_allclose(J[row], outside[:3], atol=1e-12)
        holding = pin.computeGeneralizedGravity(model, data, q[row])
        np.testing.assert_allclose(own[row, JOINTS], -holding, atol=1e-8)


@pytest.mark.parametrize("robot", CLASSES, ids=lambda robot: robot.name)
def test_the_product_is_given_the_same_nominal_arm(robot: RobotClass, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(cell_text(robot, 1 / robot.arm.give), encoding="utf-8")
    (tmp_path / "robot.urdf").write_text(urdf(robot), encoding="utf-8")
    cell = load_cell(tmp_path / "cell.toml")
    rows = drive(robot, PLAN, np.random.default_rng(1))
    T = build(cell.robot).fk(rows.q) @ cell.tool.T_flange_tcp
    np.testing.assert_allclose(T[:, :3, 3], nominal(robot, rows), atol=1e-7)


def test_poses_of_patches_are_reached() -> None:
    start = np.deg2rad(COBOT.start_deg)
    at = sweep(Geometry.of(COBOT.arm, 1), embed(start[None]))
    goal = at.flange_p + np.array([0.05, -0.08, 0.04])
    q, good = solve_pose(COBOT.arm, goal, at.flange_turn, start)
    assert good.all()
    reached = sweep(Geometry.of(COBOT.arm, 1), embed(q))
    np.testing.assert_allclose(reached.flange_p, goal, atol=1e-8)


def test_the_equilibrium_is_one() -> None:
    """The deflection of the loaded arm equals the give times the torque in the deflected pose."""
    robot = CLASSES[0]
    rows = drive(robot, PLAN, np.random.default_rng(2))
    numbers = {"factor": np.full(6, 2.0), "hardening": np.zeros(1)}
    stiff = Hidden("joint_compliance", numbers, 1.0, LIBRARY["joint_compliance"].change)
    outcome = simulate(robot, rows, [stiff])
    J = columns(outcome.poses, outcome.point)
    torque = np.einsum("nij,ni->nj", J, rows.force)
    given = outcome.joints - rows.q
    np.testing.assert_allclose(given, 2.0 * robot.arm.give * torque, rtol=1e-9, atol=1e-14)
    assert 1e-4 < np.abs(outcome.point - nominal(robot, rows)).max() < 1e-2


@pytest.mark.parametrize("name", [*LIBRARY, *OUTSIDE])
def test_every_effect_moves_the_tool_by_a_real_amount(name: str) -> None:
    robot = CLASSES[0]
    plan = replace(PLAN, moving=True)
    rows = drive(robot, plan, np.random.default_rng(4))
    stiff = Hidden(
        "joint_compliance",
        {"factor": np.ones(6), "hardening": np.zeros(1)},
        1.0,
        LIBRARY["joint_compliance"].change,
    )
    carrier = [stiff] if name in ("variable_stiffness", "hardening", "link_bending") else []
    effect = make(name, np.random.default_rng(5), robot, rows)
    moved = simulate(robot, rows, [*carrier, effect]).point - simulate(robot, rows, carrier).point
    assert 1e-5 < np.sqrt(np.mean(moved**2)) < 5e-3
    none = make(name, np.random.default_rng(5), robot, rows).scaled(0.0)
    if name not in ("joint_compliance", "hardening"):
        still = simulate(robot, rows, [*carrier, none]).point - simulate(robot, rows, carrier).point
        assert np.abs(still).max() < 1e-12


def test_no_code_is_shared_with_the_product() -> None:
    for path in (ROOT / "tools" / "blind").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = [node.module] if isinstance(node, ast.ImportFrom) else []
                modules += [alias.name for alias in node.names]
                assert not any(str(name).split(".")[0] == "postproc" for name in modules), path


def test_the_mix_is_that_of_the_benchmark_and_covers_every_effect() -> None:
    mix = kinds(200, 1)
    assert {kind: mix.count(kind) for kind in set(mix)} == {
        **{"none": 40, "one": 60, "two": 40},
        **{"three": 20, "outside": 40},
    }
    hands = wanted(mix, 1)
    dealt = [name for hand in hands for name in hand]
    assert {*LIBRARY, *OUTSIDE, "hidden_column"} == set(dealt)
    assert all(len(set(hand)) == len(hand) for hand in hands)


def test_a_case_is_that_of_its_seed(campaign: Path, tmp_path: Path) -> None:
    mix = kinds(6, 5)
    hands = wanted(mix, 5)
    sealed = json.loads((campaign / "answers.json").read_text(encoding="utf-8"))["cases"]
    for number in (1, 4):
        again = draw(number, mix[number - 1], hands[number - 1], 5)
        assert write_case(tmp_path / f"{number:04d}", again, 5) == sealed[number - 1]
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) >= 2 * 4
    for path in files:
        there = campaign / "cases" / path.relative_to(tmp_path)
        assert path.read_bytes() == there.read_bytes(), path
    other = draw(1, "one", ("backlash",), 6)
    assert not np.array_equal(other.rows.q, draw(1, "one", ("backlash",), 7).rows.q)


def test_the_answer_is_not_among_what_the_product_reads(campaign: Path) -> None:
    answers = json.loads((campaign / "answers.json").read_text(encoding="utf-8"))["cases"]
    assert [answer["kind"] for answer in answers] == kinds(6, 5)
    for answer in answers:
        seen = {path.name for path in (campaign / "cases" / answer["case"]).iterdir()}
        allowed = {"measured.csv", "fresh.csv", "transfer.csv", "cell.toml"}
        assert allowed <= seen <= allowed | {"robot.urdf", "known.toml"}
        for t in answer["truth"]:
            if t["role"] == "planned":
                assert t["size_sigma"] > 2.5


@pytest.mark.parametrize("design", DESIGNS)
def test_designs_have_the_rows_asked_for(design: str) -> None:
    plan = replace(PLAN, design=design, rows=70, repeats=12)
    rows = drive(CLASSES[1], plan, np.random.default_rng(8))
    assert len(rows.q) == 70
    assert np.all(np.diff(rows.time) > 0)
    assert len(np.unique(rows.q.round(9), axis=0)) < 70


def marks_of(truth: list[dict[str, object]], adopted: list[str], **more: object) -> dict:
    answer = {
        **{"case": "0001", "kind": "one", "registered": False, "noise_mm": 0.02},
        **{"truth": truth, "joint_share": None, "joints_explain": None},
        "joint_Nmm_per_rad": [1e9] * 6,
    } | more
    effects = [{"name": name, "adopted": True, "confounded_with": []} for name in adopted]
    diagnosis = {"verdict": "explained", "adopted": adopted, "effects": effects}
    return judge(answer, {"diagnosis": diagnosis, "seconds": 1.0})


def hidden(name: str, size: float, weight: str = "true", **more: object) -> dict[str, object]:
    told = {"name": name, "role": "planned", "weight": weight, "outside": name in OUTSIDE}
    return told | {"size_sigma": size, "strength": 1.0, "parameters": {}} | more


def test_marks_of_a_case() -> None:
    two = [hidden("gravity_sag", 12.0), hidden("servo_lag", 5.0)]
    marks = marks_of(two, ["servo_lag", "counterbalance"])
    assert (marks["top1"], marks["top2"], marks["recall"]) == (False, False, [False, True])
    assert marks["wrong"] == ["counterbalance"]
    varying = [hidden("joint_compliance", 20.0), hidden("variable_stiffness", 8.0)]
    assert marks_of(varying, ["variable_stiffness"])["top1"]
    assert not marks_of([hidden("variable_stiffness", 8.0)], ["joint_compliance"])["top1"]
    small = [hidden("backlash", 9.0), hidden("base_frame", 1.0, "nuisance", role="background")]
    assert marks_of(small, ["backlash", "base_frame"])["wrong"] == []
    assert marks_of(small, ["backlash", "base_frame"], registered=True)["wrong"] == ["base_frame"]


def test_marks_of_what_no_library_holds() -> None:
    hose = [hidden("hose_pull", 10.0)]
    assert not marks_of(hose, ["gravity_sag"], kind="outside")["abstained"]
    assert marks_of(hose, [], kind="outside")["said_unexplained"] is False
    windup = marks_of([hidden("windup", 10.0)], ["friction_windup"], kind="outside")
    assert windup["abstained"]
    assert windup["said_unexplained"]
    unseen = [hidden("backlash", 10.0, outside=True)]
    assert not marks_of(unseen, ["backlash"], kind="outside")["said_unexplained"]


def test_blind_answerers_score_badly(tmp_path: Path) -> None:
    """Drawn answers without data are enough: 200 cases of the mix."""
    mix = kinds(200, 1)
    cases = []
    for number, (kind, hand) in enumerate(zip(mix, wanted(mix, 1), strict=True), start=1):
        truth = [hidden(name, 10.0) for name in hand if name != "hidden_column"]
        cases.append(
            {
                **{"case": f"{number:04d}", "kind": kind, "truth": truth, "registered": False},
                **{"noise_mm": 0.03, "joint_share": None, "joints_explain": None},
                **{"design": "wide_loads", "loads": "three"},
                "joint_Nmm_per_rad": [1e9] * 6,
            }
        )
    (tmp_path / "answers.json").write_text(json.dumps({"seed": 1, "cases": cases}))
    got = {name: score(tmp_path, name)[1]["summary"]["all"] for name in answerers.NAMES}
    for name in answerers.NAMES:
        assert (got[name]["top-1, one effect"] or 0.0) < 0.2
        assert (got[name]["recall, two and three"] or 0.0) < 0.25
        assert (got[name]["precision"] or 0.0) < 0.35
    assert got["joint_compliance"]["no gap: false cause"] == 1.0
    assert got["joint_compliance"]["outside: no wrong name"] < 0.25
    assert got["random"]["no gap: false cause"] > 0.4
    assert got["no_gap"]["outside: unexplained or own name"] == 0.0
    assert got["unexplained"]["library: unexplained said"] == 1.0


def test_every_own_name_belongs_to_one_kind_of_effect() -> None:
    assert not {own for kind in OUTSIDE.values() for own in kind.own_names} & set(names.ALL)


def test_the_command_line_scores_a_blind_answerer(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["score", "-d", str(campaign), "--answerer", "no_gap"]) == 0
    assert "| cases | | 6 |" in capsys.readouterr().out
    whole = json.loads((campaign / "score_no_gap.json").read_text(encoding="utf-8"))
    assert whole["seed"] == 5


@pytest.mark.slow
def test_the_product_is_scored_through_its_command_line(campaign: Path) -> None:
    _, whole = score(campaign, "product", processes=1, first=1)
    assert not whole["cases"][0]["crashed"]
    assert (campaign / "runs" / "0001" / "record.json").is_file()


def test_how_often_named_causes_are_right_is_told_bin_by_bin():
    marks = [{"called": [(0.9, True)] * 8 + [(0.9, False)] * 2}, {"called": [(0.4, False)]}, {}]
    lines = table.reliability(marks).splitlines()[2:]
    # Wilson's interval for 8 of 10 at z = 1.6449, by hand
    assert lines == [
        "| 0 to 0.5 | 1 | 0.40 | 0.00 | 0.00 to 0.73 |",
        "| 0.8 to 0.95 | 10 | 0.90 | 0.80 | 0.54 to 0.93 |",
    ]
