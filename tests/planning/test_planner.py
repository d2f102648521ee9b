"""Whole plans of small made-up jobs: what every plan must keep, and what each strategy promises."""

from __future__ import annotations

import socket
from dataclasses import replace
from traceback import walk_stack

import numpy as np
import pytest

from postproc.cell import Preset, parse_cell
from postproc.cell.cell import MeshPlacement, Tool, Workpiece
from postproc.geometry.frames import angle_between, rotation_y
from postproc.kinematics import build
from postproc.ladder import Ladder
from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import Arcs, Cycle, Event, EventKind, MotionKind
from postproc.planning.planner import plan
from postproc.planning.states.settings import (
    PlanOptions,
    settle,
)
from postproc.units import DEG
from tests.cells import FEED, STIFFNESS, cell_text
from tools.bench.paths import bare_path

FRONT = np.array([-1.0, 0.0, 0.0])


def row_of_holes(make_path, n=12, cycle=None, **changes):
    points = np.stack([np.full(n, 1.9), np.linspace(-0.5, 0.5, n), np.full(n, 1.0)], axis=1)
    cycles = (cycle or Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),)
    changes = {"cycle": np.zeros(n, int), "cycles": cycles} | changes
    return make_path(points, FRONT, MotionKind.HOLE, **changes)


def check_invariants(result, cell):
    """What holds for every plan, whatever was asked."""
    kinematics = build(cell.robot)
    T = kinematics.fk(result.q) @ cell.tool.T_flange_tcp
    want = cell.T_robroot_base @ result.T_base_tcp
    assert np.abs(T - want).max(initial=0.0) < 1e-9
    assert kinematics.within_limits(result.q).all()
    assert (np.diff(result.tag) >= 0).all()
    path = result.kind != MoveKind.PTP
    assert not path[:1].any()
    slots = kinematics.slot(result.q)
    assert (slots[1:][path[1:]] == slots[:-1][path[1:]]).all()
    assert (np.abs(np.diff(result.q, axis=0))[path[1:]] < np.pi).all()
    assert np.isfinite(result.speed[path]).all()
    assert (result.speed[path] > 0.0).all()
    assert np.isnan(result.speed[~path]).all()
    assert (result.ptp_fraction[~path] > 0.0).all()
    assert (result.duration >= 0.0).all()
    assert result.blend[-1:].sum() == 0.0
    assert np.isfinite(result.aux[result.kind == MoveKind.CIRC]).all()


def tags_are_met(result, where):
    """The tool tip and the tool axis of moves ``where`` are those of their tags."""
    toolpath = result.toolpath
    tag = result.tag[where]
    assert np.allclose(result.T_base_tcp[where, :3, 3], toolpath.points[tag], atol=1e-12)


@pytest.mark.usefixtures("no_scene")
def test_few_calls_lead_from_the_plan_to_the_first_sweep(make_cell, make_path, monkeypatch):
    """A reader follows one tag from the plan to the ladder: what only hands on has gone."""
    own, chains = Ladder.solve, []

    def seen(ladder):
        frames = (frame.f_code for frame, _ in walk_stack(None))
        chains.append([code.co_name for code in frames if "postproc" in code.co_filename])
        own(ladder)

    monkeypatch.setattr(Ladder, "solve", seen)
    plan(row_of_holes(make_path, n=2), make_cell())
    assert len([name for name in chains[0] if name != "seen" and "test_" not in name]) <= 8


