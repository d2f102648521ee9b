"""Outlines of arms: which body an arm gets, and that checks say where it is another one's."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from postproc.cell import RobotSolids, load_cell, load_robot, robot_names
from postproc.cell.cell import MeshPlacement, Tool
from postproc.cli import app
from postproc.collision import Scene
from postproc.collision.inside import InsideTest, parts_of
from postproc.collision.links import default_links
from postproc.collision.outlines import DIRECTIONS, is_measured, octagon, upright_solids
from postproc.collision.pairs import neutral_poses
from postproc.collision.pieces import Pieces
from postproc.kinematics import build
from tests.cells import cell_text
from tests.collision.conftest import at, cell_of
from tests.places import snapshot
from tools.outlines.meeting import meeting
from tools.outlines.meshes import real_arms


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
        ("kuka_kr500_r2830", "outline", 1),
        ("kuka_kr6_r900_sixx", "outline", 1),
        ("kuka_kr6_r900_sixx", "simple", 1),
    ],
)
def test_outlines_that_meet_where_the_arm_does_not_are_tested_smaller(
    name, solids, told, tmp_path, capsys
):
    speeds = f'model = "{name}"\nspeed_deg_s = {[50] * 6}\nsolids = "{solids}"\n'
    text = cell_text(robot=name).replace(f'model = "{name}"\n', speeds)
    (tmp_path / "cell.toml").write_text(text)
    cell = load_cell(tmp_path / "cell.toml")
    scene = Scene.build(cell, build(cell.robot))
    tested = dict(zip(scene.pairs, scene.pair_bodies, strict=True))
    for names, smaller in ((("link 0", "link 2"), 0.9), (("link 2", "link 4"), 0.87)):
        for body in tested[names]:
            full = next(one for one in scene.bodies if one.name == body.name)
            share = np.ptp(body.vertices, axis=0) / np.ptp(full.vertices, axis=0)
            np.testing.assert_allclose(share, smaller if told else 1.0)
    app.run(["check", str(tmp_path / "cell.toml"), "--json"])
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert [f["code"] for f in findings].count("CEL145") == told


@pytest.mark.slow
def test_no_built_in_arm_has_links_that_are_not_tested():
    for name in robot_names():
        robot = load_robot(name)
        scene = Scene.build(replace(cell_of(), robot=robot), build(robot))
        assert robot.solids is RobotSolids.OUTLINE
        assert scene.excluded == (), name
        neutral = neutral_poses(robot.q_min, robot.q_max)
        assert not np.isfinite(neutral).all() or not scene.check(neutral).hit.any(), name


@pytest.mark.parametrize(
    "name",
    [
        "kuka_kr210_r2700_extra",
        "kuka_kr180_r2500_extra",
        "kuka_kr60_3",
        "kuka_kr22_r1610",
        "kuka_kr16_arc_hw",
    ],
)
def test_a_flange_folded_to_the_stops_of_a5_is_free_of_the_forearm(name):
    """No real arm of 50 meets itself there."""
    robot = load_robot(name)
    scene = Scene.shared(replace(cell_of(), robot=robot), build(robot))
    q = np.zeros((14, 6))
    q[:, 1], q[:, 2] = -np.pi / 2, np.pi / 2
    q[:, 3] = np.tile(np.linspace(-np.pi, np.pi, 7), 2)
    q[:, 4] = np.repeat([robot.q_min[4], robot.q_max[4]], 7)
    hits = scene.check(q)
    met = {hits.pairs[pair] for pair in hits.pair[hits.hit]}
    assert ("link 3", "link 6") not in met


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kuka_kr6_r900_2", "kuka_kr10_r900_2", "kuka_kr16_r1610_2"])
def test_light_arms_that_meet_themselves_are_seen(name):
    """Against the real bodies, by coal, over all of A1 and A2, and of A3 and A4."""
    arms = dict(real_arms(snapshot("kroshu/kuka_robot_descriptions")))
    for pair, ours, real in meeting(name, arms[name], 19):
        assert (real & ~ours).mean() < 0.003, pair
        assert (ours & ~real).mean() < 0.04, pair


def test_a_scene_kept_at_a_distance_tells_the_same_whenever_it_is_made():
    cell = replace(cell_of(), robot=load_robot("kuka_kr10_r1100_2"))
    scene = Scene.build(cell, build(cell.robot))
    before = scene.kept(0.01)
    after = scene.kept(0.01)
    assert before.findings == after.findings == scene.findings
    assert len(before.pair_bodies) == len(after.pair_bodies) == len(scene.pairs)


def test_simple_solids_enclose_the_outlines():
    """One set of measurements: a hull of each link. What hits the outline hits the hull as well."""
    rng = np.random.default_rng(5)
    for name in robot_names()[::12]:
        robot = load_robot(name)
        if not np.isfinite(robot.q_min).all():
            continue
        arm = build(robot)
        q = np.clip(rng.uniform(-np.pi, np.pi, (200, 6)), robot.q_min, robot.q_max)
        knobs = [
            MeshPlacement(f"knob {k}", at(*place), size=np.full(3, 0.008))
            for k, place in enumerate(rng.uniform([-2.0, -2.0, 0.0], [2.0, 2.0, 2.5], (12, 3)))
        ]
        cell = replace(cell_of(obstacles=knobs), tools=(Tool(1, "tool", at(), np.eye(3)[2]),))
        outline, simple = (
            Scene.build(replace(cell, robot=replace(robot, solids=solids)), arm).check(q).hit
            for solids in (RobotSolids.OUTLINE, RobotSolids.SIMPLE)
        )
        assert not (outline & ~simple).any(), name
        assert outline.any()
        for hull, link in zip(
            default_links(replace(robot, solids=RobotSolids.SIMPLE), arm),
            default_links(robot, arm),
            strict=True,
        ):
            assert len(parts_of(hull).closed) == 1
            assert InsideTest(hull, parts_of(hull)).contains(link.vertices.mean(axis=0)[None]).all()


@pytest.mark.slow
def test_outlines_are_convex_pieces():
    """Each frustum of every arm is closed, turned outwards and on one side of all its faces."""
    for name in robot_names():
        robot = load_robot(name)
        for link in upright_solids(robot, robot.geometry):
            for piece in link:
                pieces = Pieces.of(piece, parts_of(piece))
                assert parts_of(piece).oriented.all(), name
                assert pieces.is_convex.tolist() == [True], name


def test_the_octagon_within_a_reach():
    """Against linear programs: the farthest point within eight half planes."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        reach = rng.uniform(0.1, 0.3, 8)
        corners = octagon(reach)
        assert (corners @ DIRECTIONS.T <= reach + 1e-12).all()
        for direction in rng.normal(size=(6, 2)):
            best = linprog(-direction, DIRECTIONS, reach, bounds=(None, None))
            assert (corners @ direction).max() == pytest.approx(-best.fun, abs=1e-9)
