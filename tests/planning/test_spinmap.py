"""The spin map agrees with the plan, and grades with the margins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.kinematics.model import build
from postproc.model.cell import MeshPlacement
from postproc.model.toolpath import Cycle, MotionKind
from postproc.planning.planner import PlanOptions, plan
from postproc.planning.spinmap import Grade, SpinClass, grades, spin_map
from postproc.units import DEG


def holes(make_path, x=1.9):
    n = 4
    points = np.stack([np.full(n, x), np.linspace(-0.3, 0.3, n), np.full(n, 1.0)], axis=1)
    cycles = (Cycle("drill", 0.0, 0.0, 0.0, feed=0.002),)
    return make_path(points, [-1.0, 0, 0], MotionKind.HOLE, cycle=np.zeros(n, int), cycles=cycles)


def test_map_and_plan_agree(make_cell, make_path):
    """The optimum of each tag is the largest stiffness of its column; the line is the plan's."""
    cell, toolpath = make_cell(), holes(make_path)
    result = plan(toolpath, cell, PlanOptions(strategy="each"))
    found = spin_map(toolpath, cell, result)
    assert np.allclose(np.nanmax(found.stiffness, axis=1), result.stiffness, rtol=1e-5)
    at = np.abs(found.spins[None] - found.chosen[:, None]).argmin(axis=1)
    assert (found.classes[np.arange(4), at] == SpinClass.FREE).all()
    assert np.isnan(found.stiffness[found.classes != SpinClass.FREE]).all()


def test_classes_by_cause(make_cell, make_path):
    cell = make_cell()
    assert (spin_map(holes(make_path, 9.0), cell).classes == SpinClass.UNREACHABLE).all()
    T = np.eye(4)
    T[:3, 3] = [1.9, 0.0, 1.0]
    cage = MeshPlacement("cage", T, size=np.array([1.5, 3.0, 1.5]))
    caged = spin_map(holes(make_path), replace(cell, obstacles=(cage,))).classes
    free = spin_map(holes(make_path), cell).classes
    assert (caged[free == SpinClass.FREE] == SpinClass.COLLISION).all()


def test_csv(make_cell, make_path):
    toolpath = holes(make_path)
    text = spin_map(toolpath, make_cell(), tags=np.array([1, 3])).to_csv(toolpath)
    rows = text.splitlines()
    assert rows[0] == "tag,line,spin_deg,class,stiffness_N_per_mm,chosen_deg"
    assert len(rows) == 1 + 2 * 36
    assert rows[1].startswith("1,11,-180.000,")


def test_grades(make_cell, make_path):
    """A pose at its wrist margin is critical, a failing tag invalid."""
    cell, toolpath = make_cell(), holes(make_path)
    bent = replace(cell, limits=replace(cell.limits, joint_margin=12.0 * DEG))
    bent = replace(bent, limits=replace(bent.limits, singularity=30.0 * DEG))
    result = plan(toolpath, bent)
    wrist = np.abs(result.q[result.tag == 0, 4]).min()
    assert (grades(result, cell) == Grade.GOOD).all()
    near = replace(cell, limits=replace(cell.limits, singularity=wrist - 0.5 * DEG))
    assert grades(result, near)[0] == Grade.CRITICAL
    kinematics = build(cell.robot)
    assert kinematics.within_limits(result.q).all()
    lossy = grades(result, cell, best=result.stiffness / 0.5)
    assert (lossy == Grade.CRITICAL).all()
    failing = plan(holes(make_path, 9.0), cell)
    assert (grades(failing, cell) == Grade.INVALID).all()
