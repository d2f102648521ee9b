"""Holes from arrays: what a script has instead of a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from postproc.errors import UsageError
from postproc.model import ToolPath
from postproc.readers.base import ReadOptions
from postproc.readers.csv.columns import NORMAL, POSITION
from postproc.readers.csv.quantities import Columns, usual_factor
from postproc.readers.csv.reader import toolpath_of
from postproc.readers.text import Faults
from postproc.units import MM


def holes_of(
    name: str,
    xyz: ArrayLike,
    axes: ArrayLike,
    columns: Mapping[str, ArrayLike | None],
    names: Sequence[str] | None,
) -> ToolPath:
    """Return the toolpath that a point list with these columns would give.

    Args:
        name: stands for the path of a file; row k is its line k.
        xyz: (n, 3) [mm].
        axes: (n, 3), from the tip to the holder, of any length above 0.
        columns: by role, a number or (n,) in the unit of a column without one; None: no column.
        names: (n,) ids, None: none.

    Raises:
        UsageError: CSV041 for arrays of another shape, or with numbers that are not finite.
        ReadError: as of a file with these rows.
    """
    points, normals = _rows("xyz", xyz, None), _rows("axes", axes, None)
    n = len(points)
    if len(normals) != n or n == 0:
        raise UsageError("CSV041", f"{n} points and {len(normals)} axes, expected (n, 3) of both")
    numbers = dict(zip(POSITION, (points * MM).T, strict=True))
    numbers |= dict(zip(NORMAL, normals.T, strict=True))
    for role, values in columns.items():
        if values is not None:
            numbers[role] = _rows(role, values, n) * usual_factor(role, "mm")
    data = Columns(np.arange(1, n + 1, dtype=np.int32), numbers)
    if names is not None:
        data.texts["id"] = [str(each) for each in names]
        if len(data.texts["id"]) != n:
            raise UsageError("CSV041", f"{len(data.texts['id'])} names for {n} points")
    return toolpath_of(name, ReadOptions(), None, "mm", (), data, Faults(name, recover=False))


def _rows(what: str, values: ArrayLike, count: int | None) -> np.ndarray:
    """Return finite numbers (n, 3), or (count,) where a count is given."""
    shape = "(n, 3)" if count is None else f"a number or ({count},)"
    try:
        array = np.asarray(values, dtype=np.float64)
        if count is not None:
            array = np.broadcast_to(array, (count,))
    except (TypeError, ValueError):
        array = np.zeros(0)
    is_shaped = array.shape == (count,) if count else array.ndim == 2 and array.shape[1] == 3
    if not is_shaped or not np.isfinite(array).all():
        raise UsageError("CSV041", f"{what} is no array of finite numbers, expected {shape}")
    return array
