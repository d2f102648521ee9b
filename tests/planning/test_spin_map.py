"""The spin map agrees with the plan and with brute force; grades agree with the margins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cell.cell import ExternalAxis, MeshPlacement
from postproc.collision.scene import Scene
from postproc.kinematics import build
from postproc.model.toolpath import Cycle, MotionKind
from postproc.planning.checks import MORE_CLEARANCE
from postproc.planning.checks.working import Grade, grade_counts, grades
from postproc.planning.job import problem_of
from postproc.planning.maps.spin_map import SpinClass, spin_map
from postproc.planning.planner import plan
from postproc.planning.states.settings import (
    PlanOptions,
    settle,
)
from postproc.readers import read
from postproc.units import DEG
from tests.places import FIXTURES


def holes(make_path, x=1.9, n=4):
    points = np.stack([np.full(n, x), np.linspace(-0.3, 0.3, n), np.full(n, 1.0)], axis=1)
    cycles = (Cycle("drill", 0.0, 0.0, 0.0, feed=0.002),)
    return make_path(points, [-1.0, 0, 0], MotionKind.HOLE, cycle=np.zeros(n, int), cycles=cycles)


def map_of(toolpath, cell, **options):
    return spin_map(plan(toolpath, cell, PlanOptions(**options)), cell)


def test_map_and_plan_agree(make_cell, make_path):
    """The optimum of each tag is the largest stiffness of its column; the line is the plan's."""
    cell, toolpath = make_cell(), holes(make_path)
    result = plan(toolpath, cell.with_keys({"strategy": "each"}))
    found = spin_map(result, cell)
    assert np.allclose(np.nanmax(found.stiffness, axis=1), result.stiffness, rtol=1e-5)
    assert np.abs(found.loss).max() < 1e-5
    at = np.abs(found.spins[None] - found.chosen[:, None]).argmin(axis=1)
    assert (found.classes[np.arange(4), at] == SpinClass.FREE).all()
    assert np.isnan(found.stiffness[found.classes != SpinClass.FREE]).all()


def test_the_move_home_is_not_the_spin_of_the_last_tag():
    """The last tag of this path is a rapid, and the arm goes home behind it."""
    folder = FIXTURES / "trim_5axis"
    cell = load_cell(str(folder / "cell.toml"))
    toolpath = read(str(folder / "trim.cls"))
    assert toolpath.kind[-1] == MotionKind.RAPID
    result = plan(toolpath, cell)
    found = spin_map(result, cell)
    there = np.linalg.norm(result.T_base_tcp[:, :3, 3] - toolpath.points[-1], axis=1) < 1e-6
    spins = result.spin[there & (result.tag == len(toolpath) - 1)]
    assert len(spins)
    assert not there[-1], "the program ends at home"
    assert np.abs(found.chosen[-1] - spins[-1]) < 1e-6


def test_classes_are_those_of_every_posture_checked(make_cell, make_path):
    """Brute force over branches at the poses (the cycle has no stroke): best class of any."""
    T = np.eye(4)
    T[:3, 3] = [1.7, -0.1, 1.4]
    post = MeshPlacement("post", T, size=np.array([0.5, 0.3, 0.5]))
    T_head = np.eye(4)
    T_head[2, 3] = 0.2
    head = MeshPlacement("head", T_head, size=np.array([0.2, 0.2, 0.38]))
    cell = make_cell()
    cell = replace(cell, obstacles=(post,), tools=(replace(cell.tool, meshes=(head,)),))
    toolpath = holes(make_path)
    found = map_of(toolpath, cell)
    cell, settings = settle(cell)
    problem = problem_of(toolpath, cell, settings)
    scene = Scene.build(cell, problem.kinematics).kept(MORE_CLEARANCE)
    middle = 0.5 * (problem.kinematics.q_min + problem.kinematics.q_max)
    for tag in range(4):
        for column, spin in enumerate(settings.spins):
            T_base_tcp = problem.placement.tcp(np.array([tag]), np.array([spin]))
            slots, valid = problem.kinematics.ik(problem.placement.flange(T_base_tcp, np.zeros(0)))
            best = SpinClass.UNREACHABLE
            for q in problem.kinematics.nearest(slots[valid], middle):
                if not problem.within(q[None])[0]:
                    kind = SpinClass.JOINT_LIMIT
                elif not problem.regular(q[None])[0]:
                    kind = SpinClass.SINGULAR
                elif scene.check(q[None], contact=np.array([True])).hit[0]:
                    kind = SpinClass.COLLISION
                else:
                    kind = SpinClass.FREE
                best = min(best, kind)
            assert found.classes[tag, column] == best, (tag, spin / DEG)
    assert set(np.unique(found.classes)) >= {SpinClass.FREE, SpinClass.COLLISION}


