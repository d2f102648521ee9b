"""Lead and side tilt: where a path allows them, what poses they give, the best sequence of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.cell import parse_cell
from postproc.cell.cell import Workpiece
from postproc.cell.schema import TiltRange
from postproc.errors import CellError
from postproc.geometry.frames import angle_between
from postproc.model.toolpath import Arcs, Cycle, MotionKind
from postproc.planning import planner, repairs
from postproc.planning.attempt import Attempt
from postproc.planning.job import checker_of, problem_of
from postproc.planning.planner import plan
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states.settings import (
    settle,
)
from postproc.planning.states.tilt import FEW_TILTS, MOST_TILTS, feed_directions, tilt_grid
from postproc.units import DEG
from tests.cells import FEED, STIFFNESS, cell_text
from tools.bench.paths import bare_path

UP = np.array([0.0, 0.0, 1.0])
RAPID, LINEAR, ARC, HOLE = MotionKind.RAPID, MotionKind.LINEAR, MotionKind.ARC, MotionKind.HOLE
TILTED = {"lead_deg": [-10.0, 10.0], "side_tilt_deg": [0.0, 10.0], "tilt_step_deg": 10.0}
AHEAD = Workpiece(1, np.array([[1, 0, 0, 1.8], [0, 1, 0, 0.1], [0, 0, 1, 0.8], [0, 0, 0, 1.0]]))


def feeds(toolpath):
    return feed_directions(toolpath, np.asarray(toolpath.axes))


class TestFeedDirection:
    def test_ends_and_corners(self, make_path):
        points = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0.1]]
        found = feeds(make_path(points, UP, [RAPID, LINEAR, LINEAR, LINEAR]))
        half = np.sqrt(0.5)
        assert np.allclose(found, [[1, 0, 0], [half, half, 0], [-half, half, 0], [-1, 0, 0]])

    def test_it_lies_across_the_tool_axis(self, make_path):
        axis = np.array([0.3, 0.2, 1.0]) / np.linalg.norm([0.3, 0.2, 1.0])
        found = feeds(make_path([[0, 0, 0], [1, 0, 0]], axis, [RAPID, LINEAR]))
        assert np.abs(found @ axis).max() < 1e-12
        assert (found[:, 0] > 0.9).all()

    def test_arcs_take_their_tangents(self, make_path):
        arcs = Arcs(np.zeros((1, 3)), np.array([[0, 0, -1.0]]), np.ones(1), np.array([np.pi / 2]))
        path = make_path([[0, 1, 0], [1, 0, 0]], UP, [RAPID, ARC], arc=[-1, 0], arcs=arcs)
        assert np.allclose(feeds(path), [[1, 0, 0], [0, -1, 0]])

    def test_no_direction(self, make_path):
        kinds = [RAPID, LINEAR, LINEAR, LINEAR, RAPID, HOLE, LINEAR]
        points = [[0, 0, 1], [0, 0, 0], [1, 0, 0], [0.5, 0.01, 0], [0, 0, 1], [2, 0, 0], [2, 0, 0]]
        cycles = (Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),)
        cycle = [-1, -1, -1, -1, -1, 0, -1]
        found = feeds(make_path(points, UP, kinds, cycle=cycle, cycles=cycles))
        # A plunge, its bottom, a turn back, an end, a rapid, a hole, a cut of no length.
        assert np.isfinite(found[:, 0]).tolist() == [False, True, False, True, False, False, False]


@pytest.mark.parametrize(
    ("lead", "side", "holder"),
    [
        (10.0, 0.0, [np.sin(10 * DEG), 0.0, np.cos(10 * DEG)]),
        (-10.0, 0.0, [-np.sin(10 * DEG), 0.0, np.cos(10 * DEG)]),
        (0.0, 20.0, [0.0, -np.sin(20 * DEG), np.cos(20 * DEG)]),
        (45.0, 30.0, [np.cos(30 * DEG) / np.sqrt(2), -0.5, np.cos(30 * DEG) / np.sqrt(2)]),
    ],
)
def test_the_tool_leans_as_asked_about_its_tip(make_cell, make_path, lead, side, holder):
    limits = {"lead_deg": [-45.0, 45.0], "side_tilt_deg": [-45.0, 45.0]}
    cell, settings = settle(make_cell(options=limits))
    toolpath = make_path([[0, 0, 0], [0.1, 0, 0]], UP, [RAPID, LINEAR])
    place = problem_of(toolpath, cell, settings).placement
    for spin in (0.0, 1.0):
        attitude = np.tile([spin, lead * DEG, side * DEG], (2, 1))
        T = place.tcp(np.arange(2), attitude, 0.05)
        assert np.allclose(-T[:, :3, :3] @ cell.tool.axis, holder, atol=1e-12)
        assert np.allclose(T[:, :3, 3], toolpath.points + 0.05 * np.array(holder), atol=1e-12)


def test_grid_holds_zero_first_and_both_ends():
    grid = tilt_grid(TiltRange((-7 * DEG, 10 * DEG), (0.0, 0.0), 5 * DEG), 36, 10) / DEG
    assert grid[0].tolist() == [0.0, 0.0]
    assert sorted(np.round(grid[:, 0], 9).tolist()) == [-7, -5, 0, 5, 10]


@pytest.mark.parametrize("tags", [1, 1000, 100_000])
def test_grid_is_bounded(tags):
    allowed = TiltRange((-45 * DEG, 45 * DEG), (-45 * DEG, 45 * DEG), 0.5 * DEG)
    grid = tilt_grid(allowed, 36, tags)
    assert 9 <= len(grid) <= MOST_TILTS
    allowed = TiltRange((-10 * DEG, 10 * DEG), (-10 * DEG, 10 * DEG), 5 * DEG)
    assert len(tilt_grid(allowed, 36, min(tags, 1000))) == FEW_TILTS
    assert len(tilt_grid(allowed, 36, min(tags, 1000), few=False)) == MOST_TILTS
    assert len(grid) == 9 or len(grid) * 36 * tags <= 1_000_000
    assert np.abs(grid).max() == pytest.approx(45 * DEG)


def test_too_fine_a_turn_is_refused(make_cell):
    cell = make_cell(optimize={"step": 1.0 * DEG}, options=TILTED)
    with pytest.raises(CellError, match="PLN207"):
        settle(cell)


@pytest.mark.slow
@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("weight", [0.0, 0.1, 1.0])
def test_brute_force_over_spin_and_tilt(make_cell, make_path, weight):
    """Every sequence of spins, tilts, branches and turns, costs by finite differences."""
    cell = make_cell(
        optimize={
            "step": 30.0 * DEG,
            "range": (30.0 * DEG, 90.0 * DEG),
            "objective": {"axial": 1.0, "tilt": weight, "travel": 0.05},
        },
        options=TILTED | {"refine": False},
        bases=(AHEAD,),
    )
    toolpath = make_path([[0, 0, 0], [0.05, 0, 0], [0.1, 0.04, 0]], UP, [RAPID, LINEAR, LINEAR])
    checker = checker_of(toolpath, *settle(cell))
    search = PoseSearch.of(checker, np.arange(3))
    search.ladder.joins = None  # how the tool leans between tags is not asked
    path = search.standing()
    problem = checker.problem
    forward = np.array([[1, 0, 0], [1, 0, 0], [0.05, 0.04, 0]])
    forward[1] = [1, 0, 0] + np.array([5, 4, 0]) / np.sqrt(41)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    rungs = [states_by_hand(problem, tag, forward[tag], weight) for tag in range(3)]
    cost, branch, q = zip(*rungs, strict=True)
    steps = []
    length = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1) / 0.01
    cost = [c * s for c, s in zip(cost, np.convolve(length, [0.5, 0.5]), strict=True)]
    for a, b in itertools.pairwise(range(3)):
        leap = np.abs(q[a][:, None] - q[b][None])
        step = 0.05 / length[a] * ((leap / (10 * DEG)) ** 2).sum(axis=2)
        keeps = (branch[a][:, None] == branch[b][None]) & (leap.max(axis=2) <= np.pi)
        steps.append(np.where(keeps, step, np.inf))
    total = (
        cost[0][:, None, None]
        + cost[1][None, :, None]
        + cost[2][None, None]
        + steps[0][:, :, None]
        + steps[1][None]
    )
    assert search.ladder.total(path) == pytest.approx(float(total.min()), rel=1e-4, abs=2e-5)
    if weight == 0.0:
        assert (search.states.attitude_of(path)[:, 1:] != 0.0).any()


def states_by_hand(problem, tag, forward, weight):
    """Return cost (m,), best 0, branch (m,) and joints (m, 6) of all poses of a tag."""
    right = np.cross(forward, UP)
    cost, branch, joints = [], [], []
    for spin, lead, side in itertools.product((30, 60, 90), (-10, 0, 10), (0, 10)):
        lead_, side_ = lead * DEG, side * DEG
        axis = np.cos(side_) * (np.cos(lead_) * UP + np.sin(lead_) * forward)
        axis = axis + np.sin(side_) * right
        cross = np.cross(UP, axis)
        angle = np.arctan2(np.linalg.norm(cross), axis @ UP)
        turn = cross / max(np.linalg.norm(cross), 1e-15) * angle
        R = Rotation.from_rotvec(turn).as_matrix() @ problem.placement.rotation(
            np.array([tag]), np.array([spin * DEG])
        )
        T = np.eye(4)[None].copy()
        T[0, :3, :3], T[0, :3, 3] = R, problem.placement.p_base_tcp[tag]
        slots, valid = problem.kinematics.ik(problem.placement.flange(T, np.zeros(0)))
        for slot in np.flatnonzero(valid[0]):
            for turns in itertools.product((-1, 0, 1), repeat=6):
                q = slots[0, slot] + 2 * np.pi * np.array(turns)
                if problem.within(q[None])[0] and problem.regular(q[None])[0]:
                    joints.append(q)
                    branch.append(slot)
                    k = axial_stiffness(problem, q, axis)
                    cost.append(-np.log(k) + weight * (angle / (10 * DEG)) ** 2)
    cost = np.array(cost)
    return cost - cost.min(), np.array(branch), np.array(joints)


def axial_stiffness(problem, q, axis):
    """Return 1 / (n^T J C J^T n) with J by differences of the forward kinematics."""
    T_flange_tcp, h = problem.cell.tool.T_flange_tcp, 1e-6

    def tip(q):
        return (problem.kinematics.fk(q) @ T_flange_tcp)[:3, 3]

    n = problem.placement.T_robroot_base[:3, :3] @ axis
    rows = [n @ (tip(q + h * e) - tip(q - h * e)) / (2 * h) for e in np.eye(6)]
    return 1.0 / float(np.sum(np.square(rows) / problem.cell.joint_stiffness))


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_cuts_keep_their_range_and_holes_stand(make_cell, make_path, strategy):
    tilts = {"lead_deg": [-8.0, 12.0], "side_tilt_deg": [0.0, 6.0]}
    wishes = {"strategy": strategy, "objective": {"radial": 1.0, "tilt": 0.0}}
    cell = make_cell(options=wishes | tilts, bases=(AHEAD,))
    x = np.linspace(0.0, 0.2, 11)
    points = np.concatenate([np.stack([x, 0 * x, 0 * x], axis=1), [[0.2, 0.1, 0], [0.3, 0.1, 0]]])
    kinds = [RAPID] + [LINEAR] * 10 + [HOLE, HOLE]
    cycles = (Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),)
    cycle = [-1] * 11 + [0, 0]
    result = plan(make_path(points, UP, kinds, cycle=cycle, cycles=cycles), cell)
    assert not result.errors
    axis = -result.T_base_tcp[:, :3, :3] @ cell.tool.axis
    lead, side = np.arctan2(axis[:, 0], axis[:, 2]) / DEG, np.arcsin(-axis[:, 1]) / DEG
    cut = result.tag <= 10
    assert ((lead >= -8 - 1e-6) & (lead <= 12 + 1e-6)).all()
    assert ((side >= -1e-6) & (side <= 6 + 1e-6)).all()
    assert max(np.abs(lead[cut]).max(), side[cut].max()) > 1.0
    behind = np.flatnonzero(~cut)[1:]  # the first one backs off from the cut as the tool stands
    assert angle_between(axis[behind], UP).max() < 1e-9
    at_tag = np.searchsorted(result.tag, np.arange(11))
    assert np.allclose(result.T_base_tcp[at_tag, :3, 3], points[:11], atol=1e-12)
    alone = plan(
        make_path(points, UP, kinds, cycle=cycle, cycles=cycles),
        make_cell(options=wishes, bases=(AHEAD,)),
    )
    assert np.nanmean(result.stiffness[:11]) > np.nanmean(alone.stiffness[:11])


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize(
    ("shift", "is_asked", "tried"), [(0.0, True, [9]), (9.0, True, [9]), (9.0, False, [9, 25])]
)
def test_more_tilts_are_tried_before_a_cut_is_refused(
    make_cell, make_path, monkeypatch, shift, is_asked, tried
):
    """Unless a tag is out of reach with all of them."""
    points = [[1.8 + shift, y, 0.8] for y in (0.0, 0.01, 0.02)]
    ranges = {"lead_deg": [-10, 10], "side_tilt_deg": [-10, 10]}
    seen, search = [], Attempt._search_by

    def counted(attempt, checker):
        seen.append(len(checker.problem.tilts))
        search(attempt, checker)

    monkeypatch.setattr(Attempt, "_search_by", counted)
    if not is_asked:
        monkeypatch.setattr(repairs, "_is_out_of_reach", lambda *_: False)
    found = planner.plan(make_path(points, [0.0, 0.0, 1.0]), make_cell(options=ranges))
    assert seen == tried
    assert bool(found.errors) == (shift > 0.0)


def leaning_slot(lean=5.0 * DEG):
    """Return a cut between walls that lean: no tag has a pose at 0 or 10 deg."""
    gap, high, thick = 30.0, 150.0, 20.0
    up, across = (
        np.array([np.sin(lean), 0, np.cos(lean)]),
        np.array([np.cos(lean), 0, -np.sin(lean)]),
    )
    foot = np.array([1900.0, 0.0, 800.0]) + (high / 2.0 + 2.0) * up
    middles = (foot + side * (gap + thick) / 2.0 * across for side in (-1.0, 1.0))
    walls = "".join(
        f'[[obstacles]]\nname = "wall_{k}"\nbox = {{ size_mm = [{thick}, 200, {high}] }}\n'
        f"xyz_mm = {middle.round(4).tolist()}\nabc_deg = [0, 5, 0]\n"
        for k, middle in enumerate(middles)
    )
    shank = (
        "[[tool.meshes]]\ncylinder = { radius_mm = 5, length_mm = 250 }\n"
        "xyz_mm = [172, 0, 362]\nabc_deg = [0, 90, 0]\n"
    )
    wishes = "[optimize]\nstep_deg = 30\nlead_deg = [-10, 10]\nside_tilt_deg = [-10, 10]\n"
    place = {"tcp": (300, 0, 362), "tool": shank, "origin": (1900, 0, 800)}
    cell = parse_cell(cell_text(walls, STIFFNESS, wishes, FEED, **place).encode(), "cell.toml")
    points = np.outer([-0.01, 0.0, 0.01], [0.0, 1.0, 0.0])
    return bare_path("slot", points, [0.0, 0.0, 1.0], feed=0.01), cell


def test_a_slot_that_leans_between_two_tilts_of_the_first_grid_is_milled():
    lean = 5.0 * DEG
    path, cell = leaning_slot(lean)
    found = planner.plan(path, cell)
    assert not found.errors
    axis = -found.T_base_tcp[:, :3, :3] @ cell.tool.axis
    assert np.abs(np.arctan2(axis[:, 0], axis[:, 2]) - lean).max() < 3.0 * DEG
