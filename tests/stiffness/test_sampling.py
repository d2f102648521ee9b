"""The measuring plan: counts in closed form, reach by the twin's own kinematics, order, choice."""

import itertools

import numpy as np
import pytest

from postproc.errors import StiffnessError
from postproc.geometry.frames import rotation_y
from postproc.measurement.file import read_measurements
from postproc.stiffness.sample.measuring import Load, SampleRequest, csv_text
from postproc.stiffness.sample.sampling import (
    SamplingRules,
    axis_parallel,
    box_grid,
    choose,
    features,
    grid_tags,
    plan_sampling,
    travel_order,
)
from tools.dev.hidden_twin import Twin

from .conftest import HIGH, LOW, WEIGHT, wrench_of

RULES = SamplingRules(np.array([0.0, 1.0, 0.0]), np.radians([-10.0, 0.0, 10.0]), np.eye(3))


@pytest.fixture(scope="module")
def plan(arm, cell):
    grid = box_grid(LOW, HIGH, 0.3)
    return plan_sampling(grid, arm, cell.tool.T_flange_tcp, RULES)


@pytest.mark.parametrize(("edge", "cells", "tags"), [(0.6, 2, 14), (0.3, 16, 61), (0.15, 128, 353)])
def test_nine_tags_a_cell_with_corners_once(edge, cells, tags):
    grid = box_grid(LOW, HIGH, edge)
    points, of_cells = grid_tags(grid)
    nx, ny, nz = grid.counts
    assert len(grid) == cells == nx * ny * nz
    assert len(points) == tags == (nx + 1) * (ny + 1) * (nz + 1) + nx * ny * nz
    assert len(np.unique(np.round(points, 9), axis=0)) == tags
    share = np.bincount([cell for near in of_cells for cell in near])
    assert np.all(share == 9)  # nine tags serve every cell
    for point, near in zip(points, of_cells, strict=True):
        for cell in near:
            low = grid.lowest[cell]
            assert np.all(point >= low - 1e-9)
            assert np.all(point <= low + grid.size + 1e-9)


def test_cells_fill_the_box_exactly():
    grid = box_grid(np.zeros(3), np.array([1.0, 0.5, 0.2]), 0.3)
    np.testing.assert_allclose(grid.size * grid.counts, [1.0, 0.5, 0.2])
    assert grid.counts == (3, 2, 1)


def test_postures_are_where_the_plan_says(plan):
    twin = Twin()
    np.testing.assert_allclose(twin.point(plan.q), plan.points[plan.tag], atol=2e-6)
    R = twin.chain(plan.q)[2][:, :3, :3] @ np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(R, rotation_y(plan.angle), atol=2e-6)
    assert len(plan) + len(plan.dropped) == 3 * len(plan.points)


def test_limits_and_singular_wrist_are_kept(plan, arm):
    assert np.all(arm.within_limits(plan.q, RULES.joint_margin - 1e-6))
    assert np.all(np.abs(plan.q[:, 4]) >= RULES.singularity - 1e-6)


def test_order_is_shorter_than_the_lattice(plan, arm):
    def travel(q):
        return np.abs(np.diff(q, axis=0)).max(axis=1).sum()

    lattice = np.lexsort((plan.angle, plan.tag))
    assert travel(plan.q) < 0.6 * travel(plan.q[lattice])
    # a tag's postures follow each other
    changes = np.flatnonzero(np.diff(plan.tag)) + 1
    assert len(changes) + 1 == len(np.unique(plan.tag))


def test_order_finds_the_shortest_of_a_few(arm):
    rng = np.random.default_rng(3)
    q = rng.uniform(-0.5, 0.5, size=(6, 6))
    weight = 1.0 / (arm.q_max - arm.q_min)

    def cost(order):
        return np.abs(np.diff(q[list(order)] * weight, axis=0)).max(axis=1).sum()

    ours = travel_order(q, np.arange(6, dtype=np.int32), arm)
    best = min(cost(p) for p in itertools.permutations(range(6)))
    assert cost(ours) <= 1.15 * best


