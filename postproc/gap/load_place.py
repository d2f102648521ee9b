"""Where the loads of a registered campaign act: at the tool point, or at the reflector.

The wrench of a measurement counts at the tool point of the cell. Where the reflector sits elsewhere
and its place is unknown, "the tool point" of whoever filled in the file may as well be the point
that was measured: a rope tied to the reflector's nest. The rows tell which, as soon as the joints
give way by more than the noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.gap.dataset import Samples
from postproc.gap.effect import REGISTRY
from postproc.gap.registration import in_robroot, register
from postproc.gap.robot_model import States, columns, evaluate
from postproc.model.arrays import FloatArray
from postproc.model.modelfile import Registration

NEAR = 5e-3
"""A reflector within this [m] of the tool point makes no difference worth asking for."""
SURE = 6.0
"""Nats that the reflector has to be ahead: without proof it is the tool point."""
_RIDGE = 1e-6
_FAULT = 4.0


def register_loaded(samples: Samples, measured: FloatArray, given: States) -> Registration:
    """Fit the measured frame, the measured point, and which of the two points carries the loads.

    Args:
        samples: rows; their arm's points are the start.
        measured: (n, 3) points in the measured frame [m].
        given: effects that the model has already; they stay.

    Raises:
        DataError: GAP003 if there are too few rows.
    """
    first = register(samples, measured, given)
    place = first.p_flange_point
    aside = float(np.linalg.norm(place - samples.arm.p_flange_load))
    if samples.wrench is None or not bool(np.any(samples.wrench)) or aside < NEAR:
        return first
    at_point = _with_load_at(samples, place)
    y = in_robroot(first, measured)
    left = [_left(_with_point_at(rows, place), y, given) for rows in (samples, at_point)]
    sound = np.minimum(*left) < _FAULT * np.median(np.minimum(*left))
    square = [float(np.sum(size[sound] ** 2)) for size in left]
    if 1.5 * int(sound.sum()) * np.log(square[0] / max(square[1], 1e-30)) < SURE:
        return first
    return replace(register(at_point, measured, given), loads_at_point=True)


def _left(samples: Samples, y: FloatArray, given: States) -> FloatArray:
    """Return what all effects of the library together leave of each row (n,) [m]."""
    point, actual = evaluate(samples, given)
    parts = []
    for name, effect in REGISTRY:
        if effect.kind == "suspect" or not all(samples.has(column) for column in effect.needs):
            continue
        setting = given[name].setting if name in given else effect.prepare(samples)
        typical = np.array([p.typical for p in effect.parameters(samples.arm, setting)])
        parts.append(columns(actual, effect.basis(actual, setting)) * typical)
    A = np.concatenate(parts, axis=2)
    flat = A.reshape(-1, A.shape[2])
    H = flat.T @ flat
    H += _RIDGE * float(np.trace(H)) / len(H) * np.eye(len(H))
    theta = np.linalg.solve(H, flat.T @ (y - point).ravel())
    return np.asarray(np.linalg.norm(y - point - A @ theta, axis=1))


def _with_load_at(samples: Samples, place: FloatArray) -> Samples:
    return replace(samples, arm=replace(samples.arm, p_flange_load=place)).at(samples.q)


def _with_point_at(samples: Samples, place: FloatArray) -> Samples:
    return replace(samples, arm=replace(samples.arm, p_flange_point=place)).at(samples.q)
