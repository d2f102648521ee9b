"""Where the tracker stands and which point of the tool it sees, fitted from the readings.

measured = T_measured_robroot · T_robroot_flange(q) · p_flange_point: nine unknowns, on the nominal
arm. The geometry errors of the arm stay in the residual; they do not matter here, because load
responses are differences of readings of one posture.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import SourceRef, StiffnessError
from postproc.geometry import apply, inverse, rotation_about, transform
from postproc.kinematics import Kinematics
from postproc.measurement.rows import MeasurementSet
from postproc.model import Registration

FEWEST_UNLOADED = 12
FEWEST_POSTURES = 6
PULL = 2e-4
"""Noise of a reading (20 um) over the uncertainty of the reflector's place (0.1 m)."""
_STEPS = 50


def fit_registration(
    measured: MeasurementSet, kinematics: Kinematics, p_flange_tcp: FloatArray
) -> Registration:
    """Fit tracker frame and reflector place to the unloaded readings, or to all without enough.

    Args:
        measured: positions in any frame.
        kinematics: nominal arm.
        p_flange_tcp: (3,) [m], where the search for the reflector starts.

    Returns:
        The registration; directions of the reflector that the postures cannot tell keep the
        value of ``p_flange_tcp``.

    Raises:
        StiffnessError: STF013 with fewer than ``FEWEST_POSTURES`` or all on one line.
    """
    rows = _unloaded(measured)
    T = kinematics.fk(measured.q[rows])
    seen = np.asarray(measured.position)[rows]
    centred = seen - seen.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False)
    distinct = len(np.unique(np.round(measured.q[rows], 6), axis=0))
    if distinct < FEWEST_POSTURES or spread[1] < 1e-3 * max(spread[0], 1e-9):
        raise StiffnessError(
            "STF013",
            f"too few or too narrow readings to find the tracker's place, expected at least "
            f"{FEWEST_POSTURES} postures that are not on one line",
            SourceRef(measured.path),
        )
    point = np.array(p_flange_tcp, dtype=np.float64)
    frame = _aligned(apply(T, point), seen)
    for _ in range(_STEPS):
        frame, point, step = _improve(T, seen, frame, point, p_flange_tcp)
        if step < 1e-12:
            break
    left = seen - apply(frame, apply(T, point))
    rms = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
    return Registration(frame, point, rms)


def _unloaded(measured: MeasurementSet) -> BoolArray:
    """Return the rows to register on: a load moves the tool point off the nominal arm."""
    everything = np.ones(len(measured), dtype=bool)
    if measured.wrench is None:
        return everything
    free = ~np.any(np.asarray(measured.wrench) != 0.0, axis=1)
    return free if int(free.sum()) >= FEWEST_UNLOADED else everything


def _aligned(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return T_target_source (4, 4) of paired points (n, 3) by the singular value method."""
    a, b = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - b).T @ (source - a))
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return transform(R, b - R @ a)


def _improve(
    T: FloatArray, seen: FloatArray, frame: FloatArray, point: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Take one Gauss-Newton step on frame (6) and point (3)."""
    placed = apply(T, point)
    left = apply(inverse(frame), seen) - placed
    n = len(seen)
    X = np.zeros((n, 3, 9))
    X[:, :, :3] = np.eye(3)
    for k in range(3):
        X[:, :, 3 + k] = np.cross(np.eye(3)[k], placed)
    X[:, :, 6:] = T[:, :3, :3]
    # a weak pull keeps what the postures cannot tell at its start
    pull = np.zeros((3, 9))
    pull[:, 6:] = PULL * np.eye(3)
    rows = np.vstack([X.reshape(-1, 9), pull])
    right = np.concatenate([left.reshape(-1), PULL * (start - point)])
    x = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
    angle = float(np.linalg.norm(x[3:6]))
    axis = x[3:6] / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
    moved = frame @ transform(rotation_about(axis, angle), x[:3])
    return moved, point + x[6:], float(np.linalg.norm(x))