def test_collisions_leave_postures_out(arm, cell):
    grid = box_grid(LOW, HIGH, 0.6)
    everything = plan_sampling(grid, arm, cell.tool.T_flange_tcp, RULES)
    half = plan_sampling(grid, arm, cell.tool.T_flange_tcp, RULES, lambda q: q[:, 0] < 0.0)
    assert 0 < len(half) < len(everything)
    assert {reason for _, _, reason in half.dropped} >= {"collision"}


def test_orientation_is_found_when_none_is_given(arm, cell):
    free = SamplingRules(RULES.axis, RULES.angles)
    grid = box_grid(LOW, HIGH, 0.3)
    found = plan_sampling(grid, arm, cell.tool.T_flange_tcp, free)
    fixed = plan_sampling(grid, arm, cell.tool.T_flange_tcp, RULES)
    assert len(found) >= len(fixed)
    assert len(axis_parallel()) == 24


@pytest.mark.parametrize(
    ("low", "high", "edge", "code"),
    [
        (HIGH, LOW, 0.3, "STF020"),
        (LOW, HIGH, -1.0, "STF020"),
        (LOW, HIGH, 0.001, "STF021"),
        (np.array([9.0, 9.0, 9.0]), np.array([9.5, 9.5, 9.5]), 0.3, "STF022"),
    ],
)
def test_boxes_that_make_no_plan(arm, cell, low, high, edge, code):
    with pytest.raises(StiffnessError, match=code):
        plan_sampling(box_grid(low, high, edge), arm, cell.tool.T_flange_tcp, RULES)


# ----------------------------------------------------------------------- D-optimal subsets


def determinant(A, P, rows):
    """Return log det(1 + X'X) of the posterior, rows written out."""
    X = np.vstack([np.einsum("mj,f->mjf", A[i], P[i]).reshape(len(A[i]), -1) for i in rows])
    return np.linalg.slogdet(np.eye(X.shape[1]) + X.T @ X)[1]


def test_choice_is_near_the_best_subset():
    rng = np.random.default_rng(4)
    A, P = rng.normal(size=(9, 3, 6)), np.ones((9, 1))
    ours = choose(A, P, np.ones(6), 1.0, 3)
    best = max(determinant(A, P, rows) for rows in itertools.combinations(range(9), 3))
    assert determinant(A, P, ours) >= 0.95 * best


@pytest.mark.parametrize("model", ["constant", "grid", "continuous"])
def test_choice_beats_chance(plan, arm, cell, model):
    from postproc.stiffness.cartesian import regressor

    twin = Twin()
    A = regressor(arm.jacobian(plan.q, twin.tcp), wrench_of(twin, plan.q, WEIGHT, twin.com))[:, :3]
    P = features(model, plan.q, plan.points[plan.tag], plan.grid)
    c = 1.0 / np.asarray(cell.joint_stiffness)
    ours = choose(A, P, c, 17e-6, 12)
    scaled = A * c / 17e-6
    chance = [
        determinant(scaled, P, np.random.default_rng(k).choice(len(A), 12, replace=False))
        for k in range(20)
    ]
    assert determinant(scaled, P, ours) > max(chance)
    assert len(set(ours.tolist())) == 12


def test_unknown_model_has_no_plan():
    with pytest.raises(StiffnessError, match="STF023"):
        features("other", np.zeros((2, 6)), np.zeros((2, 3)))


# ------------------------------------------------------------------------------ the files


@pytest.fixture(scope="module")
def sampling(cell):
    from postproc.jobs.sample import sample

    loads = (
        Load("50kg", 50.0, np.array([0.0535, 0.0, 0.362])),
        Load("y", force=np.array([0, 300.0, 0])),
    )
    return sample(cell, SampleRequest(box_grid(LOW, HIGH, 0.6), RULES, loads))


def test_csv_holds_the_wrench_of_the_hung_weight(sampling, tmp_path):
    twin = Twin()
    text = csv_text(sampling).decode()
    filled = text.replace(",,,,", ",1,2,3,")
    path = tmp_path / "sample.csv"
    path.write_text(filled, encoding="utf-8")
    measured = read_measurements(path)
    assert len(measured) == 3 * len(sampling.plan)
    n = len(sampling.plan)
    expected = wrench_of(twin, sampling.plan.q, WEIGHT, twin.com)
    np.testing.assert_allclose(measured.wrench[n : 2 * n], expected, atol=1e-3)
    assert np.all(measured.wrench[:n] == 0.0)
    np.testing.assert_allclose(measured.wrench[2 * n :, 1], 300.0)
    np.testing.assert_array_equal(
        measured.direction[1:n], np.sign(np.round(np.diff(sampling.plan.q, axis=0), 8))
    )


