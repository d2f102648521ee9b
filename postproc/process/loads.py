"""The load on the tool at each tag: the wrench of its operation, or the one of the cell."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.cell import Cell
from postproc.model import MotionKind, ToolPath

WORKING = (MotionKind.LINEAR, MotionKind.ARC, MotionKind.HOLE)
"""Tags at which the tool works."""


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
