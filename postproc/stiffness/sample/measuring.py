"""What a measuring plan is: postures, the loads to put on, the CSV to fill in, the outlook."""

from __future__ import annotations

import math

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.kinematics import Kinematics, build
from postproc.measurement import DIRECTION, JOINTS, POSITION, WRENCH, cells, table_to_fill_in
from postproc.process import weight_wrench
from postproc.records import dataclass
from postproc.stiffness.cartesian import regressor
from postproc.stiffness.field import Grid
from postproc.stiffness.identify import TYPICAL_C, Observability, ShowingLoad, shown_text
from postproc.stiffness.sample.sampling import SamplingPlan, SamplingRules
from postproc.units import DEG, MM, STANDARD_GRAVITY

TRACKER_SIGMA = 17e-6
"""Sd per axis [m] of a loaded minus unloaded tracker reading (12 um each), for forecasts."""


@dataclass(frozen=True, slots=True)
class Load:
    """A load that can be put on the tool: a weight hung at a point, or a constant force.

    ``mass`` [kg] at ``p_flange`` (3,) [m]; or ``force`` (3,) [N] at the tool point, robroot.
    """

    name: str
    mass: float = 0.0
    p_flange: FloatArray | None = None
    force: FloatArray | None = None

    def wrench(self, q: FloatArray, cell: Cell, kinematics: Kinematics) -> FloatArray:
        """Return (n, 6) ON the tool at the tool point, robroot [N, N*m]."""
        tcp = cell.tool.T_flange_tcp[:3, 3]
        if self.force is not None:
            return np.tile(np.concatenate([self.force, np.zeros(3)]), (len(q), 1))
        at = tcp if self.p_flange is None else self.p_flange
        lever = kinematics.fk(q)[:, :3, :3] @ (at - tcp)
        return weight_wrench(self.mass, cell.robot.gravity, lever)


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """What to plan. Lengths [m], angles [rad].

    ``method``: ``grid`` (every posture) or ``optimal`` (the ``count`` most telling for ``model``);
    ``wait`` [s] at each posture; ``halt``: wait for the operator instead; ``speed`` 0..1 of PTP.
    """

    grid: Grid
    rules: SamplingRules
    loads: tuple[Load, ...]
    name: str = "sample"
    method: str = "grid"
    model: str = "continuous"
    count: int = 64
    wait: float = 5.0
    halt: bool = False
    speed: float = 0.3


@dataclass(frozen=True, slots=True)
class Sampling:
    """A measuring plan with what it will be able to tell.

    ``blocked``: postures left out because no way to them is free. ``way``: numbers of the postures
    of one pass from 1, negative to pass without reading; ``back``: numbers to pass on the way from
    the last posture to the first.
    """

    plan: SamplingPlan
    request: SampleRequest
    cell: Cell
    outlook: Observability
    shown_by: dict[int, ShowingLoad]
    blocked: tuple[str, ...]
    way: tuple[int, ...]
    back: tuple[int, ...] = ()

    @property
    def travel(self) -> float:
        """Sum of the largest joint motion of every step [rad], one pass."""
        steps = np.abs(np.diff(self.plan.q, axis=0))
        return float(steps.max(axis=1).sum()) if len(steps) else 0.0


def largest_force(loads: tuple[Load, ...]) -> float:
    """Return the largest force [N] of the loads, 500 without any."""
    sizes = [
        float(np.linalg.norm(load.force))
        if load.force is not None
        else load.mass * STANDARD_GRAVITY
        for load in loads
    ]
    return max([size for size in sizes if size > 0.0], default=500.0)


def expected_compliance(cell: Cell) -> FloatArray:
    """Return the compliances (6,) [rad/(N*m)] that the cell lets expect."""
    known = cell.joint_stiffness
    return TYPICAL_C if known is None else np.asarray(1.0 / known)


def load_regressors(
    plan: SamplingPlan, cell: Cell, kinematics: Kinematics, loads: tuple[Load, ...]
) -> FloatArray:
    """Return (n, 3 loads, 6): what each load does at each posture per unit compliance."""
    J = kinematics.jacobian(plan.q, cell.tool.T_flange_tcp[:3, 3])
    parts = [regressor(J, load.wrench(plan.q, cell, kinematics))[:, :3] for load in loads]
    return np.concatenate(parts, axis=1)


def csv_text(sampling: Sampling) -> bytes:
    """Return the CSV to fill in: one row a reading, in the order of the program."""
    plan, cell = sampling.plan, sampling.cell
    kinematics = build(cell.robot)
    step = np.diff(plan.q, axis=0, prepend=plan.q[:1])
    direction = np.where(np.abs(step) > 1e-7, np.sign(step), 0.0)
    notes = (
        "fill in x_mm, y_mm, z_mm: the measured tool point in the robot root frame",
        "(any tracker frame will do: then identify with --register)",
        "fx_N..mz_Nm: load ON the tool at the tool point, axes of the robot root",
    )
    rows = []
    for load in (None, *sampling.request.loads):
        wrench = np.zeros((len(plan), 6)) if load is None else load.wrench(plan.q, cell, kinematics)
        label = "none" if load is None else load.name
        for i in range(len(plan)):
            row = {"id": f"{plan.name(i)}_{label}", "group": f"T{int(plan.tag[i]) + 1:04d}"}
            row |= {"load": label} | cells(JOINTS, plan.q[i] / DEG, 5) | dict.fromkeys(POSITION, "")
            rows.append(row | cells(WRENCH, wrench[i], 4) | cells(DIRECTION, direction[i], 0))
    return table_to_fill_in(notes, rows)


def sample_document(sampling: Sampling, files: list[str]) -> dict[str, object]:
    """Return the ``postproc.sample/1`` document."""
    plan, outlook = sampling.plan, sampling.outlook
    return {
        "schema": "postproc.sample/1",
        "files": files,
        "cells": len(plan.grid),
        "cell_mm": [round(float(v) / MM, 6) for v in plan.grid.size],
        "tags": len(plan.points),
        "tags_used": len(np.unique(plan.tag)),
        "postures": len(plan),
        "readings": len(plan) * (1 + len(sampling.request.loads)),
        "travel_deg": round(sampling.travel / DEG, 3),
        "dropped": [
            {"tag": f"T{tag + 1:04d}", "angle_deg": _angle(sampling, turn), "reason": reason}
            for tag, turn, reason in plan.dropped
        ]
        + [{"posture": name, "reason": "the way to it collides"} for name in sampling.blocked],
        "joints": [
            {
                "joint": joint + 1,
                "status": str(outlook.visibility[joint]),
                "expected_sd_percent": _percent(outlook.relative_sd[joint]),
                "shown_by": shown_text(sampling.shown_by.get(joint)),
            }
            for joint in range(6)
        ],
    }


def _angle(sampling: Sampling, turn: int) -> float:
    return round(float(sampling.request.rules.angles[turn]) / DEG, 6)


def _percent(value: float) -> float | None:
    return round(100.0 * float(value), 3) if math.isfinite(value) else None