def test_outlook_warns_before_the_measurement(cell):
    from postproc.jobs.sample import sample

    request = SampleRequest(box_grid(LOW, HIGH, 0.6), RULES, (Load("50kg", 50.0),))
    made = sample(cell, request)
    assert not made.outlook.seen[0]
    assert not made.outlook.seen[5]
    assert abs(made.shown_by[0].direction[1]) > 0.7


def test_program_stops_at_every_posture_in_every_pass(sampling):
    from postproc.jobs.sample import program_files

    files = program_files(sampling)
    text = files["sample.src"].decode()
    readings = 3 * len(sampling.plan)
    assert text.count("PTP {A1") == readings
    assert text.count("WAIT SEC 5") == readings
    assert text.count("HALT ;") == 2  # before each load
    assert text.index("put on load: 50kg") < text.index("put on load: y")


def wall(q_from, q_to):
    """Return whether ways are free of a wall across axis 1 with a door in axis 2."""
    crosses = (q_from[:, 0] > 0.0) != (q_to[:, 0] > 0.0)
    door = np.minimum(q_from[:, 1], q_to[:, 1]) > np.radians(-58.0)
    return ~crosses | door


def test_the_way_goes_round_what_is_not_free(plan):
    from postproc.jobs.drive import with_free_ways

    part, blocked, way, back = with_free_ways(plan, wall)
    assert not blocked
    assert len(part) == len(plan)
    assert [k for k in way if k > 0] == list(range(1, len(plan) + 1))
    assert any(k < 0 for k in way)
    ring = np.abs([*way, *back, way[0]]) - 1
    assert np.all(wall(plan.q[ring[:-1]], plan.q[ring[1:]]))


def test_the_way_may_go_through_postures_that_are_not_read():
    from postproc.jobs.drive import free_ways

    left, right = np.zeros((1, 6)), np.zeros((1, 6))
    left[0, :2], right[0, :2] = (-0.5, -1.2), (0.5, -1.2)
    doors = np.zeros((3, 6))
    doors[:, 0], doors[:, 1] = (0.1, -0.5, 0.5), (-1.4, -0.9, -0.9)
    alone, _, way, _ = free_ways(np.vstack([left, right]), wall)
    assert len(alone) == 1
    assert way == (1,)
    kept, q, way, back = free_ways(np.vstack([left, right]), wall, doors)
    assert kept.tolist() == [0, 1]
    assert [k > 0 for k in way] == [True, False, False, True]
    ring = q[np.abs([*way, *back, way[0]]) - 1]
    np.testing.assert_array_equal(ring[[0, 3]], np.vstack([left, right]))
    np.testing.assert_array_equal(ring[[1, 2]], doors[1:])
    assert np.all(wall(ring[:-1], ring[1:]))


def test_postures_without_any_free_way_are_left_out(plan):
    from postproc.jobs.drive import with_free_ways

    part, blocked, way, _ = with_free_ways(plan, lambda a, b: (a[:, 0] > 0.0) == (b[:, 0] > 0.0))
    assert len(part) + len(blocked) == len(plan)
    assert len(np.unique(part.q[:, 0] > 0.0)) == 1
    assert len(part) >= len(plan) // 2 - 10
    assert sum(k > 0 for k in way) == len(part)


def test_passing_moves_take_no_reading(sampling):
    from dataclasses import replace

    from postproc.jobs.drive import motion_plan
    from postproc.jobs.sample import drive_of

    n = len(sampling.plan)
    way = (1, -3, *range(2, n + 1))
    made = motion_plan(drive_of(replace(sampling, way=way, back=(4, 2))))
    assert len(made) == 3 * (n + 1) + 2 * 2
    assert int(np.sum(made.dwell > 0.0)) == 3 * n
    np.testing.assert_allclose(made.q[1], sampling.plan.q[2])