@pytest.mark.usefixtures("no_scene")
class TestHoles:
    def test_stroke(self, make_cell, make_path):
        cell, toolpath = make_cell(), row_of_holes(make_path)
        result = plan(toolpath, cell)
        check_invariants(result, cell)
        assert not result.errors
        assert len(result) == 12 * 4
        first = result.role[:4].tolist()
        assert first == [MoveRole.ENTRY, MoveRole.APPROACH, MoveRole.PLUNGE, MoveRole.RETRACT]
        height = (result.T_base_tcp[:4, :3, 3] - toolpath.points[0]) @ FRONT
        assert np.allclose(height, [0.01, 0.002, -0.006, 0.01], atol=1e-12)
        plunge = result.role == MoveRole.PLUNGE
        assert np.allclose(result.speed[plunge], 0.002)
        before = np.nonzero(plunge)[0] - 1
        assert (result.blend[plunge] == 0.0).all()
        assert (result.blend[before] == 0.0).all()
        axis = result.T_base_tcp[:, :3, :3] @ cell.tool.axis
        assert angle_between(axis, -FRONT).max() < 1e-9

    def test_pecks_and_dwell(self, make_cell, make_path):
        cycle = Cycle(
            "deep", 0.010, 0.002, 0.002, peck_first=0.004, peck=0.003, dwell=0.5, feed=0.001
        )
        result = plan(row_of_holes(make_path, n=2, cycle=cycle), make_cell())
        check_invariants(result, make_cell())
        mine = result.tag == 0
        height = (result.T_base_tcp[mine, :3, 3] - result.toolpath.points[0]) @ FRONT
        plunges = height[result.role[mine] == MoveRole.PLUNGE]
        assert np.allclose(plunges, [-0.004, -0.007, -0.010])
        assert result.dwell[mine].sum() == pytest.approx(0.5)
        assert result.dwell[mine][result.role[mine] == MoveRole.PLUNGE][-1] == 0.5

    def test_points_without_a_cycle_are_touched(self, make_cell, make_path):
        toolpath = row_of_holes(make_path, n=3)
        toolpath = replace(
            toolpath, format="csv", kind=np.full(3, MotionKind.LINEAR), cycle=np.full(3, -1)
        )
        result = plan(toolpath, make_cell(motion={"approach_mm": 30.0}))
        assert (result.toolpath.kind == MotionKind.HOLE).all()
        height = (result.T_base_tcp[:3, :3, 3] - toolpath.points[0]) @ FRONT
        assert np.allclose(height, [0.03, 0.0, 0.03], atol=1e-12)
        followed = plan(replace(toolpath, feed=np.full(3, 0.01)), make_cell())
        assert (followed.kind[1:] == MoveKind.LIN).all()

    def test_global_costs_no_more_than_each(self, make_cell, make_path):
        """Cost of travel and stiffness of the joint optimum, against that of per-tag optima."""
        toolpath, cost = row_of_holes(make_path), {}
        for strategy in ("global", "each"):
            cell = make_cell(options={"refine": False, "strategy": strategy})
            result = plan(toolpath, cell)
            q = result.q[result.role == MoveRole.PLUNGE]
            travel = ((np.diff(q, axis=0) / (10.0 * DEG)) ** 2).sum()
            cost[strategy] = 0.1 * travel - np.log(result.stiffness).sum()
            check_invariants(result, cell)
        assert cost["global"] <= cost["each"] + 1e-6

    def test_each_is_the_best_of_the_grid(self, make_cell, make_path):
        """Every tag's index equals the largest over its reachable states, by brute force."""
        cell = make_cell(options={"strategy": "each", "objective": {"axial": 1.0}})
        toolpath = row_of_holes(make_path, n=5)
        result = plan(toolpath, cell)
        kinematics = build(cell.robot)
        place_R = result.T_base_tcp[0, :3, :3]
        c = 1.0 / np.asarray(cell.robot.joint_stiffness)
        for tag in range(5):
            best = 0.0
            for k in range(36):
                turn = k * 10.0 * DEG
                spin = np.array(
                    [[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]]
                )
                T = np.eye(4)
                spun = result.spin[result.tag == 0][0]
                back = np.array(
                    [[1, 0, 0], [0, np.cos(spun), np.sin(spun)], [0, -np.sin(spun), np.cos(spun)]]
                )
                T[:3, :3], T[:3, 3] = place_R @ back @ spin, toolpath.points[tag]
                q, valid = kinematics.ik((T @ np.linalg.inv(cell.tool.T_flange_tcp))[None])
                for row in q[0][valid[0]]:
                    turned = row + 2 * np.pi * np.array([0, 0, 0, 0, 0, 0])
                    if not kinematics.within_limits(turned, 2.0 * DEG):
                        continue
                    if abs(turned[4]) < 5.0 * DEG:
                        continue
                    J = kinematics.jacobian(turned, cell.tool.T_flange_tcp[:3, 3])
                    give = (c * (-FRONT @ J[:3]) ** 2).sum()
                    best = max(best, 1.0 / give)
            assert result.stiffness[tag] >= best * (1.0 - 1e-3)

    def test_refinement_lowers_the_cost(self, make_cell, make_path):
        toolpath = row_of_holes(make_path)
        values = []
        for refine in (False, True):
            cell = make_cell(options={"refine": refine}, optimize={"objective": {"travel": 1.0}})
            result = plan(toolpath, cell)
            values.append(result.settings["travel_rad2"])
            check_invariants(result, cell)
        assert values[1] < values[0]


