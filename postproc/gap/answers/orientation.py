"""Measured orientations: an independent check that no fit has used.

Effects are fitted to measured points. Where the tool's orientation was measured too, the model says
what it should be, up to how the target sits on the tool; an effect that is right brings the
orientations nearer as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.answers.shrinkage import rms
from postproc.gap.data import Samples
from postproc.gap.robot_model import States, evaluate
from postproc.geometry import abc_from_rotation, orthonormalised, rotation_angle, rotation_from_abc
from postproc.measurement import rigid_motion
from postproc.units import DEG

_ROUNDS = 20


def orientation(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """Return how far the measured orientations are off, file units; None without them.

    Before: under the given model. After: with what was adopted. In both the rotation of the target
    on the flange is fitted, and the frame's where it is registered.
    """
    problem = diagnosis.problem
    if problem.measurements.abc is None:
        return None
    rows = np.flatnonzero(diagnosis.kept)
    samples = problem.samples.rows(rows)
    R_measured_tool = rotation_from_abc(np.asarray(problem.measurements.abc)[rows])
    whole = problem.whole
    T = rigid_motion(problem.measured[whole], np.asarray(problem.measurements.position)[whole])
    R_robroot_tool = T[:3, :3].T @ R_measured_tool
    turned = problem.registration is not None
    before, _ = _misfit(flange_rotation(samples, problem.given), R_robroot_tool, turned)
    named = {n: s for n, s in diagnosis.fit.states.items() if n not in diagnosis.resembled}
    after, R_flange_tool = _misfit(flange_rotation(samples, named), R_robroot_tool, turned)
    return {
        "rows": len(rows),
        "rms_before_deg": round(before / DEG, 5),
        "rms_after_deg": round(after / DEG, 5),
        "tool_abc_deg": [round(float(v) / DEG, 4) for v in abc_from_rotation(R_flange_tool)],
    }


def flange_rotation(samples: Samples, states: States) -> FloatArray:
    """Return the real R_robroot_flange (n, 3, 3), from three points a metre off the flange."""
    ends = []
    for place in np.concatenate([np.zeros((1, 3)), np.eye(3)]):
        ends.append(evaluate(samples.with_points(measured=place), states)[0])
    return orthonormalised(np.stack([end - ends[0] for end in ends[1:]], axis=-1))


def _misfit(
    R_real: FloatArray, R_robroot_tool: FloatArray, turned: bool
) -> tuple[float, FloatArray]:
    """Return the rms angle [rad] and the R_flange_tool (3, 3) that makes it smallest."""
    R_frame = np.eye(3)
    for _ in range(_ROUNDS if turned else 1):
        seen = R_frame @ R_robroot_tool
        R_flange_tool = _mean(np.swapaxes(R_real, 1, 2) @ seen)
        if turned:
            R_frame = _mean(R_real @ R_flange_tool @ np.swapaxes(R_robroot_tool, 1, 2))
    angle = rotation_angle(R_real @ R_flange_tool, R_frame @ R_robroot_tool)
    return rms(angle), R_flange_tool


def _mean(R: FloatArray) -> FloatArray:
    """Return the mean rotation (3, 3) of many."""
    return orthonormalised(R.mean(axis=0))
