"""Stiffness fields: the paper's rule at borders by hand, continuity, the model file and back."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc.errors import DataError, StiffnessError
from postproc.gap import stiffness_of, stiffness_tables
from postproc.model.modelfile import ModelFile, load_model, save_model
from postproc.stiffness.field import ConstantField, ContinuousField, Grid, GridField, kernel

GRID = Grid(np.zeros(3), np.array([0.1, 0.2, 0.3]), (2, 2, 2))
Q = np.zeros((1, 6))


def stiffness_by_hand(c, point):
    """Return the mean stiffness of all cells whose closed box holds the point (Section 2.3)."""
    held = []
    for number, corner in enumerate(itertools.product(range(2), repeat=3)):
        low = np.array(corner) * GRID.size
        if np.all(point >= low - 1e-9) and np.all(point <= low + GRID.size + 1e-9):
            held.append(1.0 / c[number])
    return np.mean(held, axis=0), len(held)


@pytest.mark.parametrize(
    ("point", "cells"),
    [
        ([0.05, 0.1, 0.1], 1),
        ([0.1, 0.1, 0.1], 2),  # face
        ([0.1, 0.2, 0.1], 4),  # edge
        ([0.1, 0.2, 0.3], 8),  # corner
        ([0.0, 0.1, 0.1], 1),  # face of one cell only
        ([0.2, 0.4, 0.6], 1),  # outer corner
    ],
)
def test_paper_rule_at_special_positions(point, cells):
    c = np.random.default_rng(0).uniform(1.0, 2.0, size=(8, 6)) * 1e-7
    expected, count = stiffness_by_hand(c, np.array(point))
    assert count == cells
    field = GridField(GRID, c, blend=False)
    np.testing.assert_allclose(field.stiffness(Q, np.array([point]))[0], expected, rtol=1e-12)


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.floats(-0.2, 0.8), min_size=3, max_size=3),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
)
def test_blend_never_jumps_and_stays_between_its_cells(start, direction):
    c = np.exp(np.random.default_rng(1).normal(size=(8, 6))) * 1e-7
    field = GridField(GRID, c, blend=True)
    here = np.array([start])
    there = here + 1e-6 * np.array([direction])
    a, b = field.compliance(Q, here), field.compliance(Q, there)
    assert np.max(np.abs(np.log(a / b))) < 1e-6 * 6.0 / GRID.size.min() * 4.0
    assert np.all(a >= c.min(axis=0) * (1 - 1e-12))
    assert np.all(a <= c.max(axis=0) * (1 + 1e-12))


def test_blend_has_the_cells_value_at_its_centre():
    c = np.random.default_rng(2).uniform(1.0, 2.0, size=(8, 6))
    centres = GRID.lowest + 0.5 * GRID.size
    field = GridField(GRID, c, blend=True)
    np.testing.assert_allclose(field.compliance(np.zeros((8, 6)), centres), c, rtol=1e-12)


def test_outside_the_grid_the_nearest_cell_counts():
    c = np.arange(1.0, 49.0).reshape(8, 6)
    for blend in (True, False):
        field = GridField(GRID, c, blend=blend)
        far = field.compliance(Q, np.array([[9.0, 9.0, 9.0]]))
        np.testing.assert_allclose(far[0], c[-1])


def test_unseen_joints_take_the_fallback():
    c = np.array([np.nan, 1e-7, 1e-7, 1e-7, 1e-7, np.nan])
    field = ConstantField(c)
    assert field.compliance(np.zeros(6)).tolist() == [0.0, 1e-7, 1e-7, 1e-7, 1e-7, 0.0]
    helped = field.with_fallback(np.full(6, 1e6))
    assert helped.compliance(np.zeros((2, 6)))[1, 0] == pytest.approx(1e-6)
    assert field.observed.tolist() == [False, True, True, True, True, False]


def test_a_cell_that_saw_less_leans_on_its_neighbours():
    c = np.full((8, 6), 2e-7)
    c[0, 3] = np.nan
    point = GRID.size * np.array([0.9, 0.9, 0.9])
    field = GridField(GRID, c, blend=True)
    assert field.compliance(Q, point[None])[0, 3] == pytest.approx(2e-7)


def test_grid_needs_the_tool_point_or_a_way_to_find_it():
    field = GridField(GRID, np.full((8, 6), 1e-7))
    with pytest.raises(StiffnessError, match="STF006"):
        field.compliance(Q)
    located = GridField(GRID, field.c_joint, locate=lambda q: np.zeros((len(q), 3)))
    assert located.compliance(Q).shape == (1, 6)


def test_kernel_is_the_gaussian_of_the_scaled_distance():
    rng = np.random.default_rng(3)
    a, b, lengths = rng.normal(size=(4, 6)), rng.normal(size=(3, 6)), rng.uniform(0.5, 2.0, 6)
    literal = [[np.exp(-0.5 * np.sum(((x - y) / lengths) ** 2)) for y in b] for x in a]
    np.testing.assert_allclose(kernel(a, b, lengths), literal, rtol=1e-12)


def test_a_joints_own_angle_adds_its_own_sum():
    rng = np.random.default_rng(5)
    nodes, own_nodes = rng.normal(size=(4, 6)), rng.normal(size=(3, 6))
    lengths, own_lengths = rng.uniform(0.5, 2.0, (2, 6))
    base, weights, own_weights = (
        rng.normal(size=6),
        rng.normal(size=(4, 6)),
        rng.normal(size=(3, 6)),
    )
    field = ContinuousField(nodes, lengths, base, weights, own_nodes, own_lengths, own_weights)
    q = rng.normal(size=(2, 6))
    for row, c in zip(q, field.compliance(q), strict=True):
        for i in range(6):
            log = base[i]
            for node, weight in zip(nodes, weights[:, i], strict=True):
                log += weight * np.exp(-0.5 * np.sum(((row - node) / lengths) ** 2))
            for node, weight in zip(own_nodes[:, i], own_weights[:, i], strict=True):
                log += weight * np.exp(-0.5 * ((row[i] - node) / own_lengths[i]) ** 2)
            assert c[i] == pytest.approx(np.exp(log), rel=1e-12)


def fields():
    rng = np.random.default_rng(4)
    continuous = ContinuousField(
        rng.normal(size=(5, 6)),
        rng.uniform(0.5, 2.0, 6),
        np.log(np.full(6, 1e-7)),
        rng.normal(size=(5, 6)),
    )
    own = rng.normal(size=(3, 6)), rng.uniform(0.5, 2.0, 6), rng.normal(size=(3, 6))
    with_own = ContinuousField(
        continuous.nodes, continuous.lengths, continuous.base, continuous.weights, *own
    )
    c = rng.uniform(1.0, 2.0, size=(8, 6)) * 1e-7
    c[:, 0] = np.nan
    return [
        ConstantField(c[0]),
        GridField(GRID, c),
        GridField(GRID, c, blend=False),
        continuous,
        with_own,
    ]


@pytest.mark.parametrize("field", fields(), ids=lambda f: type(f).__name__)
def test_round_trip_through_the_model_file(field, tmp_path):
    path = tmp_path / "model.toml"
    mean = np.array([np.nan, 1.0, 2.0, 3.0, 4.0, 5.0]) * 1e-7
    path.write_bytes(save_model(ModelFile(stiffness_tables(field, mean))))
    back = stiffness_of(load_model(path))
    if isinstance(field, ConstantField):
        field = ConstantField(mean)
    rng = np.random.default_rng(5)
    q, p = rng.normal(size=(20, 6)), rng.uniform(0.0, 0.5, size=(20, 3))
    np.testing.assert_allclose(back.compliance(q, p), field.compliance(q, p), rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (('kind = "grid"', 'kind = "grid"\ncolour = 3'), "MOD004"),
        (("counts = [2, 2, 2]", "counts = [2, 2, 3]"), "MOD006"),
        (("counts = [2, 2, 2]", "counts = [2, 2, 0]"), "MOD006"),
        (('between_cells = "blend"', 'between_cells = "magic"'), "MOD006"),
        (("cell_mm", "# cell_mm"), "MOD005"),
        (("cell_mm = [100.0", "cell_mm = [nan"), "MOD006"),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(change, code, tmp_path):
    path = tmp_path / "model.toml"
    text = save_model(ModelFile(stiffness_tables(fields()[1], np.full(6, 1e-7)))).decode()
    assert change[0] in text
    path.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(DataError, match=rf"model\.toml:\d+: error {code}"):
        stiffness_of(load_model(path))


def test_a_grid_without_volume_is_refused():
    with pytest.raises(StiffnessError, match="STF005"):
        Grid(np.zeros(3), np.array([0.1, 0.0, 0.1]), (1, 1, 1))
