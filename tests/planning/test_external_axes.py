"""Rails and positioners: what the arm alone cannot reach, done from positions of external axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from postproc.cell.cell import ExternalAxis, MeshPlacement
from postproc.collision import Scene
from postproc.kinematics import build
from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import Cycle, Event, EventKind, MotionKind
from postproc.planning import job, repairs
from postproc.planning.external import planner as axes
from postproc.planning.external import rating
from postproc.planning.external.rating import position_grid
from postproc.planning.planner import plan
from postproc.planning.route.travel import cell_at
from postproc.planning.search.between import carried_twist
from postproc.planning.states import settle
from postproc.units import DEG

RAIL = ExternalAxis("E1", "rail", np.array([0.0, 1.0, 0.0]), np.eye(4), -3.5, 3.5, 1.0)


def panel(make_path, n=25, width=6.0):
    points = np.stack([np.full(n, 1.9), np.linspace(-width / 2, width / 2, n), np.full(n, 1.0)], 1)
    cycles = (Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),)
    return make_path(
        points,
        [-1.0, 0, 0],
        MotionKind.HOLE,
        cycle=np.zeros(n, int),
        cycles=cycles,
        events=(Event(0, EventKind.SPINDLE_ON, 50.0), Event(n, EventKind.SPINDLE_OFF)),
    )


def test_a_tilt_turn_table_carries_its_turn_with_its_tilt(make_cell, make_path):
    at = np.eye(4)
    at[:3, 3] = [1.7, 0.0, 0.7]
    tilt = ExternalAxis("E1", "positioner", np.array([0.0, 1.0, 0.0]), at, 20 * DEG, 60 * DEG, 1.0)
    turn = ExternalAxis("E2", "positioner", np.array([0.0, 0.0, 1.0]), at, -6.0, 6.0, 1.0)
    cell = replace(make_cell(), external_axes=(tilt, turn))
    points = np.array([[1.75, 0.05, 0.75], [1.65, -0.05, 0.75], [1.7, 0.0, 0.8]])
    axes = Rotation.from_euler("xyz", [[20, 10, 0], [-20, 15, 40], [0, 0, 0]], degrees=True)
    result = plan(make_path(points, -axes.apply([0.0, 0.0, 1.0]), MotionKind.RAPID), cell)
    assert not result.errors
    tilted, turned = result.external.T
    R = Rotation.from_euler("y", tilted[:, None]) * Rotation.from_euler("z", turned[:, None])
    place = R.apply(result.T_base_tcp[:, :3, 3] - at[:3, 3]) + at[:3, 3]
    T_flange = build(cell.robot).fk(result.q) @ cell.tool.T_flange_tcp
    assert np.abs(tilted).min() > 0.3
    assert np.abs(turned).max() > 0.1
    assert np.allclose(T_flange[:, :3, 3], place, atol=1e-9)
    assert np.allclose(T_flange[:, :3, :3], R.as_matrix() @ result.T_base_tcp[:, :3, :3], atol=1e-9)


def test_a_panel_of_six_metres(make_cell, make_path):
    cell, toolpath = make_cell(), panel(make_path)
    assert plan(toolpath, cell).errors
    moving = replace(cell, external_axes=(RAIL,))
    result = plan(toolpath, moving)
    assert not result.errors
    assert result.external.shape == (len(result), 1)
    kinematics = build(cell.robot)
    T_flange = kinematics.fk(result.q) @ cell.tool.T_flange_tcp
    for row in range(len(result)):
        here = cell_at(moving, result.external[row])
        assert np.allclose(here.T_robroot_base @ result.T_base_tcp[row], T_flange[row], atol=1e-9)
    plunge = result.role == MoveRole.PLUNGE
    assert sorted(result.tag[plunge].tolist()) == list(range(25))
    tip = result.T_base_tcp[plunge, :3, 3] - toolpath.points[result.tag[plunge]]
    assert np.allclose(tip, [0.006, 0.0, 0.0], atol=1e-9)
    slides = np.nonzero(np.diff(result.external[:, 0]))[0] + 1
    assert 1 <= len(slides) < 12
    assert (result.kind[slides] == MoveKind.PTP).all()
    assert np.allclose(result.q[slides], result.q[slides - 1])
    assert (result.duration[slides] >= np.abs(np.diff(result.external[:, 0]))[slides - 1]).all()
    at = {event.kind: row for row, event in result.events}
    assert at == {EventKind.SPINDLE_ON: 0, EventKind.SPINDLE_OFF: len(result)}


def test_the_pose_to_travel_in_is_gone_to_once(make_cell, make_path):
    """With a home the arm goes there, the axes move, and it goes on: no motion leads nowhere."""
    cell = make_cell()
    home = np.array([0.0, -90.0, 90.0, 0.0, 30.0, 0.0]) * DEG
    motion = replace(cell.motion, home=home)
    result = plan(panel(make_path), replace(cell, external_axes=(RAIL,), motion=motion))
    assert not result.errors
    rows = np.hstack([result.q, result.external])
    assert (np.abs(np.diff(rows, axis=0)).max(axis=1) > 0.0).all()
    slides = np.flatnonzero(np.diff(result.external[:, 0])) + 1
    assert len(slides)
    assert np.allclose(result.q[slides], home)
    away = np.abs(np.diff(result.external[:, 0]))[slides - 1]
    assert (result.duration[slides] >= away / RAIL.qd_max).all()


def test_cuts_keep_their_station(make_cell, make_path):
    n = 21
    points = np.stack([np.full(n, 1.9), np.linspace(-0.4, 0.4, n), np.full(n, 1.0)], axis=1)
    away = np.array([0.0, 2.0, 0.0])
    points = np.concatenate([points - away, points + away])
    kind = np.full(2 * n, MotionKind.LINEAR)
    kind[[0, n]] = MotionKind.RAPID
    toolpath = make_path(points, [-1.0, 0, 0], kind, feed=np.full(2 * n, 0.02))
    cell = replace(make_cell(), external_axes=(RAIL,))
    result = plan(toolpath, cell)
    assert not result.errors
    cut = result.role == MoveRole.CUT
    for half in (result.tag < n, result.tag >= n):
        assert len(set(result.external[cut & half, 0].tolist())) == 1


def test_positioner_turns_the_part(make_cell, make_path):
    """Holes on the far side of a drum are brought round to the arm."""
    angle = np.arange(0.0, 360.0, 30.0) * DEG
    axes = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    T = np.eye(4)
    T[:3, 3] = [2.3, 0.0, 1.0]
    turn = ExternalAxis("E1", "positioner", np.array([0.0, 0, 1.0]), T, -np.pi, np.pi, 1.0)
    toolpath = make_path(
        T[:3, 3] + 0.4 * axes,
        axes,
        MotionKind.HOLE,
        cycle=np.zeros(len(angle), int),
        cycles=(Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),),
    )
    drum = np.eye(4)
    drum[:3, 3] = T[:3, 3]
    solid = MeshPlacement("drum", drum, radius=0.38, length=0.5)
    cell = make_cell()
    cell = replace(cell, bases=(replace(cell.workpiece, meshes=(solid,)),))
    result = plan(toolpath, replace(cell, external_axes=(turn,)))
    assert not result.errors
    assert len(np.unique(result.external)) > 1


@pytest.mark.parametrize("step", [0.0, 0.5, -1.0])
def test_rail_is_a_shift_of_the_base(make_cell, step):
    cell = replace(make_cell(), external_axes=(RAIL,))
    here = cell_at(cell, np.array([step]))
    assert np.allclose(here.T_robroot_base[:3, 3], cell.T_robroot_base[:3, 3] - [0, step, 0])
    assert np.allclose(here.robot.T_world_robroot[:3, 3], [0, step, 0])


def test_grid_of_positions():
    from types import SimpleNamespace

    values = position_grid(SimpleNamespace(external_axes=(RAIL,)))
    assert values[0, 0] == -3.5
    assert values[-1, 0] == 3.5
    assert 0.0 in values
    assert np.diff(values[:, 0]).max() <= 0.25 + 1e-9


@pytest.mark.usefixtures("no_scene")
def test_free_order_along_a_rail(make_cell, make_path):
    rng = np.random.default_rng(2)
    toolpath = panel(make_path, width=10.0)
    rail = replace(RAIL, q_min=-5.5, q_max=5.5)
    shuffled = replace(toolpath, points=toolpath.points[rng.permutation(25)])
    cell = replace(make_cell(options={"free_order": True}), external_axes=(rail,))
    result = plan(shuffled, cell)
    assert not result.errors
    assert sorted(result.toolpath.line.tolist()) == toolpath.line.tolist()
    plunge = result.role == MoveRole.PLUNGE
    tip = result.T_base_tcp[plunge, :3, 3] - result.toolpath.points[result.tag[plunge]]
    assert np.allclose(tip, [0.006, 0.0, 0.0], atol=1e-9)
    given = plan(shuffled, replace(make_cell(), external_axes=(rail,)))
    assert result.settings["stations"] < given.settings["stations"]


def long_cut(make_path, half=3.0, n=121, feed=0.05):
    """A wavy cut along the rail, its tool axis swaying."""
    y = np.linspace(-half, half, n)
    points = np.stack([1.9 + 0.05 * np.sin(2.0 * y), y, 1.0 + 0.05 * np.cos(3.0 * y)], axis=1)
    axes = np.stack([-np.ones(n), 0.2 * np.sin(y), 0.1 * np.cos(2.0 * y)], axis=1)
    kind = np.full(n, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    return make_path(points, axes, kind, feed=np.full(n, feed))


def along_cuts(result, cell, shares=8):
    """Joints (k, 6), external (k, 1), part points (k, 3) along cuts, by slerp and IK."""
    kinematics = build(cell.robot)
    rows = np.flatnonzero(result.role == MoveRole.CUT)
    q, external, points = [], [], []
    for row in rows.tolist():
        R = Rotation.from_matrix(result.T_base_tcp[[row - 1, row], :3, :3])
        for share in (np.arange(shares) + 1.0) / shares:
            T = np.eye(4)
            T[:3, :3] = Slerp([0.0, 1.0], R)(share).as_matrix()
            T[:3, 3] = (1.0 - share) * result.T_base_tcp[row - 1, :3, 3]
            T[:3, 3] += share * result.T_base_tcp[row, :3, 3]
            e = (1.0 - share) * result.external[row - 1] + share * result.external[row]
            T_flange = cell_at(cell, e).T_robroot_base @ T @ np.linalg.inv(cell.tool.T_flange_tcp)
            slots, valid = kinematics.ik(T_flange[None])
            near = result.q[row - 1] + share * (result.q[row] - result.q[row - 1])
            off = slots[0] - near
            moved = slots[0] - 2.0 * np.pi * np.round(off / (2.0 * np.pi))
            best = np.argmin(np.where(valid[0], np.abs(moved - near).max(axis=1), np.inf))
            q.append(moved[best])
            external.append(e)
            points.append(T[:3, 3])
    return np.array(q), np.array(external), np.array(points)


def test_the_rail_moves_along_a_cut_longer_than_the_reach(make_cell, make_path):
    cell, toolpath = make_cell(external_axes=(RAIL,)), long_cut(make_path)
    result = plan(toolpath, cell)
    assert not result.errors
    assert [f.code for f in result.findings].count("PLN307") == 1
    cut = np.flatnonzero(result.role == MoveRole.CUT)
    assert len(cut) == len(toolpath) - 1
    tip = result.T_base_tcp[cut, :3, 3] - toolpath.points[result.tag[cut]]
    assert np.abs(tip).max() < 1e-9
    axis = result.T_base_tcp[cut, :3, :3] @ cell.tool.axis + toolpath.axes[result.tag[cut]]
    assert np.abs(axis).max() < 1e-9
    q, external, _ = along_cuts(result, cell)
    kinematics = build(cell.robot)
    assert kinematics.within_limits(q, cell.limits.joint_margin - 1e-6).all()
    assert np.abs(np.diff(q, axis=0)).max() < 20.0 * DEG
    assert external.min() >= RAIL.q_min
    assert external.max() <= RAIL.q_max
    assert np.ptp(external) > 2.0
    # smooth: the rail neither stops and goes nor turns back on the way along it
    e = result.external[cut, 0]
    way = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1)
    slope = np.diff(e) / way[1:]
    assert np.abs(np.diff(slope)).max() < 0.1
    time = way / result.speed[cut]
    assert (np.abs(np.diff(e)) / time[1:]).max() < RAIL.qd_max


def test_a_rail_that_is_fast_enough_over_the_whole_way_does_not_slow_the_feed(make_cell, make_path):
    """At 0.4 of the feed it gets along if it moves all the time, and no farther than it must."""
    slow = replace(RAIL, qd_max=0.02)
    result = plan(long_cut(make_path, feed=0.05), make_cell(external_axes=(slow,)))
    assert not result.errors
    assert "PLN301" not in {finding.code for finding in result.findings}
    cut = np.flatnonzero(result.role == MoveRole.CUT)
    step = np.linalg.norm(np.diff(result.T_base_tcp[:, :3, 3], axis=0), axis=1)[cut - 1]
    speed = np.abs(np.diff(result.external[:, 0]))[cut - 1] * result.speed[cut] / step
    assert 0.5 * slow.qd_max < speed.max() <= slow.qd_max
    assert np.allclose(result.speed[cut], 0.05)


def test_a_slow_rail_slows_the_feed_and_says_so(make_cell, make_path):
    slow = replace(RAIL, qd_max=0.005)
    toolpath = long_cut(make_path, feed=0.05)
    result = plan(toolpath, make_cell(external_axes=(slow,)))
    assert not result.errors
    found = [finding for finding in result.findings if finding.code == "PLN301"]
    assert len(found) == 1
    assert "E1 is at its largest speed" in found[0].message
    cut = np.flatnonzero(result.role == MoveRole.CUT)
    step = np.linalg.norm(np.diff(result.T_base_tcp[:, :3, 3], axis=0), axis=1)[cut - 1]
    speed = np.abs(np.diff(result.external[:, 0]))[cut - 1] * result.speed[cut] / step
    assert speed.max() <= slow.qd_max
    assert result.speed[cut].min() < 0.04


def test_places_where_the_arm_hits_something_are_left_out_at_once(
    make_cell, make_path, monkeypatch
):
    """A wall between arm and hole: the place beside it is found without trying all before it."""
    T = np.eye(4)
    T[:3, 3] = [1.0, 0.0, 1.2]
    wall = MeshPlacement("wall", T, size=np.array([0.2, 1.4, 2.4]))
    cell = replace(make_cell(), external_axes=(RAIL,), obstacles=(wall,))
    planned = []
    own = job.planned

    def counted(self, toolpath, here, *args, **more):
        planned.append(here.robot.T_world_robroot[1, 3])
        return own(self, toolpath, here, *args, **more)

    monkeypatch.setattr(axes, "planned", counted)
    result = plan(panel(make_path, n=1, width=0.0), cell)
    assert not result.errors
    assert abs(result.external[0, 0]) > 0.5
    assert len(planned) <= 4


def test_beyond_the_end_of_the_rail(make_cell, make_path):
    toolpath = long_cut(make_path, half=6.5)
    result = plan(toolpath, make_cell(external_axes=(RAIL,)))
    assert {finding.code for finding in result.errors} >= {"PLN101"}
    words = "position of E1 that was tried reaches all of this"
    lost = [f for f in result.errors if words in f.message]
    assert lost
    assert all(abs(toolpath.points[f.tag_index, 1]) > 3.5 for f in lost if f.code == "PLN101")


@pytest.mark.slow
def test_a_rail_that_may_not_move_in_cuts_says_what_they_need(make_cell, make_path):
    """Every point of the cut is in reach from somewhere, all of it from nowhere."""
    toolpath, still = long_cut(make_path, half=3.4), replace(RAIL, moves_in_cuts=False)
    result = plan(toolpath, make_cell(external_axes=(still,)))
    assert result.errors
    assert not result.blend.any()  # what cannot be run is not worth the search for its corners
    for finding in result.errors:
        assert "the cut from tag 0 to 120 needs E1 to move within it" in finding.message
        assert finding.hint.startswith("allow moves_in_cuts of E1")
    away = replace(toolpath, points=toolpath.points + np.array([9.0, 0.0, 0.0]))
    cell = make_cell(external_axes=(still,))
    assert not any("needs E1" in finding.message for finding in plan(away, cell).errors)
    kind = np.array(toolpath.kind)
    kind[60] = MotionKind.RAPID
    assert not plan(replace(toolpath, kind=kind), cell).errors


def test_solids_stand_while_the_robot_is_carried_along_a_cut(make_cell, make_path):
    """Posts beside the way: dense poses along all motions touch none of them."""
    posts = []
    for number, y in enumerate(np.linspace(-2.2, 2.2, 5)):
        T = np.eye(4)
        T[:3, 3] = [1.35, y, 0.3]
        posts.append(MeshPlacement(f"post {number}", T, radius=0.06, length=0.9))
    cell = make_cell(external_axes=(RAIL,), obstacles=tuple(posts))
    toolpath = long_cut(make_path, n=61)
    result = plan(toolpath, cell)
    assert not result.errors
    q, external, points = along_cuts(result, cell)
    tip = build(cell.robot).fk(q) @ cell.tool.T_flange_tcp
    carried = np.array([cell_at(cell, e).T_robroot_base for e in external])
    seen = np.einsum("nij,nj->ni", carried[:, :3, :3], points) + carried[:, :3, 3]
    assert np.abs(tip[:, :3, 3] - seen).max() < 1e-9
    scene = Scene.build(cell, build(cell.robot))
    contact = np.ones(len(q), dtype=bool)
    assert not scene.check(np.hstack([q, external]), contact).hit.any()


def test_a_positioner_turns_the_part_along_a_cut(make_cell, make_path):
    """A groove all round a drum, which the arm reaches from one side only."""
    n = 121
    angle = np.linspace(0.0, 2.0 * np.pi, n) - np.pi
    axes = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    T = np.eye(4)
    T[:3, 3] = [2.3, 0.0, 1.0]
    turn = ExternalAxis("E1", "positioner", np.array([0.0, 0, 1.0]), T, -6.5, 6.5, 1.0)
    kind = np.full(n, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    toolpath = make_path(T[:3, 3] + 0.4 * axes, axes, kind, feed=np.full(n, 0.02))
    drum = MeshPlacement("drum", T, radius=0.38, length=0.5)
    cell = make_cell()
    cell = replace(cell, bases=(replace(cell.workpiece, meshes=(drum,)),), external_axes=(turn,))
    result = plan(toolpath, cell)
    assert not result.errors
    assert np.ptp(result.external) > 90.0 * DEG
    q, external, _ = along_cuts(result, cell, shares=4)
    scene = Scene.build(cell, build(cell.robot))
    contact = np.ones(len(q), dtype=bool)
    assert not scene.check(np.hstack([q, external]), contact).hit.any()


@pytest.mark.parametrize("radius", [2e-3, 30e-3])
def test_the_way_along_the_rail_is_looked_at_without_gaps(make_cell, radius):
    """A thin rod between two places of the rail: no pose that sweeps it may be taken to travel."""
    from postproc.planning.checks import Checker
    from postproc.planning.route.travel import _slides_free

    q = np.array([0.0, -60.0, 90.0, 0.0, 30.0, 0.0]) * DEG
    rng = np.random.default_rng(5)
    for y in rng.uniform(-2.0, 2.0, 4):
        T = np.eye(4)
        T[:3, 3] = [1.3, y, 1.5]
        rod = MeshPlacement("rod", T, radius=radius, length=3.0)
        cell = replace(make_cell(), external_axes=(RAIL,), obstacles=(rod,))
        arm = build(cell.robot)
        checker = Checker(None, Scene.build(cell_at(cell, np.zeros(1)), arm))
        ends = np.array([-3.0]), np.array([3.0])
        assert not _slides_free(cell, q, ends, checker)
        beside = np.array([y + 1.2]), np.array([y + 1.2 + 0.5])
        where = np.linspace(beside[0], beside[1], 501)
        dense = Scene.build(cell, arm).check(np.hstack([np.tile(q, (501, 1)), where]))
        assert _slides_free(cell, q, beside, checker) == (not dense.hit.any())


def rim(make_path, radius, tilt, n=121, laps=1):
    """Return a way round a part that stands at (2, 0, 0.8), and a turntable under it.

    The tool leans out of the plane of the way by ``tilt`` [rad]. Each lap is a cut of its own.
    """
    centre, angle = np.array([2.0, 0.0, 0.8]), np.linspace(-np.pi, np.pi, n)
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    points = centre + radius * out
    far = 0.03 if laps == 1 else 0.05  # not where the lap before ended: a way between the two
    points = np.concatenate([points[:1] + far * out[:1], points, points[-1:] + 0.03 * out[-1:]])
    out = out[np.r_[0, 0:n, n - 1]]
    axes = np.cos(tilt) * out + np.sin(tilt) * np.array([0.0, 0.0, 1.0])
    kind = np.full(n + 2, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    T = np.eye(4)
    T[:3, 3] = centre
    turn = ExternalAxis("E1", "positioner", np.array([0.0, 0, 1.0]), T, -3.3, 3.3, 0.5)
    again = np.tile(np.arange(n + 2), laps)
    return make_path(points[again], axes[again], kind[again], feed=np.full(len(again), 0.025)), turn


def test_a_rim_is_carried_past_the_arm_where_that_is_stiffer(make_cell, make_path):
    """Held, the arm reaches all round the part, into postures that give way."""
    toolpath, turn = rim(make_path, 0.25, 45.0 * DEG)
    held = plan(toolpath, make_cell(external_axes=(replace(turn, moves_in_cuts=False),)))
    result = plan(toolpath, make_cell(external_axes=(turn,)))
    assert not held.errors
    assert not result.errors
    assert np.ptp(held.external) == 0.0
    assert np.ptp(result.external) > 240.0 * DEG
    assert [f.code for f in result.findings].count("PLN307") == 1
    assert np.log(result.stiffness).mean() > np.log(held.stiffness).mean()
    assert result.stiffness.min() > 1.05 * held.stiffness.min()


def test_a_rim_that_is_as_good_held_stays_held(make_cell, make_path):
    toolpath, turn = rim(make_path, 0.1, 90.0 * DEG)
    result = plan(toolpath, make_cell(external_axes=(turn,)))
    assert not result.errors
    assert np.ptp(result.external) == 0.0


@pytest.mark.slow
def test_a_rim_refused_where_the_table_stands_is_carried_at_once(make_cell, make_path, monkeypatch):
    """A disc in the way of the arm: no place of the table serves, nor is each of them tried."""
    toolpath, turn = rim(make_path, 0.305, 90.0 * DEG)
    T = turn.T_world_axis.copy()
    T[2, 3] -= 0.005
    disc = MeshPlacement("disc", T, radius=0.3, length=0.06)
    cell = make_cell(external_axes=(turn,))
    cell = replace(cell, bases=(replace(cell.workpiece, meshes=(disc,)),))
    planned = []
    own = job.planned

    def counted(*args, **more):
        planned.append(own(*args, **more))
        return planned[-1]

    monkeypatch.setattr(axes, "planned", counted)
    result = plan(toolpath, cell)
    assert not result.errors
    assert planned[0].errors
    assert np.ptp(result.external) > 180.0 * DEG
    assert len(planned) <= 3
    q, external, _ = along_cuts(result, cell, shares=4)
    contact = np.ones(len(q), dtype=bool)
    assert (
        not Scene.build(cell, build(cell.robot)).check(np.hstack([q, external]), contact).hit.any()
    )


def test_a_tool_that_stands_still_on_a_turning_table_does_not_twist(make_cell, make_path):
    n, turned = 13, np.linspace(0.0, 2.0, 13)
    cell = make_cell(external_axes=(rim(make_path, 0.1, 0.0)[1],))
    toolpath = make_path(np.tile([2.1, 0.0, 0.8], (n, 1)), [0.0, 0.0, 1.0])
    settings = settle(cell)[1]
    place = job.problem_of(toolpath, cell, settings, turned[:, None]).placement
    # spins that make up for the turn of the table leave the tool as it stands to the arm
    spin = carried_twist(place)[0] - carried_twist(place)
    T = place.base(place.external) @ place.tcp(np.arange(n), spin)
    assert np.allclose(T[:, :3, :3], T[0, :3, :3], atol=1e-9)


@pytest.mark.slow
def test_whole_turns_of_a_table_are_rated_once(make_cell, make_path, monkeypatch):
    toolpath, turn = rim(make_path, 0.25, 45.0 * DEG, n=31)
    cell = make_cell(external_axes=(replace(turn, q_min=-4.0 * np.pi, q_max=4.0 * np.pi),))
    rated, own = [], rating._least_cost

    def counted(problem, *args):
        rated.append(problem)
        return own(problem, *args)

    monkeypatch.setattr(rating, "_least_cost", counted)
    assert not plan(toolpath, cell).errors
    assert len(rated) == 12


def test_a_rim_within_the_part_is_refused_at_once(make_cell, make_path, monkeypatch):
    """The disc is larger than the way round it: wherever the table stands, that is in it."""
    toolpath, turn = rim(make_path, 0.25, 0.0)
    T = turn.T_world_axis.copy()
    T[2, 3] -= 0.3
    disc = MeshPlacement("disc", T, radius=0.4, length=0.6)
    cell = make_cell(external_axes=(turn,))
    head = MeshPlacement("head", np.asarray(cell.tool.T_flange_tcp), radius=0.05, length=0.02)
    cell = replace(
        cell,
        bases=(replace(cell.workpiece, meshes=(disc,)),),
        tools=(replace(cell.tool, meshes=(head,)),),
    )
    count = []
    own = job.planned

    def counted(*args, **more):
        count.append(1)
        return own(*args, **more)

    monkeypatch.setattr(axes, "planned", counted)
    result = plan(toolpath, cell)
    assert {error.code for error in result.errors} == {"PLN104"}
    assert "fails at every position of E1 tried" in result.errors[0].message
    assert len(count) <= 2


def test_a_cut_refused_where_the_axes_stood_is_not_said_to_be_impossible(
    make_cell, make_path, monkeypatch
):
    """One round of the search: other places of the table are open."""
    toolpath, turn = rim(make_path, 0.305, 90.0 * DEG)
    T = turn.T_world_axis.copy()
    T[2, 3] -= 0.005
    disc = MeshPlacement("disc", T, radius=0.3, length=0.06)
    cell = make_cell(external_axes=(replace(turn, moves_in_cuts=False),))
    cell = replace(cell, bases=(replace(cell.workpiece, meshes=(disc,)),))
    monkeypatch.setattr(repairs, "MOST_PLANS", 1)
    result = plan(toolpath, cell)
    assert [error.code for error in result.errors].count("PLN106") == 1
    assert "with E1 at the positions tried" in result.errors[-1].message


@pytest.mark.slow
def test_the_way_back_of_the_table_counts_against_a_carried_cut(make_cell, make_path):
    """Four rims in one sense: three times the table would have to turn all the way back."""
    toolpath, turn = rim(make_path, 0.25, 45.0 * DEG, laps=4)
    slow = replace(turn, qd_max=8.0 * DEG)
    held = plan(toolpath, make_cell(external_axes=(replace(slow, moves_in_cuts=False),)))
    result = plan(toolpath, make_cell(external_axes=(slow,)))
    assert not result.errors
    assert result.cycle_time < 1.05 * held.cycle_time


def test_an_axis_that_may_not_move_in_cuts_stands_to_the_last_digit(make_cell, make_path):
    """Its place, a third of a turn or so, has no end in digits."""
    toolpath, turn = rim(make_path, 0.25, 45.0 * DEG)
    T = turn.T_world_axis.copy()
    T[2, 3] -= 0.2
    still = ExternalAxis("E1", "positioner", np.array([0.0, 0, 1.0]), T, -1.0, 1.0, 0.5)
    cell = make_cell(
        external_axes=(
            replace(still, moves_in_cuts=False, q_min=2.0 / 3.0, q_max=2.0 / 3.0 + 1e-9),
            replace(turn, name="E2"),
        )
    )
    result = plan(toolpath, cell)
    assert not result.errors
    assert np.ptp(result.external[:, 1]) > 0.0
    assert np.ptp(result.external[:, 0]) == 0.0
    (told,) = (finding.message for finding in result.findings if finding.code == "PLN307")
    assert "E1" not in told