@pytest.mark.usefixtures("no_scene")
class TestCuts:
    def milling(self, make_path, **changes):
        t = np.linspace(0.0, 1.0, 41)
        points = np.stack([np.full(41, 1.8), -0.4 + 0.8 * t, 0.9 + 0.1 * np.sin(3 * t)], axis=1)
        axes = rotation_y(0.3 * t) @ FRONT
        kind = np.full(41, MotionKind.LINEAR)
        kind[0] = MotionKind.RAPID
        return make_path(points, axes, kind, feed=np.full(41, 0.02), **changes)

    @pytest.mark.parametrize(
        "strategy", ["global", "smooth", pytest.param("each", marks=pytest.mark.slow)]
    )
    def test_lines(self, make_cell, make_path, strategy):
        cell, toolpath = make_cell(), self.milling(make_path)
        result = plan(toolpath, cell.with_keys({"strategy": strategy}))
        check_invariants(result, cell)
        assert not result.errors
        assert len(result) == 42  # and the way out
        tags_are_met(result, np.arange(41))
        axis = result.T_base_tcp[:41, :3, :3] @ cell.tool.axis
        assert angle_between(axis, -toolpath.axes).max() < 1e-9

    def test_arcs_are_exact(self, make_cell, make_path):
        """A quarter, then a full circle: aux and end points lie on them, in the given sense."""
        r = 0.1
        centre = np.array([[1.8, 0.0, 0.9], [1.8, 0.0, 0.9]])
        points = [[1.8, r, 0.9], [1.8, 0.0, 0.9 + r], [1.8, 0.0, 0.9 + r]]
        arcs = Arcs(centre, [[1, 0, 0], [1, 0, 0]], [r, r], [0.5 * np.pi, 2.0 * np.pi])
        toolpath = make_path(
            points,
            FRONT,
            np.array([MotionKind.RAPID, MotionKind.ARC, MotionKind.ARC]),
            feed=np.full(3, 0.02),
            arc=np.array([-1, 0, 1]),
            arcs=arcs,
        )
        cell = make_cell()
        result = plan(toolpath, cell)
        check_invariants(result, cell)
        circ = result.kind == MoveKind.CIRC
        assert circ.sum() == 1 + 3
        for p in (result.aux[circ], result.T_base_tcp[circ, :3, 3]):
            assert np.allclose(np.linalg.norm(p - centre[0], axis=1), r, atol=1e-12)
        way = np.stack([result.aux[circ], result.T_base_tcp[circ, :3, 3]], axis=1).reshape(-1, 3)
        angle = np.unwrap(np.arctan2(way[:, 2] - 0.9, way[:, 1]))
        want = [45, 90, 150, 210, 270, 330, 390, 450]
        assert np.allclose(angle / DEG, want, atol=1e-6)
        as_lines = plan(toolpath, make_cell(motion={"arcs": "lin", "chord_mm": 0.05}))
        check_invariants(as_lines, cell)
        p = as_lines.T_base_tcp[1:, :3, 3]
        middle = 0.5 * (p[1:] + p[:-1]) - centre[0]
        assert (r - np.linalg.norm(middle, axis=1)).max() <= 0.05e-3 + 1e-9

    def test_feed_is_lowered_where_an_axis_cannot_follow(self, make_cell, make_path):
        toolpath = replace(self.milling(make_path), feed=np.full(41, 1.9))
        cell = make_cell()
        slow = replace(cell, robot=replace(cell.robot, qd_max=np.full(6, 0.1)))
        result = plan(toolpath, slow)
        assert any(finding.code == "PLN301" for finding in result.findings)
        rate = np.abs(np.diff(result.q, axis=0)).max(axis=1)
        step = np.linalg.norm(np.diff(result.T_base_tcp[:, :3, 3], axis=0), axis=1)
        assert (rate / (step / result.speed[1:]) < 0.1 * 1.02).all()

    def test_missing_feed_is_an_error_with_its_line(self, make_cell, make_path):
        toolpath = replace(self.milling(make_path), feed=np.full(41, np.nan))
        cell = make_cell()
        cell = replace(cell, motion=replace(cell.motion, feed=float("nan")))
        result = plan(toolpath, cell)
        assert result.errors[0].code == "PLN205"
        assert result.errors[0].source.line == toolpath.line[result.errors[0].tag_index]