def test_classes_by_cause(make_cell, make_path):
    cell = make_cell()
    far = map_of(holes(make_path, 9.0), cell)
    assert (far.classes == SpinClass.UNREACHABLE).all()
    assert np.isnan(far.chosen).all()
    T = np.eye(4)
    T[:3, 3] = [1.9, 0.0, 1.0]
    cage = MeshPlacement("cage", T, size=np.array([1.5, 3.0, 1.5]))
    caged = map_of(holes(make_path), replace(cell, obstacles=(cage,))).classes
    free = map_of(holes(make_path), cell).classes
    assert (caged[free == SpinClass.FREE] == SpinClass.COLLISION).all()
    tight = replace(cell, robot=replace(cell.robot, q_min=cell.robot.q_max - 6.0 * DEG))
    assert (map_of(holes(make_path), tight).classes == SpinClass.JOINT_LIMIT).all()
    bent = replace(cell, limits=replace(cell.limits, singularity=89.9 * DEG))
    assert (map_of(holes(make_path), bent).classes == SpinClass.SINGULAR).any()


@pytest.mark.parametrize("reach", [(-180.0, 180.0), (60.0, 120.0)])
def test_the_line_is_the_turn_of_the_poses(make_cell, make_path, reach):
    """A pinned turn stands on the map where it was pinned, whatever the range."""
    cell = make_cell(
        optimize={"range": tuple(v * DEG for v in reach)}, options={"pins": {"1": 93.0}}
    )
    found = map_of(holes(make_path), cell)
    assert found.chosen[1] / DEG == pytest.approx(93.0, abs=1e-6)
    low, high = (found.spins[0] - 5.0 * DEG, found.spins[-1] + 5.0 * DEG)
    runs = found.grade != Grade.INVALID
    assert ((found.chosen[runs] >= low) & (found.chosen[runs] <= high)).all()


def test_external_axes_stand_as_in_the_plan(make_cell, make_path):
    """Holes in reach from two places of a rail only: each is free where the arm then stands."""
    points = np.array([[1.9, -3.0, 1.0], [1.9, 3.0, 1.0]])
    cycles = (Cycle("drill", 0.0, 0.0, 0.0, feed=0.002),)
    toolpath = make_path(
        points, [-1.0, 0, 0], MotionKind.HOLE, cycle=np.zeros(2, int), cycles=cycles
    )
    rail = ExternalAxis("E1", "rail", np.array([0.0, 1, 0]), np.eye(4), -4.0, 4.0, 1.0)
    cell = make_cell(external_axes=(rail,))
    result = plan(toolpath, cell)
    assert len(np.unique(result.external)) > 1
    found = spin_map(result, cell)
    at = np.abs(found.spins[None] - found.chosen[:, None]).argmin(axis=1)
    assert (found.classes[np.arange(2), at] == SpinClass.FREE).all()


def test_csv(make_cell, make_path):
    toolpath = holes(make_path)
    rows = map_of(toolpath, make_cell()).to_csv().splitlines()
    assert rows[0] == ("tag,line,spin_deg,class,stiffness_N_per_mm,chosen_deg,grade,loss_percent")
    assert len(rows) == 1 + 4 * 36
    assert rows[1].startswith("0,10,-180.000,")
    assert rows[-1].split(",")[:3] == ["3", "13", "170.000"]


def test_grades(make_cell, make_path):
    """A pose at its wrist margin is critical, a failing tag invalid."""
    cell, toolpath = make_cell(), holes(make_path)
    bent = replace(cell, limits=replace(cell.limits, joint_margin=12.0 * DEG))
    bent = replace(bent, limits=replace(bent.limits, singularity=30.0 * DEG))
    result = plan(toolpath, bent)
    bend = np.abs(result.q[result.tag == 0, 4])
    wrist = np.minimum(bend, np.pi - bend).min()
    assert (grades(result, cell) == Grade.GOOD).all()
    for room, grade in ((6.0, Grade.GOOD), (3.0, Grade.ACCEPTABLE), (0.5, Grade.CRITICAL)):
        near = replace(cell, limits=replace(cell.limits, singularity=wrist - room * DEG))
        assert grades(result, near)[0] == grade
    kinematics = build(cell.robot)
    assert kinematics.within_limits(result.q).all()
    failing = plan(holes(make_path, 9.0), cell)
    assert (grades(failing, cell) == Grade.INVALID).all()
    assert grade_counts(failing, cell) == {
        "good": 0, "acceptable": 0, "critical": 0, "invalid": 4
    }  # fmt: skip
