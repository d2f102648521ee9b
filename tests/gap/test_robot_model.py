"""The exact forward model against a robot made by other formulas (product of exponentials)."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.errors import DataError
from postproc.gap.data.reference import reference_of
from postproc.gap.effect import State
from postproc.gap.robot_model import RobotModel, evaluate, tool_point
from postproc.model.modelfile import ModelFile, load_model, save_model


def data_of(world, seed=3, n=40):
    return world.campaign(np.random.default_rng(seed), n)


def test_the_nominal_arm_is_the_same_robot(world, samples_of_data):
    data = data_of(world)
    assert np.abs(samples_of_data(data).point - world.solve(world.Truth(), data)).max() < 1e-12


def test_large_joint_offsets_are_exact(world, samples_of_data):
    data = data_of(world)
    offsets = np.radians([0.5, -1.0, 0.7, 2.0, -1.5, 3.0])
    truth = world.Truth(offsets=offsets)
    got = tool_point(samples_of_data(data), {"joint_offset": State(offsets)})
    assert np.abs(got - world.solve(truth, data)).max() < 1e-12


def test_base_and_tool_are_exact(world, samples_of_data):
    data = data_of(world)
    turn, shift = np.array([0.02, -0.03, 0.01]), np.array([0.1, 0.2, -0.05])
    move = np.array([0.01, -0.02, 0.03])
    truth = world.Truth(base=(turn, shift))
    truth.tcp = truth.tcp + world.R_FLANGE @ move
    states = {
        "base_frame": State(np.concatenate([shift, turn])),
        "tool_frame": State(move),
    }
    got = tool_point(samples_of_data(data), states)
    assert np.abs(got - world.solve(truth, data)).max() < 1e-12


def test_compliance_is_in_equilibrium(world, samples_of_data, cell, kinematics):
    """A soft arm under 20 kN: the load's lever changes with the deflection."""
    data = data_of(world)
    data["wrench"] = 15.0 * data["wrench"]
    truth = world.Truth()
    truth.joint.append(lambda d, now: world.load_torque(d, now) / world.K0)
    samples = samples_of_data(data)
    relative = 1.0 / (world.K0 * reference_of(kinematics, cell).c_joint)
    got, _ = evaluate(samples, {"joint_compliance": State(relative)})
    want = world.solve(truth, data)
    assert np.abs(want - samples.point).max() > 5e-3
    assert np.abs(got - want).max() < 2e-8
    first_order = samples.point + np.einsum(
        "nij,nj->ni", samples.jacobian, samples.load_torque() / world.K0
    )
    assert np.abs(first_order - want).max() > 1e-5


def test_backlash_and_lag_turn_the_joints(world, samples_of_data):
    data = data_of(world)
    gap, lag = np.full(6, 2e-4), np.full(6, 3e-3)
    truth = world.Truth()
    truth.joint.append(lambda d, now: -gap * d["direction"] - lag * d["qd"])
    got = tool_point(samples_of_data(data), {"backlash": State(gap), "servo_lag": State(lag)})
    assert np.abs(got - world.solve(truth, data)).max() < 1e-12


def test_no_rows_have_no_points(samples):
    states = {"gravity_sag": State(np.ones(16)), "joint_offset": State(1e-4 * np.ones(6))}
    point, actual = evaluate(samples.rows(np.zeros(0, dtype=np.int32)), states)
    assert point.shape == (0, 3)
    assert len(actual) == 0


def test_a_joint_that_was_not_seen_counts_as_nothing(samples):
    theta = np.array([np.nan, 1e-4, 0.0, 0.0, 0.0, np.nan])
    blind = tool_point(samples, {"joint_offset": State(theta)})
    assert np.allclose(blind, tool_point(samples, {"joint_offset": State(np.nan_to_num(theta))}))


def test_the_tables_of_the_contract_are_read(tmp_path, kinematics, cell):
    path = tmp_path / "model.toml"
    path.write_text(
        'schema = "postproc.model/1"\n'
        "[effects.joint_compliance]\n"
        "stiffness_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]\n"
        "[effects.joint_offset]\n"
        "offset_deg = [0, 0.012, 0, 0, 0.02, 0]\n"
    )
    model = RobotModel.of(kinematics, cell, load_model(path))
    assert np.allclose(model.states["joint_offset"].theta, np.radians([0, 0.012, 0, 0, 0.02, 0]))
    q = np.radians([[0.0, -90.0, 90.0, 0.0, 30.0, 0.0]])
    wrench = np.array([0.0, 0.0, -1000.0, 0.0, 0.0, 0.0])
    sag = model.displacement(q, wrench)[0]
    jacobian = kinematics.jacobian(q, cell.tool.T_flange_tcp[:3, 3])[0, :3]
    stiffness = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
    turn = jacobian.T @ wrench[:3] / stiffness + np.radians([0, 0.012, 0, 0, 0.02, 0])
    assert np.allclose(sag, jacobian @ turn, atol=4e-5)
    assert np.all(np.isfinite(sag))


def test_an_effect_whose_columns_are_missing_moves_nothing_and_is_named(kinematics, cell):
    model = RobotModel.of(kinematics, cell, ModelFile({"backlash": {"half_gap_deg": [0.01] * 6}}))
    q = np.zeros((2, 6))
    assert model.missing(model.samples(q)) == ("backlash",)
    assert np.allclose(model.displacement(q), 0.0)
    side = {"direction": np.ones((2, 6))}
    assert np.abs(model.displacement(q, conditions=side)).max() > 1e-4


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("[effects.rust]\na = 1\n", "GAP002"),
        ("[effects.backlash]\nhalf_gap_deg = [1, 2]\n", "MOD006"),
        ("[effects.joint_offset]\noffset = [0, 0, 0, 0, 0, 0]\n", "MOD004"),
    ],
)
def test_wrong_tables_name_their_line(tmp_path, kinematics, cell, text, code):
    path = tmp_path / "model.toml"
    path.write_text('schema = "postproc.model/1"\n' + text)
    with pytest.raises(DataError) as caught:
        RobotModel.of(kinematics, cell, load_model(path))
    assert caught.value.code == code
    assert caught.value.source is not None
    assert caught.value.source.line >= 2


def test_grid_stiffness_of_identify_is_the_whole_stiffness(
    world, samples_of_data, cell, kinematics
):
    """A field counts whole; the constant beside it is not added on top."""
    stiffness = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
    softer = [0.5 * k for k in stiffness]
    grid = {
        "kind": "grid",
        "between_cells": "blend",
        "origin_mm": [-9000.0, -9000.0, -9000.0],
        "cell_mm": [18000.0] * 3,
        "counts": [1, 1, 1],
        "stiffness_Nmm_per_rad": [softer],
    }
    both = {"joint_compliance": {"stiffness_Nmm_per_rad": stiffness}, "variable_stiffness": grid}
    one = {"joint_compliance": {"stiffness_Nmm_per_rad": softer}}
    samples = samples_of_data(data_of(world))
    ends = []
    for effects in (both, one):
        path = ModelFile(effects)
        assert save_model(path)
        model = RobotModel.of(kinematics, cell, path)
        ends.append(tool_point(samples, model.states))
    assert np.abs(ends[0] - ends[1]).max() < 1e-12
