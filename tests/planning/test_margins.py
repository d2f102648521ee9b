"""Margins by default: few tags stand near a limit that need not; `stiffest` asks for less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.cell import load_cell
from postproc.kinematics import build
from postproc.model.toolpath import MotionKind
from postproc.planning.checks import Grade, grade_counts, grades
from postproc.planning.planner import plan
from postproc.readers import read
from postproc.units import DEG
from tests.places import FIXTURES

GOOD = 5.0 * DEG
KEPT = 2.0 * DEG


def holes_where_the_arm_stands(make_cell, make_path, count, preset):
    """Holes drilled where the arm stands at random, elbow up, and their cell."""
    cell = make_cell(options={"preset": preset})
    rng = np.random.default_rng(5)
    low = np.radians([-60.0, -110.0, 60.0, -180.0, 10.0, -180.0])
    high = np.radians([60.0, -40.0, 140.0, 180.0, 118.0, 180.0])
    T = build(cell.robot).fk(rng.uniform(low, high, (count, 6))) @ cell.tool.T_flange_tcp
    return make_path(T[:, :3, 3], -T[:, :3, 0], MotionKind.JOINT), cell


def margins(kinematics, q):
    """The least way (n,) [rad] to a limit beyond the cell's margin, and to the straight wrist."""
    limits = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min(axis=-1) - KEPT
    return np.minimum(limits, np.abs(q[..., 4]) - 5.0 * DEG)


def best_margin(cell, point, axis):
    """The best margin of any spin and branch at a tag, every 5 degrees, all turns of the wrist."""
    kinematics = build(cell.robot)
    across = np.cross(axis, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    spin = np.radians(np.arange(0.0, 360.0, 5.0))[:, None]
    y = np.cos(spin) * across + np.sin(spin) * np.cross(axis, across)
    T = np.tile(np.eye(4), (len(spin), 1, 1))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = -axis, y, np.cross(-axis, y)
    T[:, :3, 3] = point
    q, reached = kinematics.ik(T @ np.linalg.inv(cell.tool.T_flange_tcp))
    return margins(kinematics, kinematics.nearest(q[reached], np.zeros(6))).max()


def test_nine_of_ten_tags_that_can_keep_a_good_margin_do(make_cell, make_path):
    toolpath, cell = holes_where_the_arm_stands(make_cell, make_path, 60, "balanced")
    result = plan(toolpath, cell)
    kinematics = build(cell.robot)
    has = np.isfinite(result.stiffness)
    could = np.array(
        [
            best_margin(cell, p, a) >= GOOD
            for p, a in zip(toolpath.points, toolpath.axes, strict=True)
        ]
    )
    does = np.zeros(len(toolpath), dtype=bool)
    does[result.tag] = margins(kinematics, result.q) >= GOOD
    assert could.sum() >= 50
    assert does[could & has].mean() >= 0.9
    stiffest = plan(*holes_where_the_arm_stands(make_cell, make_path, 60, "stiffest"))
    near = np.zeros(len(toolpath), dtype=bool)
    near[stiffest.tag] = margins(kinematics, stiffest.q) < GOOD
    assert near.sum() > 2 * (~does).sum()
    assert np.nanmedian(result.stiffness) < np.nanmedian(stiffest.stiffness)


def test_a_pose_whose_best_neighbour_hits_goes_part_of_the_way_to_it():
    """On a grid of 20 degrees the far holes stand 2 degrees from a limit; all of the way hits."""
    cell = load_cell(FIXTURES / "turntable" / "cell.toml")
    toolpath = read(FIXTURES / "turntable" / "ring.csv")
    standing = replace(cell, optimize=replace(cell.optimize, refine=False))
    least = {}
    for name, here in (("grid", standing), ("moved", cell)):
        result = plan(toolpath, here)
        assert not result.errors
        assert np.nanmin(result.clearance) > cell.limits.clearance
        least[name] = margins(build(cell.robot), result.q).min()
    assert least["grid"] < 0.6 * GOOD
    assert least["moved"] > GOOD


def test_a_repeated_point_stands_as_the_one_that_it_repeats(make_cell, make_path):
    points = [[2.0, 0.0, 0.9], [2.0, 0.1, 0.9], [2.0, 0.1, 0.9], [2.0, 0.2, 0.9]]
    cell = make_cell()
    found = plan(make_path(points, [0.0, 0.0, -1.0]), cell)
    assert not found.errors
    told = grades(found, cell)
    assert told[2] == told[1]
    assert grade_counts(found, cell)["invalid"] == 0
    points[1][0] = points[2][0] = 9.0
    found = plan(make_path(points, [0.0, 0.0, -1.0]), cell)
    assert grades(found, cell)[1:3].tolist() == [Grade.INVALID] * 2