@pytest.mark.usefixtures("no_scene")
class TestFailures:
    def test_out_of_reach(self, make_cell, make_path):
        toolpath = row_of_holes(make_path, n=4)
        points = np.array(toolpath.points)
        points[2, 0] = 9.0
        result = plan(replace(toolpath, points=points), make_cell())
        assert [finding.code for finding in result.errors] == ["PLN101"]
        assert result.errors[0].tag_index == 2
        assert result.errors[0].source.line == 12
        assert "1152 unreachable" in result.errors[0].message

    def test_limits_and_singularity_are_told_apart(self, make_cell, make_path, robot):
        toolpath = row_of_holes(make_path, n=1)
        tight = replace(robot, q_min=robot.q_max - 6.0 * DEG)
        assert plan(toolpath, make_cell(robot=tight)).errors[0].code == "PLN102"
        cell = make_cell()
        bent = replace(cell, limits=replace(cell.limits, singularity=89.9 * DEG))
        assert plan(toolpath, bent).errors[0].code == "PLN103"

    def test_everything_fails_without_a_crash(self, make_cell, make_path):
        toolpath = row_of_holes(make_path, n=3)
        result = plan(replace(toolpath, points=toolpath.points + 9.0), make_cell())
        assert len(result.errors) == 3
        assert len(result) == 0

    def test_partial_keeps_the_good_stretches(self, make_cell, make_path):
        toolpath = row_of_holes(make_path, n=5)
        points = np.array(toolpath.points)
        points[2, 0] = 9.0
        result = plan(replace(toolpath, points=points), make_cell(), PlanOptions(partial=True))
        assert sorted(set(result.tag.tolist())) == [0, 1, 3, 4]
        again = np.nonzero(result.tag == 3)[0][0]
        assert result.kind[again] == MoveKind.PTP
        assert result.role[again] == MoveRole.ENTRY

    def test_coaxial_tool_is_said(self, make_cell, make_path):
        cell = make_cell()
        T = np.eye(4)
        T[2, 3] = 0.3
        straight = replace(cell, tools=(Tool(1, "t", T, np.array([0.0, 0.0, 1.0])),))
        result = plan(row_of_holes(make_path, n=3), straight)
        assert any(finding.code == "PLN303" for finding in result.findings)
        result = plan(row_of_holes(make_path, n=3), cell)
        assert not any(finding.code == "PLN303" for finding in result.findings)


