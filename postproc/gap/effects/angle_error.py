"""A joint errs in its own way at each angle: gear and encoder errors that are no clean waves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, State, register
from postproc.model import ModelFile, entry
from postproc.units import DEG

LENGTH = 6.0
"""Angle [deg] over which an error changes: ripple of the gears of two real arms (UR5, UR10)."""
STEP = 3.0
"""Distance of the angles of a table [deg]: half that length."""
TYPICAL = 5e-5
"""Usual error [rad]."""
_LEFT_OUT = (0, 1)
"""Periods per turn that a fit leaves to other effects."""


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
    on_demand = True
    may_be_several = True

    def prepare(self, samples: Samples) -> Setting:
        """Return the steps (6,) [deg], and joint and number of each angle that rows lie next to."""
        knots = [(joint, int(k)) for joint in range(6) for k in _seen(samples.q, joint)]
        return {
            "step_deg": [STEP] * 6,
            "joint": [j + 1 for j, _ in knots],
            "knot": [k for _, k in knots],
            "left_out": _LEFT_OUT,
        }

    def variants(self, setting: Setting) -> dict[str, Setting]:
        """Return the table of each joint."""
        joint, knot = np.asarray(setting["joint"]), np.asarray(setting["knot"])
        return {
            f"{self.name}:{j}": {
                **setting,
                "joint": joint[joint == j].tolist(),
                "knot": knot[joint == j].tolist(),
            }
            for j in np.unique(joint).tolist()
        }

    def joined(self, settings: Sequence[Setting]) -> Setting:
        """Return the tables of several joints."""
        both = {key: [v for s in settings for v in s[key]] for key in ("joint", "knot")}
        return {**settings[0], **both}

    def correlation_root(self, setting: Setting) -> FloatArray:
        """Return the root of a Matern 3/2 correlation over the angles of each joint."""
        joint, knot = np.asarray(setting["joint"]), np.asarray(setting["knot"])
        step = np.asarray(setting["step_deg"])[joint - 1]
        apart = np.abs(knot[:, None] - knot) * step[:, None]
        apart = np.minimum(apart, 360.0 - apart) * (np.sqrt(3.0) / LENGTH)
        same = joint[:, None] == joint
        K = np.where(same, (1.0 + apart) * np.exp(-apart), 0.0)
        return np.asarray(np.linalg.cholesky(K + 1e-6 * np.eye(len(K))))

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the error [rad] at each angle."""
        del arm
        return tuple(
            Parameter(
                f"joint_{joint}_at_{knot * setting['step_deg'][joint - 1]:g}",
                TYPICAL,
                family=f"joint_{joint}",
            )
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
            column[knot[here]] = np.arange(len(here))
            below = np.floor(samples.q[:, j] / DEG / step[j])
            part = samples.q[:, j] / DEG / step[j] - below
            own = np.zeros((len(samples), len(here)))
            for number, share in ((below, 1.0 - part), (below + 1.0, part)):
                at = column[number.astype(np.int32) % len(column)]
                rows = np.flatnonzero(at >= 0)
                own[rows, at[rows]] = share[rows]
            turn[:, j, here] = _without(own, knot[here] * step[j] * DEG, left_out)
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


def _seen(q: FloatArray, joint: int) -> IntArray:
    """Return the numbers of the angles on the circle that rows lie within a step of."""
    below = np.floor(q[:, joint] / DEG / STEP).astype(np.int32)
    return np.unique(np.concatenate([below, below + 1]) % round(360.0 / STEP))
