"""Which tool of the cell each row was taken with: its tool point in the flange."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell

COLUMN = "tool_no"


def tool_points(cell: Cell) -> dict[str, FloatArray]:
    """Return the tool point (3,) in the flange [m] of each tool of a cell, by its number."""
    return {str(tool.number): np.asarray(tool.T_flange_tcp[:3, 3]) for tool in cell.tools}


def points_of_rows(
    tools: Mapping[str, FloatArray], extra: Mapping[str, Any], default: FloatArray
) -> FloatArray | None:
    """Return the tool point (n, 3) of each row, None where all rows have the one in work.

    A number that the cell does not have is the tool in work: then it is a condition alone.

    Args:
        tools: as ``tool_points`` gives them.
        extra: logged conditions of the rows.
        default: (3,) tool point of the tool in work.
    """
    labels = extra.get(COLUMN)
    if labels is None or len(tools) < 2:
        return None
    return np.array([tools.get(str(label).removesuffix(".0"), default) for label in labels])