def test_fixture_in_the_way(make_cell, make_path):
    """A post between two holes: way round it, every state free; a post on a hole: named."""
    toolpath = row_of_holes(make_path, n=2)
    T = np.eye(4)
    T[:3, 3] = [1.7, 0.0, 1.0]
    post = MeshPlacement("post", T, size=np.array([0.6, 0.1, 0.6]))
    drill = MeshPlacement("drill", np.eye(4), size=np.array([0.05, 0.05, 0.05]))
    cell = make_cell()
    cell = replace(cell, obstacles=(post,), tools=(replace(cell.tool, meshes=(drill,)),))
    result = plan(toolpath, cell)
    check_invariants(result, cell)
    assert not result.errors
    assert len(result) > 8
    from postproc.collision.scene import Scene

    scene = Scene.build(cell, build(cell.robot))
    q = result.q[result.role < 9]
    assert not scene.check_paths(q[:-1], q[1:]).hit.any()
    T2 = np.eye(4)
    T2[:3, 3] = toolpath.points[1]
    block = MeshPlacement("block", T2, size=np.array([1.2, 0.9, 1.4]))
    blocked = plan(toolpath, replace(cell, obstacles=(block,)))
    assert blocked.errors[0].code == "PLN104"
    assert "block" in blocked.errors[0].message


@pytest.mark.usefixtures("no_scene")
def test_events_stop_and_stand_before_their_tag(make_cell, make_path):
    events = (
        Event(0, EventKind.SPINDLE_ON, 100.0),
        Event(2, EventKind.STOP),
        Event(12, EventKind.SPINDLE_OFF),
    )
    result = plan(row_of_holes(make_path, events=events), make_cell())
    at = {event.kind: row for row, event in result.events}
    assert at[EventKind.SPINDLE_ON] == 0
    assert result.tag[at[EventKind.STOP]] == 2
    assert result.tag[at[EventKind.STOP] - 1] == 1
    assert result.blend[at[EventKind.STOP] - 1] == 0.0
    assert at[EventKind.SPINDLE_OFF] == len(result)


@pytest.mark.usefixtures("no_scene")
def test_home_begins_and_ends(make_cell, make_path):
    cell = make_cell()
    home = np.array([0.0, -90.0, 90.0, 0.0, 30.0, 0.0]) * DEG
    cell = replace(cell, motion=replace(cell.motion, home=home))
    result = plan(row_of_holes(make_path), cell)
    check_invariants(result, cell)
    assert np.allclose(result.q[[0, -1]], home)


@pytest.mark.usefixtures("no_scene")
def test_same_input_same_plan(make_cell, make_path):
    one, two = (plan(row_of_holes(make_path), make_cell()) for _ in range(2))
    for column in ("q", "T_base_tcp", "speed", "blend", "duration"):
        assert np.array_equal(getattr(one, column), getattr(two, column), equal_nan=True)


@pytest.mark.usefixtures("no_scene")
def test_planning_never_opens_a_socket(make_cell, make_path, monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("network access")

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(socket, "create_connection", refuse)
    assert len(plan(row_of_holes(make_path), make_cell()))


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("optimize", "turns", False),
        ("optimize", "refine", False),
        ("optimize", "pins", {"3": 50.0}),
        ("motion", "approach_mm", 20.0),
        ("motion", "chord_mm", 0.5),
        ("motion", "arcs", "lin"),
        ("motion", "rapid_speed_m_s", 0.5),
        ("motion", "points", "path"),
    ],
)
def test_every_option_changes_the_plan(make_cell, make_path, table, key, value):
    toolpath = options_path(make_path)
    name = "options" if table == "optimize" else table
    merged = {"arcs": "lin"} if key == "chord_mm" else {}
    wound = {"motion": {"home_deg": [0, -90, 90, 0, 0, 340]}} if key == "turns" else {}
    plain = plan(toolpath, make_cell(**{name: merged}, **wound))
    changed = plan(toolpath, make_cell(**{name: merged | {key: value}}, **wound))
    assert differ(plain, changed)


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("key_every_mm", 150.0),
        ("key_corner_deg", 1.0),
        ("key_tags", ["5"]),
        ("loss_bound_percent", 0.1),
    ],
)
def test_every_option_of_smooth_changes_the_plan(make_cell, make_path, key, value):
    """Checked where nothing else asks for key tags."""
    toolpath = TestCuts().milling(make_path)
    base = {"loss_bound_percent": 100.0, "key_every_mm": 1e4, "key_corner_deg": 180.0}
    base |= {"strategy": "smooth", "objective": {"axial": 1.0, "margin": 3.0}}
    plain = plan(toolpath, make_cell(options=base))
    changed = plan(toolpath, make_cell(options=base | {key: value}))
    assert differ(plain, changed)


