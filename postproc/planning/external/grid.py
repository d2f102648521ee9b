"""The grid of positions of the external axes that are tried."""

from __future__ import annotations

import itertools

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.planning.states import Problem
from postproc.units import DEG

RAIL_STEP = 0.25
"""Distance [m] between positions on a rail."""
TURN_STEP = 30.0 * DEG
"""Angle between positions of a positioner."""
MOST_POSITIONS = 400


def position_grid(cell: Cell, finer: int = 1, most: int = MOST_POSITIONS) -> FloatArray:
    """Return the grid of positions (g, k): 0 among each axis' values where its range holds it.

    Args:
        cell: with its external axes.
        finer: by how much its steps are shorter than usual, as far as ``most`` allows.
        most: about so many positions at most.
    """
    columns = []
    share = most ** (1.0 / len(cell.external_axes))
    for axis, step in zip(cell.external_axes, (grid_step(cell) / finer).tolist(), strict=True):
        step = max(step, (axis.q_max - axis.q_min) / max(share - 1.0, 1.0))
        low, high = np.ceil(axis.q_min / step - 1e-9), np.floor(axis.q_max / step + 1e-9)
        inner = np.arange(low, high + 1) * step
        columns.append(np.unique(np.concatenate([[axis.q_min], inner, [axis.q_max]])))
    return np.array(list(itertools.product(*(column.tolist() for column in columns))))


def grid_step(cell: Cell) -> FloatArray:
    """Return the usual step (k,) of the grid of each axis."""
    return np.array(
        [RAIL_STEP if axis.kind == "rail" else TURN_STEP for axis in cell.external_axes]
    )


def distinct(problem: Problem, values: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the first position (d,) of each kind, and of which kind each (g,) is.

    Whole turns of a positioner bring the work to where it was.
    """
    bases = np.round(problem.placement.base(values).reshape(len(values), 16), 9)
    seen: dict[bytes, int] = {}
    of_kind = np.array([seen.setdefault(row.tobytes(), len(seen)) for row in bases + 0.0])
    return np.unique(of_kind, return_index=True)[1], of_kind
