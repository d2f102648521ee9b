"""Orientation columns of a point list to tool axes and, where they are complete, rotations."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.geometry import rotation_from_abc
from postproc.readers.text import Faults

NORM_GAP = 1e-3
"""How far the length of a normal or quaternion may be from one."""


def unit_rows(vectors: FloatArray, what: str, line: IntArray, faults: Faults) -> FloatArray:
    """Return rows (n, d) of length one."""
    length = np.linalg.norm(vectors, axis=1)
    zero = np.flatnonzero(~(length > NORM_GAP))
    if len(zero):
        raise faults.error("CSV021", f"the {what} is a zero vector", int(line[zero[0]]))
    wrong = np.flatnonzero(np.abs(length - 1.0) > NORM_GAP)
    if len(wrong) == len(length) or (length[wrong] > 2.0).any():
        text = f"the {what} has length {length[wrong[0]]:.4g}, expected 1"
        hint = (
            "name the columns with --columns: x,y,z,a,b,c for angles, x,y,z,-,-,- for uncertainties"
        )
        raise faults.error("CSV023", text, int(line[wrong[0]]), hint=hint)
    for row in wrong[:20].tolist():
        text = f"the {what} has length {length[row]:.4f}, expected 1"
        faults.fix("CSV022", text, "its direction is taken", int(line[row]))
    unit: FloatArray = vectors / length[:, None] + 0.0
    return unit


def rotation_from_wxyz(q_wxyz: FloatArray) -> FloatArray:
    """Return (n, 3, 3) from unit quaternions (n, 4), scalar first."""
    w, x, y, z = np.moveaxis(q_wxyz, -1, 0)
    R = np.empty((*w.shape, 3, 3))
    R[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[..., 0, 1] = 2.0 * (x * y - w * z)
    R[..., 0, 2] = 2.0 * (x * z + w * y)
    R[..., 1, 0] = 2.0 * (x * y + w * z)
    R[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[..., 1, 2] = 2.0 * (y * z - w * x)
    R[..., 2, 0] = 2.0 * (x * z - w * y)
    R[..., 2, 1] = 2.0 * (y * z + w * x)
    R[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return R


def rotations_from(
    roles: tuple[str, ...], values: FloatArray, line: IntArray, faults: Faults
) -> FloatArray:
    """Return R_part_tcp (n, 3, 3) from A,B,C or roll,pitch,yaw [rad], or a quaternion."""
    if roles[0] == "qw":
        return rotation_from_wxyz(unit_rows(values, "quaternion", line, faults))
    # R = Rz(yaw) Ry(pitch) Rx(roll): a, b, c backwards
    return rotation_from_abc(values if roles[0] == "a" else values[..., ::-1])