def options_path(make_path):
    """Return touched points and an arc in one list."""
    n = 8
    angle = np.linspace(0.0, np.pi, n)
    points = np.stack([np.full(n, 1.9), 0.6 * np.cos(angle), 0.9 + 0.2 * np.sin(angle)], axis=1)
    kind = np.full(n, MotionKind.LINEAR)
    kind[-2:] = [MotionKind.RAPID, MotionKind.ARC]
    middle = 0.5 * (points[-1] + points[-2])
    radius = 0.5 * np.linalg.norm(points[-1] - points[-2])
    arcs = Arcs(middle[None], [[1.0, 0, 0]], [radius], [np.pi])
    feed = np.full(n, np.nan)
    feed[-2:] = 0.01
    numbers = np.full(n, -1)
    numbers[-1] = 0
    return make_path(points, FRONT, kind, format="csv", arc=numbers, arcs=arcs, feed=feed)


def differ(one, two):
    if len(one) != len(two):
        return True
    columns = ("q", "speed", "T_base_tcp", "duration", "kind")
    return not all(
        np.allclose(getattr(one, c), getattr(two, c), equal_nan=True, atol=1e-12) for c in columns
    )


def test_workpiece_frame_moves_everything(make_cell, make_path, no_scene):
    """The same job in a turned and shifted base is the same joint path."""
    cell, toolpath = make_cell(), row_of_holes(make_path, n=4)
    T = np.eye(4)
    T[:3, :3] = rotation_y(0.4)
    T[:3, 3] = [0.3, -0.2, 0.5]
    R, p = T[:3, :3].T, T[:3, 3]
    moved = replace(toolpath, points=(toolpath.points - p) @ R.T, axes=toolpath.axes @ R.T)
    shifted = replace(cell, bases=(Workpiece(1, T),))
    one = plan(toolpath, cell.with_keys({"strategy": "each"}))
    two = plan(moved, shifted.with_keys({"strategy": "each"}))
    assert np.allclose(one.stiffness, two.stiffness, rtol=0.02)


def test_unknown_words_are_refused(make_cell):
    from postproc.errors import CellError

    with pytest.raises(CellError, match="no objective is named 'axal'"):
        settle(make_cell(optimize={"objective": "axal"}))
    with pytest.raises(CellError, match="expected one of global"):
        make_cell().with_keys({"strategy": "best"})


def test_the_fastest_plan_is_no_slower_than_a_balanced_one():
    """Short ways alone are not: along this leaning rim they take 5 % longer."""
    turn = np.linspace(0.0, 2.0 * np.pi, 29)
    out = np.stack([0.15 * np.cos(turn), 0.1 * np.sin(turn), -1e-4 * np.arange(29)], axis=1)
    axes = np.stack([0.23 * np.cos(turn), -0.38 * np.sin(2.0 * turn), np.ones(29)], axis=1)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    path = bare_path(
        "rim", out + np.array([0.15, 0.1, 0.0]), axes, feed=0.1, kind=MotionKind.LINEAR
    )
    keys = "home_deg = [0, -90, 90, 0, 45, 0]\n[optimize]\nstep_deg = 30\n"
    text = cell_text(STIFFNESS, FEED, keys, origin=(1954, -211, 1024))
    cell = parse_cell(text.encode(), "cell.toml")
    seconds = {
        preset: plan(path, replace(cell, optimize=replace(cell.optimize, preset=preset))).cycle_time
        for preset in (Preset.FASTEST, Preset.BALANCED)
    }
    assert seconds[Preset.FASTEST] <= seconds[Preset.BALANCED]
