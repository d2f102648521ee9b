"""Bodies, names, frames, pairs; solids of the links; URDF arms."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import RobotSolids
from postproc.cell.cell import MeshPlacement
from postproc.cell.robotfile import load_robot, robot_names
from postproc.cell.urdf.file import read_urdf_robot
from postproc.collision.bodies import WORLD
from postproc.collision.inside import parts_of
from postproc.collision.links import default_links
from postproc.collision.scene import Scene
from postproc.errors import CellError
from postproc.geometry.frames import apply, transform_from_kuka
from postproc.kinematics import build
from tests.arms import DETAILED
from tests.collision.conftest import at, box_at, cell_of, wavy_sheet, write_stl

NEUTRAL = np.deg2rad([[0.0] * 6, [0, -90, 90, 0, 0, 0], [0, -90, 90, 0, -60, 0]])


def test_names_kinds_and_frames(busy_cell, arm_of):
    arm = arm_of(busy_cell)
    scene = Scene.build(busy_cell, arm)
    names = [body.name for body in scene.bodies]
    assert names == [
        *(f"link {i}" for i in range(7)),
        "tool head.stl",
        "tool drill",
        "workpiece panel.stl",
        "obstacle post",
        "obstacle pipe",
        "obstacle floor",
    ]
    kinds = {body.name: body.kind for body in scene.bodies}
    assert kinds["tool drill"] == "cutting"
    assert kinds["tool head.stl"] == "tool"
    links = {body.name: body.link for body in scene.bodies}
    assert links["tool drill"] == 6
    assert links["obstacle floor"] == WORLD
    # the drill was given in the flange, the panel in CAM coordinates
    q = NEUTRAL[2]
    by_name = {body.name: body for body in scene.bodies}
    drill = by_name["tool drill"].vertices
    in_flange = apply(np.linalg.inv(arm.fk(q)) @ arm.link_frames(q)[6], drill)
    assert np.allclose(in_flange.mean(axis=0), [0.15, 0.0, 0.4])
    panel = by_name["workpiece panel.stl"].vertices
    T = np.linalg.inv(busy_cell.robot.T_world_robroot @ busy_cell.T_robroot_base)
    assert np.allclose(
        np.ptp(apply(T, panel), axis=0), np.ptp(wavy_sheet().vertices, axis=0), atol=1e-6
    )


def test_equal_names_are_told_apart(arm_of):
    clamp = box_at("clamp", [0.1, 0.1, 0.1], at(3.0))
    scene = Scene.build(
        cell_of(obstacles=[clamp, clamp, clamp]), build(load_robot("kuka_kr500_r2830"))
    )
    assert [b.name for b in scene.bodies][-3:] == [
        "obstacle clamp", "obstacle clamp (2)", "obstacle clamp (3)",
    ]  # fmt: skip


def linked(pairs):
    return {(int(a[-1]), int(b[-1])) for a, b in pairs if a[:4] == b[:4] == "link"}


def test_pairs_that_are_tested(busy_cell, arm_of):
    pairs = set(Scene.build(busy_cell, arm_of(busy_cell)).pairs)
    for i in range(1, 7):
        assert (f"link {i}", "workpiece panel.stl") in pairs
        assert (f"link {i}", "obstacle floor") in pairs
    assert ("link 0", "workpiece panel.stl") in pairs
    assert ("link 0", "obstacle floor") not in pairs
    for tool in ("tool head.stl", "tool drill"):
        assert {(f"link {i}", tool) for i in range(6)} <= pairs
        assert ("link 6", tool) not in pairs
    assert linked(pairs) == {(0, 2), (0, 3), (0, 4), (0, 5), (0, 6), (1, 3), (1, 4), (1, 5),
                             (1, 6), (2, 4), (2, 5), (2, 6), (3, 6)}  # fmt: skip
    robot = replace(busy_cell.robot, solids=RobotSolids.SIMPLE)
    hulls = set(Scene.build(replace(busy_cell, robot=robot), arm_of(busy_cell)).pairs)
    assert linked(hulls) == linked(pairs)
    assert ("tool head.stl", "tool drill") not in pairs


def test_links_that_touch_by_construction_are_left_out():
    robot = load_robot("kuka_kr500_r2830")
    arm = build(robot)
    meshes = [(i, MeshPlacement(f"link {i}", at(), size=np.full(3, 0.2))) for i in range(7)]
    origins = arm.link_frames(np.zeros(6))[:, :3, 3]
    middle = 0.5 * (origins[1] + origins[3]) - origins[1]
    meshes[1] = (1, MeshPlacement("link 1", at(*middle), size=np.array([2.5, 0.3, 2.5])))
    cell = cell_of()
    cell = replace(cell, robot=replace(cell.robot, link_meshes=tuple(meshes)))
    scene = Scene.build(cell, arm)
    assert ("link 1", "link 3") in scene.excluded
    assert not set(scene.excluded) & set(scene.pairs)
    assert ("link 0", "link 3") in scene.pairs
    assert any("COL104: link 1 and link 3 touch" in str(finding) for finding in scene.findings)


def test_own_link_meshes_replace_the_hulls(tmp_path):
    path = write_stl(tmp_path / "cover.stl", wavy_sheet())
    meshes = (
        (2, MeshPlacement("link 1", at(), path)),
        (2, MeshPlacement("arm", at(z=0.3), size=np.full(3, 0.2))),
        (0, MeshPlacement("link 3", at(), size=np.full(3, 0.2))),
    )
    cell = cell_of()
    cell = replace(cell, robot=replace(cell.robot, link_meshes=meshes))
    scene = Scene.build(cell, build(cell.robot))
    assert [b.name for b in scene.bodies] == ["link 0", "link 2 cover.stl", "link 2 arm"]
    assert [b.link for b in scene.bodies] == [0, 2, 2]


@pytest.mark.parametrize("kind", RobotSolids)
@pytest.mark.parametrize("name", DETAILED)
def test_hulls_of_built_in_arms(name, kind):
    robot = replace(load_robot(name), solids=kind)
    arm = build(robot)
    solids = default_links(robot, arm)
    assert len(solids) == 7
    frames = arm.link_frames(np.zeros(6))
    flange = arm.fk(np.zeros(6))[:3, 3]
    for mesh in solids:
        assert parts_of(mesh).closed.all()
    # links reach to the next axis, and nothing reaches past the flange
    for i in range(6):
        world = apply(frames[i], solids[i].vertices)
        following = frames[i + 1][:3, 3]
        assert (world.min(axis=0) < following + 0.3).all()
        assert (world.max(axis=0) > following - 0.3).all()
    last = apply(frames[6], solids[6].vertices)
    assert last[:, 0].max() == pytest.approx(flange[0], abs=1e-9)
    assert np.abs(last[:, 1]).max() < 0.2
    scene = Scene.build(replace(cell_of(robot=name), robot=robot), arm)
    assert scene.excluded == ()
    assert not scene.check(np.clip(NEUTRAL, robot.q_min, robot.q_max)).hit.any()
    q = np.random.default_rng(0).uniform(robot.q_min, robot.q_max, (2000, 6))
    hit = scene.check(q).hit
    if kind is RobotSolids.SIMPLE:  # hulls contain the outlines: coarser, never blinder
        outlines = replace(robot, solids=RobotSolids.OUTLINE)
        finer = Scene.build(replace(cell_of(robot=name), robot=outlines), build(outlines))
        assert not (finer.check(q).hit & ~hit).any()
    else:  # light arms do reach themselves: within their limits outlines say so of more than is so
        assert hit.mean() < 0.1


@pytest.mark.parametrize("name", robot_names())
def test_every_arm_has_an_outline(name):
    robot = load_robot(name)
    arm = build(robot)
    solids = default_links(replace(robot, solids=RobotSolids.OUTLINE), arm)
    frames, flange = arm.link_frames(np.zeros(6)), arm.fk(np.zeros(6))[:3, 3]
    for i, mesh in enumerate(solids):
        assert parts_of(mesh).closed.all()
        world = apply(frames[i], mesh.vertices)
        following = frames[i + 1][:3, 3] if i < 6 else flange
        assert (world.min(axis=0) < following + 0.3).all()
        assert (world.max(axis=0) > following - 0.3).all()
    assert apply(frames[6], solids[6].vertices)[:, 0].max() == pytest.approx(flange[0], abs=1e-9)


def test_a_robot_standing_elsewhere_meets_the_same_things(random_q):
    turn = transform_from_kuka([700, -400, 300], [50, 0, 0])
    post = box_at("post", [0.3, 0.3, 2.5], at(1.6, 0.8, 1.2))
    here = cell_of(obstacles=[post])
    there = cell_of(
        obstacles=[replace(post, T_owner_mesh=turn @ post.T_owner_mesh)], T_world_robroot=turn
    )
    q = random_q(400, seed=2)
    a, b = (Scene.build(cell, build(cell.robot)).check(q).pair for cell in (here, there))
    assert np.array_equal(a, b)
    assert (a >= 0).mean() > 0.03


def test_what_the_user_should_know(tmp_path):
    mesh = wavy_sheet()
    path = write_stl(tmp_path / "sheet.stl", replace(mesh, faces=mesh.faces[:900]))
    cell = cell_of(workpiece=[MeshPlacement("workpiece", at(2.0), path)])
    texts = [str(finding) for finding in Scene.build(cell, build(cell.robot)).findings]
    assert any("COL101: the tool has no solids" in text for text in texts)
    assert any("COL103: workpiece sheet.stl is not closed" in text for text in texts)


def test_a_broken_file_stops_the_scene(tmp_path):
    path = tmp_path / "bad.stl"
    path.write_bytes(b"not a mesh")
    cell = cell_of(obstacles=[MeshPlacement("fixture", at(), path)])
    with pytest.raises(CellError, match="not a whole STL"):
        Scene.build(cell, build(cell.robot))


def test_bodies_for_display(busy_cell, arm_of):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    shown = [body.coarse(500) for body in scene.bodies]
    assert [b.name for b in shown] == [b.name for b in scene.bodies]
    assert max(len(b.faces) for b in shown) <= 500 < max(len(b.faces) for b in scene.bodies)
    assert all(b.faces.max() < len(b.vertices) for b in shown)


URDF_JOINT = """<joint name="j{i}" type="revolute"><parent link="l{before}"/><child link="l{i}"/>
<origin xyz="{xyz}" rpy="0 0 0"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>"""
CHAIN = [("0 0 0.4", "0 0 1"), ("0.1 0 0", "0 1 0"), ("0 0 0.5", "0 1 0"),
         ("0 0 0.2", "0 0 1"), ("0 0 0.3", "0 1 0"), ("0 0 0.1", "0 0 1")]  # fmt: skip


def urdf(solids):
    """A six-axis arm; ``solids``: link name to collision geometry."""
    parts = ['<robot name="arm"><link name="world"/>']
    for name in [*(f"l{i}" for i in range(7)), "cover", "flange"]:
        parts.append(f'<link name="{name}">{solids.get(name, "")}</link>')
    parts += [URDF_JOINT.format(i=i + 1, before=i, xyz=xyz, axis=axis)
              for i, (xyz, axis) in enumerate(CHAIN)]  # fmt: skip
    fixed = '<joint name="f{0}" type="fixed"><parent link="{1}"/><child link="{0}"/>{2}</joint>'
    parts += [
        fixed.format("l0", "world", '<origin xyz="0 0 0.1"/>'),
        fixed.format("cover", "l3", '<origin xyz="0.2 0 0" rpy="0 0 1.5707963267948966"/>'),
        fixed.format("flange", "l6", '<origin xyz="0 0 0.05"/>'),
    ]
    return "\n".join([*parts, "</robot>"])


def geometry(inner, origin=""):
    return f"<collision>{origin}<geometry>{inner}</geometry></collision>"


def urdf_scene(tmp_path, solids):
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(solids), encoding="utf-8")
    robot = read_urdf_robot(path, "flange")
    cell = replace(cell_of(), robot=robot)
    return Scene.build(cell, build(robot))


def test_urdf_solids_are_taken_with_what_is_fixed_to_them(tmp_path):
    (tmp_path / "meshes").mkdir()
    write_stl(tmp_path / "meshes" / "arm.stl", wavy_sheet(), unit=1.0)
    scene = urdf_scene(
        tmp_path,
        {
            "l0": geometry('<cylinder radius="0.1" length="0.2"/>', '<origin xyz="0 0 0.1"/>'),
            "l1": geometry('<box size="0.1 0.1 0.1"/>'),
            "l2": geometry('<mesh filename="package://arm/meshes/arm.stl" scale="0.1 0.1 0.1"/>'),
            "l3": geometry('<sphere radius="0.05"/>'),
            "cover": geometry('<box size="0.02 0.1 0.01"/>'),
            "l4": geometry('<mesh filename="missing.dae"/>'),
        },
    )
    bodies = {body.link: body for body in scene.bodies}
    assert np.allclose(bodies[0].vertices[:, 2].min(), 0.1)
    assert np.ptp(bodies[2].vertices, axis=0)[0] == pytest.approx(0.12, abs=1e-6)
    third = bodies[3].vertices
    ball = third[np.linalg.norm(third, axis=1) < 0.1]
    assert 0.05 <= np.linalg.norm(ball, axis=1).min() < 0.056
    cover = third[third[:, 0] > 0.1]
    assert np.allclose(np.ptp(cover, axis=0), [0.1, 0.02, 0.01])
    texts = [str(finding) for finding in scene.findings]
    assert any("link 4: collision mesh 'missing.dae' is missing" in text for text in texts)
    assert any("link 5: no collision geometry" in text for text in texts)
    assert len(bodies) == 7


def test_urdf_hulls_follow_the_joints(tmp_path):
    scene = urdf_scene(tmp_path, {})
    reach = 0.1 + 0.5 + 0.2 + 0.3 + 0.1 + 0.05
    for body in scene.bodies:
        assert parts_of(body.mesh).closed.all()
        assert np.abs(body.vertices).max() < 0.75 * reach
    last = scene.bodies[6].vertices
    assert last[:, 2].max() == pytest.approx(0.05, abs=1e-5)
    assert not scene.check(np.deg2rad([[0, 20, 60, 0, 30, 0]])).hit.any()


@pytest.mark.parametrize("shape", ['<box size="1 0 1"/>', '<sphere radius="-1"/>', "<sphere/>"])
def test_urdf_sizes_are_checked(shape, tmp_path):
    with pytest.raises(CellError) as caught:
        urdf_scene(tmp_path, {"l1": geometry(shape)})
    assert caught.value.code in ("COL006", "CEL011")
    assert caught.value.source.path.endswith("arm.urdf")


def test_a_tool_folded_back_stands_in_the_forearm(arm_of):
    plate = box_at("plate", [0.1, 0.7, 0.04], at(0.0, 0.1, 0.03))
    back = box_at("back", [0.08, 0.08, 0.9], at(-0.05, 0.3, -0.35))
    scene = Scene.build(cell_of(tool=[plate, back]), arm_of(cell_of(tool=[plate, back])))
    q = np.tile([0.0, -1.2, 1.4, 0.0, 0.4, 0.0], (72, 1))
    q[:, 5] = np.linspace(-np.pi, np.pi, 72)
    hits = scene.check(q)
    named = {hits.name(row) for row in np.flatnonzero(hits.hit)}
    assert named & {"link 3 and tool back", "link 4 and tool back"}
    assert not hits.hit.all()


def test_a_tool_that_overlaps_the_wrist_in_every_pose_is_named_and_tested_thinner(arm_of):
    cell = cell_of(tool=[box_at("head", [0.3, 0.3, 0.6], at(0.0, 0.0, 0.2))])
    scene = Scene.build(cell, arm_of(cell))
    told = [str(finding) for finding in scene.findings if finding.code == "COL105"]
    assert "link 5 and tool head overlap in every pose" in told[0]
    assert ("link 5", "tool head") in scene.pairs or ("link 5", "tool head") in scene.excluded
    thin = next(
        one for one, two in scene.pair_bodies if (one.name, two.name) == ("link 5", "tool head")
    )
    full = next(body for body in scene.bodies if body.name == "link 5")
    assert np.ptp(thin.vertices, axis=0).max() < 0.9 * np.ptp(full.vertices, axis=0).max()
    assert not scene.check(np.zeros((1, 6))).hit[0]


@pytest.mark.parametrize("gap", [-0.004, 0.004])
def test_the_point_where_two_solids_meet(gap):
    turn = transform_from_kuka([700, -400, 300], [50, 0, 0])
    rod = box_at("rod", [0.04, 0.04, 0.2], at(0, 0, 0.1))
    cell = cell_of(tool=[rod], T_world_robroot=turn)
    arm = build(cell.robot)
    q = NEUTRAL[2]
    tip = arm.fk(q) @ at(0, 0, 0.2)
    post = box_at("post", [0.1, 0.1, 0.1], turn @ tip @ at(0.03, -0.03, 0.05 + gap))
    scene = Scene.build(replace(cell, obstacles=(post,)), arm)
    pair = scene.pairs.index(("tool rod", "obstacle post"))
    point = np.linalg.inv(tip) @ [*scene.meeting_point(q, pair), 1.0]
    # the end of the rod is seen by the post from x -0.02 to 0.02, y 0.02 to -0.02
    assert np.all(np.abs(point[:2]) <= 0.02 + 1e-9)
    assert point[2] == pytest.approx(gap / 2, abs=abs(gap) / 2 + 1e-9)
