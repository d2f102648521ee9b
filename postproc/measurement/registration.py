"""The registration: where the measuring device stands and which point of the flange it sees.

    measured = T_measured_robroot · T_robroot_flange · p_flange_point

with six unknowns of the frame and three of the point (the reflector). Where the flange stands is
given, by the nominal arm or by a model of the real one; what the arm does beyond that stays in the
residual. Rows far off the others lose weight. The point has a wide prior around where it is
expected, which decides only what the postures cannot tell (all at one orientation: the point is
then a shift of the frame).

A registration is of one station and one reflector: rows of others get their own.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import DataError, SourceRef
from postproc.geometry import apply, inverse, rotation_from_vector, transform
from postproc.model import Registration

REACH = 0.5
"""Sd of the prior of the point around where it is expected [m]."""
FEWEST = 6
"""Postures that a registration needs."""
ENOUGH = 12
"""Unloaded postures that suffice without the loaded ones."""
_STEPS = 50
_SETTLED = 1e-10
"""Change [m, rad] that ends the fit."""
_ROUNDING = 1e-9
"""Residuals are not believed to be smaller [m]."""
_SAME = 1e-6
"""Joint angles [rad], or places [m] and directions, that differ by less are one posture."""


def fit_registration(
    T_robroot_flange: FloatArray,
    measured: FloatArray,
    p_flange_start: FloatArray,
    source: SourceRef | None = None,
) -> Registration:
    """Return the registration of one station and one reflector.

    Args:
        T_robroot_flange: (n, 4, 4) where the flange stands [m].
        measured: (n, 3) points in the measured frame [m].
        p_flange_start: (3,) where the measured point is expected in the flange [m].
        source: of the measurements, for the message.

    Raises:
        DataError: MEA012 with fewer than ``FEWEST`` postures, or all on one line.

    Source:
        The robust weights are those of Huber 1964, with the limit at twice the median.
    """
    _require_spread(T_robroot_flange, measured, source)
    start = np.asarray(p_flange_start, dtype=np.float64)
    point = start
    T = rigid_motion(apply(T_robroot_flange, point), measured)
    for _ in range(_STEPS):
        seen = apply(T_robroot_flange, point)
        residual = apply(inverse(T), measured) - seen
        shift, turn, moved = np.split(
            _step(T_robroot_flange[:, :3, :3], seen, residual, start - point), 3
        )
        T = T @ transform(rotation_from_vector(turn), shift)
        point = point + moved
        if np.abs([shift, turn, moved]).max() < _SETTLED:
            break
    rest = measured - apply(T, apply(T_robroot_flange, point))
    return Registration(T, point, float(np.sqrt(np.mean(np.sum(rest**2, axis=1)))))


def unloaded_rows(q: FloatArray, wrench: FloatArray | None) -> BoolArray:
    """Return the rows (n,) to register on where the give of the arm under loads is not known.

    A load moves the point off the arm of the model: those without one suffice where they are of
    ``ENOUGH`` postures; all count where they are not.

    Args:
        q: (n, 6) commanded joints [rad].
        wrench: (n, 6) ON the tool; None: no loads.
    """
    everything = np.ones(len(q), dtype=bool)
    if wrench is None:
        return everything
    free = ~np.any(wrench != 0.0, axis=1)
    return free if _distinct(q[free]) >= ENOUGH else everything


def in_robroot(registration: Registration, measured: FloatArray) -> FloatArray:
    """Return measured points (n, 3) in axes of the robot root [m]."""
    return apply(inverse(registration.T_measured_robroot), measured)


def rigid_motion(points: FloatArray, measured: FloatArray) -> FloatArray:
    """Return the rigid motion (4, 4) that takes points (n, 3) to measured ones.

    Source:
        Kabsch 1976, Acta Cryst. A32, 922.
    """
    a, b = points.mean(axis=0), measured.mean(axis=0)
    u, _, vt = np.linalg.svd((measured - b).T @ (points - a))
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return transform(R, b - R @ a)


def _require_spread(
    T_robroot_flange: FloatArray, measured: FloatArray, source: SourceRef | None
) -> None:
    postures = _distinct(T_robroot_flange[:, :3].reshape(-1, 12))
    spread = np.linalg.svd(measured - measured.mean(axis=0), compute_uv=False)
    if postures >= FEWEST and spread[1] > 1e-3 * spread[0]:
        return
    found = f"{postures} distinct posture(s)" if postures < FEWEST else "all points on one line"
    raise DataError(
        "MEA012",
        f"{found}, expected at least {FEWEST} postures that are not on one line to find the place "
        "of the measuring device",
        source,
    )


def _distinct(rows: FloatArray) -> int:
    return len(np.unique(np.round(rows / _SAME), axis=0))


def _step(
    R_robroot_flange: FloatArray, seen: FloatArray, residual: FloatArray, to_start: FloatArray
) -> FloatArray:
    """Return the Gauss-Newton step (9,): shift and rotation vector of the frame, then the point.

    Args:
        R_robroot_flange: (n, 3, 3).
        seen: (n, 3) points of the model now, robroot [m].
        residual: (n, 3) measured minus these [m].
        to_start: (3,) from the point now to where it is expected [m].
    """
    X = np.zeros((len(seen), 3, 9))
    X[:, :, :3] = np.eye(3)
    X[:, :, 3:6] = np.cross(np.eye(3), seen[:, None, :]).swapaxes(1, 2)
    X[:, :, 6:] = R_robroot_flange
    size = np.linalg.norm(residual, axis=1)
    limit = 2.0 * float(np.median(size)) + _ROUNDING
    root = np.sqrt(np.minimum(1.0, limit / np.maximum(size, _ROUNDING)))
    pull = max(float(np.median(np.abs(residual))), _ROUNDING) / REACH
    prior = np.hstack([np.zeros((3, 6)), pull * np.eye(3)])
    A = np.vstack([(X * root[:, None, None]).reshape(-1, 9), prior])
    y = np.concatenate([(residual * root[:, None]).ravel(), pull * to_start])
    return np.asarray(np.linalg.lstsq(A, y, rcond=1e-12)[0])
