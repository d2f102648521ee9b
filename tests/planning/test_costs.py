"""Objectives against their definitions, weights, and objectives of other people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.choices import Index, Preset
from postproc.cell.schema import Process
from postproc.errors import CellError
from postproc.kinematics import build
from postproc.planning.states.costs import (
    OBJECTIVES,
    TRAVEL_OF,
    Objective,
    StateContext,
    state_costs,
    weights_of,
)


@pytest.fixture
def context(make_cell):
    cell = make_cell()
    kinematics = build(cell.robot)
    rng = np.random.default_rng(4)
    q = np.array([0.1, -1.2, 1.5, 0.3, 0.8, -0.4]) + rng.uniform(-0.3, 0.3, (20, 6))
    T = kinematics.fk(q) @ cell.tool.T_flange_tcp
    normal = np.cross(T[:, :3, 0], [0.0, 0.0, 1.0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    c_joint = 1.0 / np.asarray(cell.joint_stiffness)
    tags = np.arange(20)
    return StateContext(kinematics, cell, q, tags, np.zeros(20), T[:, :3, :3], normal, c_joint)


def give(context, direction):
    """Displacement along a direction per newton along it, by springs in series."""
    rows = []
    for q, n in zip(context.q, direction, strict=True):
        J = context.kinematics.jacobian(q, context.cell.tool.T_flange_tcp[:3, 3])
        torque = J[:3].T @ n
        rows.append(n @ (J[:3] @ (torque * context.c_joint)))
    return np.array(rows)


def test_axial_and_normal_are_springs_in_series(context):
    assert np.allclose(
        OBJECTIVES.get("axial")(context), 1.0 / give(context, context.R_robroot_tcp[:, :, 0])
    )
    assert np.allclose(OBJECTIVES.get("normal")(context), 1.0 / give(context, context.normal))


def test_process_follows_the_force(context):
    cell = replace(context.cell, process=Process((0.0, 3.0, 4.0)))
    turned = StateContext(
        context.kinematics, cell, context.q, context.tag, context.spin,
        context.R_robroot_tcp, context.normal, context.c_joint,
    )  # fmt: skip
    direction = context.R_robroot_tcp @ np.array([0.0, 0.6, 0.8])
    assert np.allclose(OBJECTIVES.get("process")(turned), 1.0 / give(context, direction))
    still = replace(context.cell, process=Process())
    turned.cell = still
    with pytest.raises(CellError, match="force_N is zero"):
        OBJECTIVES.get("process")(turned)


def test_radial_is_the_weakest_across(context):
    weakest = np.full(20, np.inf)
    for angle in np.linspace(0.0, np.pi, 361):
        across = context.R_robroot_tcp @ np.array([0.0, np.cos(angle), np.sin(angle)])
        weakest = np.minimum(weakest, 1.0 / give(context, across))
    assert np.allclose(OBJECTIVES.get("radial")(context), weakest, rtol=1e-4)


def test_index_ellipsoid_is_another_number(context):
    ellipsoid = StateContext(
        context.kinematics,
        replace(context.cell, optimize=replace(context.cell.optimize, index=Index.ELLIPSOID)),
        context.q, context.tag, context.spin,
        context.R_robroot_tcp, context.normal, context.c_joint,
    )  # fmt: skip
    for name in ("axial", "normal", "radial"):
        values = OBJECTIVES.get(name)
        assert not np.allclose(values(ellipsoid), values(context), rtol=0.01)


def test_costs_of_joints(context):
    low, high = context.kinematics.q_min, context.kinematics.q_max
    context.q = np.stack([0.5 * (low + high), high])
    assert np.allclose(OBJECTIVES.get("limits")(context), [0.0, 1.0])
    context.spin = np.array([0.0, np.pi / 9.0])
    assert np.allclose(OBJECTIVES.get("spin")(context), [0.0, 4.0])


def test_singularity_falls_with_a_bent_wrist(context):
    q = np.tile(context.q[0], (3, 1))
    q[:, 4] = [0.0, 0.3, 1.2]
    context.q = q
    cost = OBJECTIVES.get("singularity")(context)
    assert cost[0] > cost[1] > cost[2] >= 0.0
    assert cost[0] == pytest.approx(1.0, abs=1e-6)


def test_weights(make_cell, context):
    weights = weights_of(make_cell(optimize={"objective": {"axial": 2.0, "limits": 0.5}}))
    assert [name for name, _, _ in weights.states] == ["axial", "limits"]
    assert weights.travel == TRAVEL_OF[Preset.BALANCED]
    assert weights.main[0] == "axial"
    cost, index = state_costs(weights, context)
    axial = OBJECTIVES.get("axial")(context)
    assert np.allclose(index, axial)
    assert np.allclose(cost, -2.0 * np.log(axial) + 0.5 * OBJECTIVES.get("limits")(context))


def test_without_stiffness_travel_rules(make_cell, robot):
    weights = weights_of(make_cell(robot=replace(robot, joint_stiffness=None)))
    assert [name for name, _, _ in weights.states] == ["margin", "wrist"]
    assert "no joint stiffness" in weights.notes[0]


def test_an_objective_of_someone_else(make_cell, context, monkeypatch):
    """What an entry point would add: a function of the context, wrapped."""
    dict(OBJECTIVES)
    parts = {**OBJECTIVES._parts, "low": Objective(lambda c: c.q[:, 1] ** 2)}
    monkeypatch.setattr(OBJECTIVES, "_parts", parts)
    weights = weights_of(make_cell(optimize={"objective": {"low": 1.0}}))
    assert np.allclose(state_costs(weights, context)[0], context.q[:, 1] ** 2)
