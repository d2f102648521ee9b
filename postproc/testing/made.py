"""Made-up cell, measurements and states that the checks use where the caller gives none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from postproc.cell import ArcMotion, Cell, load_cell
from postproc.gap import RobotModel, Samples, make_samples
from postproc.kinematics import Kinematics, build
from postproc.measurement import SetUps
from postproc.model import Plan
from postproc.planning import StateContext, plan
from postproc.readers import read
from postproc.units import DEG

_LOW = np.array([-60.0, -115.0, 10.0, -170.0, -100.0, -170.0]) * DEG
_TO_SIDE = np.array([0.0, 0.04, -0.03])
"""From one reflector to the other, in the flange [m]."""
_HIGH = np.array([60.0, -15.0, 120.0, 170.0, 100.0, 170.0]) * DEG


@cache
def made_cell() -> Cell:
    """Return a KUKA KR 500 with a spindle and nothing in its way."""
    return load_cell(Path(__file__).with_name("cell.toml"))


@cache
def made_arm() -> Kinematics:
    """Return the arm of ``made_cell``."""
    return build(made_cell().robot)


@cache
def made_plan(arcs: bool = True) -> Plan:
    """Return the plan of a small part in ``made_cell``: cuts, holes and an arc.

    Args:
        arcs: False: the arc is a row of short lines.
    """
    cell = made_cell()
    if not arcs:
        cell = replace(cell, motion=replace(cell.motion, arcs=ArcMotion.LIN))
    return plan(read(Path(__file__).with_name("part.apt")), cell)


def made_samples(rows: int = 80, spread: float = 1.0) -> Samples:
    """Return measurements with every column filled, at random postures.

    Two stations see two reflectors, which sit at different places of the tool.

    Args:
        rows: how many.
        spread: share of the arm's usual range that the postures are drawn from.
    """
    rng = np.random.default_rng(8)
    middle, half = 0.5 * (_LOW + _HIGH), 0.5 * spread * (_HIGH - _LOW)
    force = rng.normal(size=(rows, 3))
    force *= rng.uniform(200.0, 1500.0, (rows, 1)) / np.linalg.norm(force, axis=1, keepdims=True)
    time = np.cumsum(rng.uniform(10.0, 30.0, rows))
    arm = RobotModel.of(made_arm(), made_cell()).arm
    samples = make_samples(
        arm,
        rng.uniform(middle - half, middle + half, (rows, 6)),
        wrench=np.column_stack([force, np.zeros((rows, 3))]) * (rng.random((rows, 1)) < 0.7),
        direction=rng.choice([-1.0, 1.0], (rows, 6)),
        qd=rng.uniform(-15.0, 15.0, (rows, 6)) * DEG * (rng.random((rows, 1)) < 0.6),
        time=time,
        temperature=30.0 - 9.0 * np.exp(-2.0 * time / time[-1]) + rng.normal(0.0, 1.0, rows),
        extra={
            "tool_no": 1 + np.arange(rows) % 3,
            "fixture": np.array(["left", "right"])[np.arange(rows) // 7 % 2],
            "e1_mm": np.linspace(0.0, 4000.0, rows)[::-1],
        },
    )
    number = np.arange(rows, dtype=np.int32)
    set_ups = SetUps((2 * number) // rows, number % 2, ("left", "right"), ("top", "side"), True)
    points = arm.p_flange_point + set_ups.reflector[:, None] * _TO_SIDE
    return samples.with_set_ups(set_ups, points)


def made_states(count: int = 24) -> StateContext:
    """Return states of as many tags, each in a posture of its own."""
    cell, kinematics = made_cell(), made_arm()
    rng = np.random.default_rng(4)
    q = np.array([5.0, -70.0, 85.0, 20.0, 45.0, -25.0]) * DEG + rng.uniform(-0.3, 0.3, (count, 6))
    R = (kinematics.fk(q) @ cell.tool.T_flange_tcp)[:, :3, :3]
    normal = np.cross(R @ np.asarray(cell.tool.axis), rng.normal(size=(count, 3)))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return StateContext(
        kinematics=kinematics,
        cell=cell,
        q=q,
        tag=np.arange(count),
        spin=rng.uniform(-np.pi, np.pi, count),
        R_robroot_tcp=R,
        normal=normal,
        c_joint=1.0 / np.asarray(cell.joint_stiffness),
        tilt=rng.uniform(0.0, 15.0, count) * DEG,
    )
