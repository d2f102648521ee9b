"""Where the loads of a registered campaign act: at the tool point, or at the reflector.

The wrench of a measurement counts at the tool point of the cell. Where the reflector sits elsewhere
and its place is unknown, "the tool point" of whoever filled in the file may as well be the point
that was measured: a rope tied to the reflector's nest. The rows tell which, as soon as the joints
give way by more than the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.gap.dataset import Samples
from postproc.gap.effect import REGISTRY
from postproc.gap.registration import in_robroot, register
from postproc.gap.robot_model import States, columns, evaluate
from postproc.model.arrays import BoolArray, FloatArray
from postproc.model.modelfile import Registration

NEAR = 5e-3
"""A reflector within this [m] of the tool point makes no difference worth asking for."""
SURE = 6.0
"""Nats that the reflector has to be ahead: without proof it is the tool point."""
_FAULT = 4.0
_MAD_OF_CHI3 = 1.538
_FRAMES = ("base_frame", "tool_frame")


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
    models = [_Library.of(_with_point_at(rows, place), y, given) for rows in (samples, at_point)]
    left = [model.left(1e-5) for model in models]
    sound = np.minimum(*left) < _FAULT * np.median(np.minimum(*left))
    sigma = min(float(np.median(size[sound])) for size in left) / _MAD_OF_CHI3
    here, there = (model.evidence(max(sigma, 1e-6), sound) for model in models)
    if there < here + SURE:
        return first
    return replace(register(at_point, measured, given), loads_at_point=True)


@dataclass(frozen=True, slots=True)
class _Library:
    """Gap y (n, 3) [m] and the columns (n, 3, p) of the effects of the library, by name."""

    y: FloatArray
    columns: dict[str, FloatArray]

    @classmethod
    def of(cls, samples: Samples, y: FloatArray, given: States) -> _Library:
        point, actual = evaluate(samples, given)
        parts = {}
        for name, effect in REGISTRY:
            if effect.kind == "suspect" or not all(samples.has(c) for c in effect.needs):
                continue
            setting = given[name].setting if name in given else effect.prepare(samples)
            typical = np.array([p.typical for p in effect.parameters(samples.arm, setting)])
            parts[name] = columns(actual, effect.basis(actual, setting)) * typical
        return cls(y - point, parts)

    def left(self, sigma: float) -> FloatArray:
        """Return what the most probable numbers leave of each row (n,) [m], noise sigma [m]."""
        A = np.concatenate(list(self.columns.values()), axis=2)
        flat = A.reshape(-1, A.shape[2])
        H = flat.T @ flat + sigma**2 * np.eye(flat.shape[1])
        theta = np.linalg.solve(H, flat.T @ self.y.ravel())
        return np.asarray(np.linalg.norm(self.y - A @ theta, axis=1))

    def evidence(self, sigma: float, sound: BoolArray) -> float:
        """Return the log evidence [nats] on some rows, of what is the simplest that will do.

        The frames alone, with a give under the loads, or everything: a place that is right needs
        little beside it, a wrong one much.
        """
        ladders = (_FRAMES, (*_FRAMES, "joint_compliance"), tuple(self.columns))
        return max(self._evidence(names, sigma, sound) for names in ladders)

    def _evidence(self, names: tuple[str, ...], sigma: float, sound: BoolArray) -> float:
        A = np.concatenate([self.columns[name] for name in names], axis=2)
        flat = A[sound].reshape(-1, A.shape[2]) / sigma
        y = self.y[sound].ravel() / sigma
        L = np.linalg.cholesky(flat.T @ flat + np.eye(flat.shape[1]))
        z = np.linalg.solve(L, flat.T @ y)
        return float(0.5 * (z @ z - y @ y) - np.sum(np.log(np.diag(L))))


def _with_load_at(samples: Samples, place: FloatArray) -> Samples:
    return replace(samples, arm=replace(samples.arm, p_flange_load=place)).at(samples.q)


def _with_point_at(samples: Samples, place: FloatArray) -> Samples:
    return replace(samples, arm=replace(samples.arm, p_flange_point=place)).at(samples.q)
