"""Rails and positioners: what the arm alone cannot reach, done from positions of external axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import ExternalAxis, MeshPlacement
from postproc.kinematics import build
from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import Cycle, Event, EventKind, MotionKind
from postproc.planning.planner import plan
from postproc.planning.route.travel import cell_at
from postproc.planning.search.external_axes import position_grid
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


def test_a_cut_longer_than_the_reach_says_what_it_needs(make_cell, make_path):
    """Every point of it is in reach from somewhere, all of it from nowhere."""
    n = 45
    points = np.stack([np.full(n, 1.9), np.linspace(-4.4, 4.4, n), np.full(n, 1.0)], axis=1)
    kind = np.full(n, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    cell = make_cell(external_axes=(RAIL,))
    toolpath = make_path(points, [-1.0, 0, 0], kind, feed=np.full(n, 0.05))
    result = plan(toolpath, cell)
    assert result.errors
    for finding in result.errors:
        assert "the cut from tag 0 to 44 needs E1 to move within it" in finding.message
        assert finding.hint == "cuts keep their place of E1: lift the tool somewhere on the way"
    away = replace(toolpath, points=points + np.array([9.0, 0.0, 0.0]))
    assert not any("E1" in finding.message for finding in plan(away, cell).errors)
    lifted = kind.copy()
    lifted[22] = MotionKind.RAPID
    assert not plan(replace(toolpath, kind=lifted), cell).errors


@pytest.mark.parametrize("radius", [2e-3, 30e-3])
def test_the_way_along_the_rail_is_looked_at_without_gaps(make_cell, radius):
    """A thin rod between two places of the rail: no pose that sweeps it may be taken to travel."""
    from postproc.collision import Scene
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
        checker = Checker(None, None, Scene.build(cell_at(cell, np.zeros(1)), arm))
        ends = np.array([-3.0]), np.array([3.0])
        assert not _slides_free(cell, q, ends, checker)
        beside = np.array([y + 1.2]), np.array([y + 1.2 + 0.5])
        where = np.linspace(beside[0], beside[1], 501)
        dense = Scene.build(cell, arm).check(np.hstack([np.tile(q, (501, 1)), where]))
        assert _slides_free(cell, q, beside, checker) == (not dense.hit.any())
