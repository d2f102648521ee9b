"""A joint errs in its own way at each angle: gear and encoder errors that are no clean waves."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, State, register
from postproc.model import ModelFile, entry
from postproc.units import DEG

_STEPS = (4, 8, 12, 20)
"""Distances of the angles of a table [deg]; those of the wrist are the next coarser ones."""
_LEFT_OUT = (0, 1)
"""Periods per turn that a fit leaves to other effects."""
_ROWS_EACH = 4
"""Rows for each angle of a table."""


@register
class AngleError(Effect):
    """A table of each joint's error over its own angle, straight between angles.

    Angles are counted on the circle: the gear of a joint is the same after a whole turn. Where no
    row was measured nothing is known, and nothing is corrected. A fit leaves the mean and one
    period per turn out: they cannot be told from offsets, geometry, gravity and springs, which say
    what they do at other poses.
    """

    name = "angle_error"
    title = "a joint errs in its own way at each of its angles"
    source = "dq = f(q) of each joint, piecewise linear"
    action = "compensate with model.toml; have gear and encoder of the named joints looked at"
    conditions = ("joint angle",)
    is_rare = True
    on_demand = True

    def prepare(self, samples: Samples) -> Setting:
        """Return the steps (6,) [deg] and the angles that rows lie next to, a joint and a number.

        The tables are coarser where rows are few.
        """
        most = max(len(samples) // _ROWS_EACH, 1)
        found: Setting = {}
        for fine, coarse in itertools.pairwise(_STEPS):
            step = [fine] * 3 + [coarse] * 3
            knots = [
                (joint, int(k)) for joint in range(6) for k in _seen(samples.q, joint, step[joint])
            ]
            found = {"step_deg": step, "joint": [j + 1 for j, _ in knots]}
            found = {**found, "knot": [k for _, k in knots], "left_out": _LEFT_OUT}
            if len(knots) <= most:
                break
        return found

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the error [rad] at each angle."""
        del arm
        return tuple(
            Parameter(f"joint_{joint}_at_{knot * setting['step_deg'][joint - 1]:g}", 1.5e-4)
            for joint, knot in zip(setting["joint"], setting["knot"], strict=True)
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn a joint by the error between the two angles that it is at."""
        joint, knot, step = (np.asarray(setting[k]) for k in ("joint", "knot", "step_deg"))
        left_out = setting.get("left_out", ())
        turn = np.zeros((len(samples), 6, len(joint)))
        for j in range(6):
            here = np.flatnonzero(joint == j + 1)
            column = np.full(round(360.0 / step[j]), -1)
            column[knot[here]] = here
            below = np.floor(samples.q[:, j] / DEG / step[j])
            part = samples.q[:, j] / DEG / step[j] - below
            for number, share in ((below, 1.0 - part), (below + 1.0, part)):
                at = column[number.astype(np.int32) % len(column)]
                rows = np.flatnonzero(at >= 0)
                turn[rows, j, at[rows]] = share[rows]
            turn[:, j, here] = _without(turn[:, j, here], knot[here] * step[j] * DEG, left_out)
        return Basis(joint=turn)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return steps, joints, angles and errors of the tables."""
        del arm
        joint, knot, step = (np.asarray(state.setting[k]) for k in ("joint", "knot", "step_deg"))
        return {
            "step_deg": [float(s) for s in step],
            "joint": [int(j) for j in joint],
            "angle_deg": [float(angle) for angle in knot * step[joint - 1]],
            "error_deg": entry("error_deg", np.nan_to_num(state.theta)),
            "periods_left_out": [int(n) for n in state.setting.get("left_out", ())],
        }

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the tables."""
        del arm
        known = ["step_deg", "joint", "angle_deg", "error_deg", "periods_left_out"]
        model.require_known(self.name, known)
        step = np.asarray(model.values(self.name, "step_deg", (6,))) / DEG
        joint = np.asarray(model.values(self.name, "joint", (None,))).astype(np.int32)
        shape = (len(joint),)
        angle = np.asarray(model.values(self.name, "angle_deg", shape)) / DEG
        error = np.asarray(model.values(self.name, "error_deg", shape))
        knot = np.round(angle / step[joint - 1]).astype(np.int32)
        low = model.values(self.name, "periods_left_out", (None,), optional=True)
        setting = {"step_deg": step.tolist(), "joint": joint.tolist(), "knot": knot.tolist()}
        left_out = [] if low is None else [int(n) for n in low]
        return State(error, {**setting, "left_out": left_out})


def _without(columns: FloatArray, angle: FloatArray, periods: Sequence[int]) -> FloatArray:
    """Return columns (n, k) of values at angles (k,) without some periods per turn; 0: the mean."""
    waves = [f(n * angle) for n in periods for f in ((np.cos, np.sin) if n else (np.cos,))]
    if not waves:
        return columns
    low = np.linalg.qr(np.column_stack(waves))[0]
    return np.asarray(columns - (columns @ low) @ low.T)


def _seen(q: FloatArray, joint: int, step: float) -> IntArray:
    """Return the numbers of the angles on the circle that rows lie within a step of."""
    below = np.floor(q[:, joint] / DEG / step).astype(np.int32)
    return np.unique(np.concatenate([below, below + 1]) % round(360.0 / step))
