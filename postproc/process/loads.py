"""Loads on the tool: at each tag the wrench of its operation, or the one of the cell; weights."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray, IntArray
from postproc.cell import Cell
from postproc.model import WORKING, ToolPath


def operation_loads(toolpath: ToolPath, cell: Cell) -> tuple[FloatArray, IntArray]:
    """Return the wrenches (k, 6) of the operations, the cell's own last, and each tag's row (n,).

    They act ON the tool at and in axes of the TCP [N, N*m].
    """
    names = [operation.name for operation in toolpath.operations]
    wrenches = [*(cell.process.wrench_of(name) for name in names), cell.process.wrench_tcp]
    operation = np.asarray(toolpath.operation)
    known = (operation >= 0) & (operation < len(names))
    return np.array(wrenches), np.where(known, operation, len(names)).astype(np.int32)


def load_cases(toolpath: ToolPath, cell: Cell) -> tuple[list[FloatArray], IntArray]:
    """Return the distinct wrenches (6,) and each tag's case (n,): which of them + 1, 0 for idle."""
    wrenches, row = operation_loads(toolpath, cell)
    distinct, which = np.unique(wrenches, axis=0, return_inverse=True)
    case = np.where(np.isin(toolpath.kind, WORKING), 1 + which.reshape(-1)[row], 0)
    return list(distinct), case.astype(np.int32)


def weight_wrench(mass: float, gravity: FloatArray, lever: FloatArray) -> FloatArray:
    """Return the wrench (n, 6) of a mass [kg] at another point of the body that it hangs on.

    ``lever`` (n, 3): from that point to the weight [m], axes of ``gravity`` (3,) [m/s^2].
    """
    return moved_wrench(np.tile([*(mass * gravity), 0.0, 0.0, 0.0], (len(lever), 1)), lever)


def moved_wrench(wrench: ArrayLike, lever: ArrayLike) -> FloatArray:
    """Return a wrench (..., 6) stated at another point.

    ``lever`` (..., 3) [m]: from the new point to the point of attack, axes of the wrench.
    """
    w = np.asarray(wrench, dtype=np.float64)
    arm = np.broadcast_to(np.asarray(lever, dtype=np.float64), (*w.shape[:-1], 3))
    moment = w[..., 3:] + np.cross(arm, w[..., :3])
    return np.concatenate([w[..., :3], moment], axis=-1)
