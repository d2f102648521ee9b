"""Paths that are legal but odd: no crash, every tag met or named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.robotfile import load_robot
from postproc.kinematics import build
from postproc.model.plan import MoveKind
from postproc.model.toolpath import Arcs, Cycle, MotionKind
from postproc.planning.planner import plan

FRONT = [-1.0, 0.0, 0.0]
K = MotionKind
ODD = {
    "one cut": [K.LINEAR],
    "one rapid": [K.RAPID],
    "one hole": [K.HOLE],
    "one joint move": [K.JOINT],
    "arc first": [K.ARC, K.LINEAR],
    "hole, cut, hole": [K.HOLE, K.LINEAR, K.HOLE],
    "cut, rapid, hole": [K.LINEAR, K.RAPID, K.HOLE],
    "joint moves between": [K.JOINT, K.LINEAR, K.JOINT, K.RAPID, K.LINEAR],
    "rapids only": [K.RAPID] * 4,
}


def odd_path(make_path, kinds, step=0.05):
    n = len(kinds)
    points = np.stack([np.full(n, 1.8), step * np.arange(n), np.full(n, 1.0)], axis=1)
    kinds = np.array(kinds)
    is_arc = kinds == K.ARC
    return make_path(
        points,
        FRONT,
        kinds,
        feed=np.full(n, 0.02),
        arc=np.where(is_arc, 0, -1),
        arcs=Arcs(points[:1] + np.array([0.0, 0.0, 0.1]), [[1.0, 0, 0]], [0.1], [1.0]),
        cycle=np.where(kinds == K.HOLE, 0, -1),
        cycles=(Cycle("drill", 0.004, 0.002, 0.02),),
    )


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("strategy", ["global", "each", "smooth"])
@pytest.mark.parametrize("name", sorted(ODD))
def test_odd_sequences(make_cell, make_path, name, strategy):
    toolpath = odd_path(make_path, ODD[name])
    result = plan(toolpath, make_cell(options={"strategy": strategy}))
    assert not result.errors
    assert set(result.tag.tolist()) == set(range(len(toolpath)))
    assert result.kind[0] == MoveKind.PTP
    for tag in range(len(toolpath)):
        mine = result.T_base_tcp[result.tag == tag, :3, 3]
        depth = 0.004 if toolpath.kind[tag] == K.HOLE else 0.0
        target = toolpath.points[tag] + [depth, 0.0, 0.0]
        assert np.linalg.norm(mine - target, axis=1).min() < 1e-9


@pytest.mark.usefixtures("no_scene")
def test_the_same_point_again_and_again(make_cell, make_path):
    toolpath = odd_path(make_path, [K.RAPID] + [K.LINEAR] * 5, step=0.0)
    result = plan(toolpath, make_cell())
    assert not result.errors
    assert np.isfinite(result.duration).all()
    assert (result.blend == 0.0).all()


@pytest.mark.usefixtures("no_scene")
def test_drill_moves_by_lines_stop_at_the_depth(make_cell, make_path):
    """Down and up by plain cuts: no blending where the tool turns back."""
    points = np.array([[1.75, 0, 1], [1.8, 0, 1], [1.75, 0, 1], [1.75, 0.1, 1], [1.8, 0.1, 1]])
    toolpath = make_path(points, FRONT, np.array([0, 1, 1, 1, 1]), feed=np.full(5, 0.02))
    result = plan(toolpath, make_cell())
    assert result.blend[1] == 0.0
    assert result.blend[2] > 0.0


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("name", ["kuka_kr210_r2700_2", "kuka_kr6_r900_2", "kuka_kr500_r2800_2"])
def test_other_arms(make_cell, make_path, name):
    robot = load_robot(name)
    toolpath = odd_path(make_path, [K.RAPID] + [K.LINEAR] * 5, step=0.01)
    reach = 0.45 if "kr6" in name else 1.6
    points = np.array(toolpath.points)
    points[:, 0], points[:, 2] = reach, 0.5 * reach
    result = plan(replace(toolpath, points=points), make_cell(h=0.1, s=0.05, robot=robot))
    assert not result.errors
    T = build(robot).fk(result.q)
    assert np.isfinite(T).all()


@pytest.mark.usefixtures("no_scene")
def test_input_orientation_is_spin_zero(make_cell, make_path):
    """Where the input gives full orientations and no turn is allowed, they come out again."""
    from postproc.geometry.frames import rotation_x

    toolpath = odd_path(make_path, [K.RAPID] + [K.LINEAR] * 4)
    R = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]) @ rotation_x(np.linspace(2.8, 3.2, 5))
    given = replace(toolpath, rotations=R)
    cell = make_cell(optimize={"range": (0.0, 0.0)})
    result = plan(given, cell)
    assert not result.errors
    assert np.allclose(result.T_base_tcp[:5, :3, :3], R, atol=1e-12)
