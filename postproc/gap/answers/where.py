"""Where the gap lies: by joint, by cell of the workspace, by direction, by condition."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.answers.shrinkage import rms
from postproc.gap.data import Samples
from postproc.gap.robot_model import States, effect_of, evaluate
from postproc.geometry import abc_from_rotation, orthonormalised, rotation_angle, rotation_from_abc
from postproc.measurement import rigid_motion
from postproc.records import dataclass
from postproc.units import DEG, MM

_CELLS = 3
"""Cells along the longest side of the measured box."""


@dataclass(frozen=True, slots=True)
class Part:
    """What one adopted effect moves: points (n, 3) [m], and joints (n, 6) [rad]."""

    name: str
    moved: FloatArray
    joint_change: FloatArray


def parts(diagnosis: Diagnosis) -> tuple[Part, ...]:
    """Return what each adopted effect moves, alone, on top of the given model."""
    samples, given = diagnosis.problem.samples, diagnosis.problem.given
    start, rest = evaluate(samples, given)
    found = []
    for name in diagnosis.adopted:
        states = dict(given) | {name: diagnosis.fit.states[name]}
        point, actual = evaluate(samples, states)
        found.append(Part(name, point - start, actual.q - rest.q))
    return tuple(found)


def where(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the ``where`` of the diagnosis, file units."""
    own = parts(diagnosis)
    kept = diagnosis.kept
    gap = diagnosis.problem.rest(diagnosis.baseline)
    explained = sum((p.moved for p in own), np.zeros_like(gap))
    subject = explained if own else gap
    return {
        "joints": _joints(diagnosis.problem.samples, own, subject, kept),
        "cells": _cells(diagnosis.problem.measured[kept], np.linalg.norm(gap, axis=1)[kept]),
        "direction": _direction(diagnosis.problem.samples, subject[kept], kept),
        "conditions": _conditions(diagnosis, own, gap[kept]),
    }


def _joints(
    samples: Samples, own: tuple[Part, ...], subject: FloatArray, kept: BoolArray
) -> list[dict[str, Any]]:
    """Return the share of each joint: by its own turns, else by projection on the Jacobian."""
    J = samples.jacobian[kept]
    turning = [p for p in own if bool(np.any(p.joint_change))]
    if turning:
        turn = sum((p.joint_change for p in turning), np.zeros_like(turning[0].joint_change))[kept]
    else:
        damp = 1e-2 * float(np.mean(np.einsum("nij,nij->n", J, J)))
        A = J @ np.swapaxes(J, 1, 2) + damp * np.eye(3)
        turn = np.einsum("nij,ni->nj", J, np.linalg.solve(A, subject[kept][:, :, None])[:, :, 0])
    energy = np.sum((J * turn[:, None, :]) ** 2, axis=(0, 1))
    total = float(energy.sum())
    share = energy / total if total > 0 else energy
    order = np.argsort(-share, kind="stable")
    return [{"joint": int(i) + 1, "share": round(float(share[i]), 4)} for i in order]


def _cells(points: FloatArray, size: FloatArray) -> list[dict[str, Any]]:
    low, high = points.min(axis=0), points.max(axis=0)
    edge = max(float(np.max(high - low)) / _CELLS, MM)
    counts = np.maximum(np.ceil((high - low) / edge - 1e-9), 1).astype(int)
    step = np.maximum((high - low) / counts, MM)
    index = np.minimum(((points - low) / step).astype(int), counts - 1)
    found = []
    for cell in np.unique(index, axis=0):
        inside = np.all(index == cell, axis=1)
        corner = low + cell * step
        found.append(
            {
                "min_mm": np.round(corner / MM, 3).tolist(),
                "max_mm": np.round((corner + step) / MM, 3).tolist(),
                "n": int(inside.sum()),
                "rms_mm": round(rms(size[inside]) / MM, 5),
            }
        )
    return sorted(found, key=lambda c: (-c["rms_mm"], c["min_mm"]))


def _direction(samples: Samples, subject: FloatArray, kept: BoolArray) -> dict[str, Any]:
    """Return the axis along which most of the gap lies, and the share along the flange axis."""
    total = float(np.sum(subject**2))
    if total <= 0.0:
        return {"axis": [0.0, 0.0, 1.0], "share": 0.0, "flange_axis_share": 0.0}
    _, s, vt = np.linalg.svd(subject, full_matrices=False)
    axis = vt[0]
    mean = subject.mean(axis=0) @ axis
    lead = mean if abs(mean) > 1e-12 else axis[int(np.argmax(np.abs(axis)))]
    axis = axis * np.sign(lead)
    _, _, R = samples.arm.link_constants()
    along = samples.frames[kept, 6, :3, :3] @ R[:, 2]
    share = float(np.sum(np.einsum("ni,ni->n", along, subject) ** 2)) / total
    return {
        "axis": np.round(axis, 4).tolist(),
        "share": round(float(s[0] ** 2) / total, 4),
        "flange_axis_share": round(share, 4),
    }


def _conditions(
    diagnosis: Diagnosis, own: tuple[Part, ...], gap: FloatArray
) -> list[dict[str, Any]]:
    """Return the share of the gap's square that each condition brings, strongest first."""
    total = float(np.sum(gap**2)) or 1.0
    share: dict[str, float] = {}
    kept = diagnosis.kept
    for part in own:
        energy = float(np.sum(part.moved[kept] ** 2)) / total
        for name, weight in _weights(diagnosis.problem.samples, part, kept).items():
            share[name] = max(share.get(name, 0.0), energy * weight)
    rows = max(int(kept.sum()), 1)
    for test in diagnosis.tests:
        if test.p_value < 1e-4:
            left = test.rms**2 * rows / total
            share[test.name] = max(share.get(test.name, 0.0), left)
    ranked = sorted(share.items(), key=lambda item: (-item[1], item[0]))
    return [{"name": name, "share": round(min(value, 1.0), 4)} for name, value in ranked]


def _weights(samples: Samples, part: Part, kept: BoolArray) -> dict[str, float]:
    """Return the conditions of an effect; joints by how much enters at each."""
    found: dict[str, float] = {}
    energy = np.sum(
        (samples.jacobian[kept] * part.joint_change[kept][:, None, :]) ** 2, axis=(0, 1)
    )
    share = energy / energy.sum() if energy.sum() > 0 else energy
    for name in effect_of(part.name).conditions:
        if name in ("joint angle", "pose"):
            found |= {f"q{i + 1}": float(share[i]) for i in range(6) if share[i] > 0.02}
        elif name in ("q2", "q3") and share.sum() > 0:
            found[name] = float(share[int(name[1]) - 1])
        else:
            found[name] = 1.0
    return found


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
