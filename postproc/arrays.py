"""Array types, read-only arrays for the frozen types, and dataclasses of columns.

``IndexArray`` is what numpy gives for numbers of rows; ``IntArray`` is half as wide, for columns of
tables that may be a million rows long.
"""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, fields
from functools import cache
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from postproc.records import dataclass

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
ByteArray = NDArray[np.uint8]
IntArray = NDArray[np.int32]
IndexArray = NDArray[np.int64]
AnyIntArray = NDArray[np.signedinteger[Any]]
"""Whole numbers of either width."""
Kind = TypeVar("Kind", bound=np.generic)
Rows = AnyIntArray | BoolArray
"""Which rows: their numbers, or a mask."""
NONE = -1
"""The number of no row."""
ROUNDING = 1e-9
"""Lengths [m], angles [rad] and shares that differ by no more are equal but for their rounding."""
TINY = 1e-6
"""Smaller lengths [m] and angles [rad] are none: no file, controller or drive tells them."""
AT_ONCE = 4000
"""Rows of large intermediate arrays that are made together, so that memory stays bounded."""


def blocks(count: int, size: int = AT_ONCE) -> Iterator[slice]:
    """Yield slices of at most ``size`` rows that cover ``count`` rows."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def frozen_floats(owner: object, name: str, shape: tuple[int | None, ...]) -> None:
    """Replace a field of a frozen dataclass by a read-only float64 array; None: any length."""
    _freeze(owner, name, np.float64, shape)


def frozen_ints(owner: object, name: str, shape: tuple[int | None, ...]) -> None:
    """As ``frozen_floats`` for int32."""
    _freeze(owner, name, np.int32, shape)


def _freeze(owner: object, name: str, dtype: Any, shape: tuple[int | None, ...]) -> None:  # noqa: ANN401
    value: ArrayLike | None = getattr(owner, name)
    if value is None:
        return
    array = np.ascontiguousarray(value, dtype=dtype)
    if array is value:
        array = array.view()
    if len(array.shape) != len(shape) or any(
        want is not None and want != have for want, have in zip(shape, array.shape, strict=True)
    ):
        raise ValueError(f"{type(owner).__name__}.{name}: shape {array.shape}, expected {shape}")
    array.flags.writeable = False
    object.__setattr__(owner, name, array)


def longest_rising(values: Sequence[int]) -> list[int]:
    """Return the places of the longest chain of values that rises strictly, in order."""
    tails: list[int] = []
    ends: list[int] = []
    before = [-1] * len(values)
    for place, value in enumerate(values):
        at = bisect_left(tails, value)
        tails[at : at + 1] = [value]
        ends[at : at + 1] = [place]
        before[place] = ends[at - 1] if at else -1
    chain = []
    place = ends[-1] if ends else -1
    while place >= 0:
        chain.append(place)
        place = before[place]
    return chain[::-1]


def runs(labels: AnyIntArray) -> list[tuple[int, int]]:
    """Return the stretches [low, high) of equal labels (..., n)."""
    n = labels.shape[-1]
    changed = np.diff(np.atleast_2d(labels), axis=1).any(axis=0)
    bounds = [0, *(np.flatnonzero(changed) + 1).tolist(), n] if n else []
    return list(itertools.pairwise(bounds))


def numbered(count: AnyIntArray) -> tuple[IndexArray, IndexArray]:
    """Return of which owner each item is (s,), and its number there (s,), from 0.

    ``count`` (k,): the items of each of k owners, which stand one behind the other.
    """
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - (np.cumsum(count) - count)[owner]


def members(numbers: AnyIntArray, count: int) -> IndexArray:
    """Return the distinct ones of numbers (k,) below ``count``, rising.

    As ``np.unique`` does, but in a time that does not depend on how many there are of each.
    """
    return np.flatnonzero(_is_member(numbers, count))


def renumbered(numbers: AnyIntArray, count: int) -> tuple[IndexArray, IndexArray]:
    """Return the distinct ones (m,) of numbers (k,) below ``count``, and which (k,) each is."""
    is_member = _is_member(numbers, count)
    return np.flatnonzero(is_member), (np.cumsum(is_member) - 1)[numbers]


def _is_member(numbers: AnyIntArray, count: int) -> BoolArray:
    found = np.zeros(count, dtype=np.bool_)
    found[numbers] = True
    return found


def taken(values: NDArray[Kind], rows: Rows) -> NDArray[Kind]:
    """Return rows (k, ...) of an array, faster than ``[rows]`` where they are wide."""
    if values.ndim == 1:
        return np.asarray(values[rows])
    return values.take(np.flatnonzero(rows) if rows.dtype == np.bool_ else rows, axis=0)


def forward_filled(rows: FloatArray) -> FloatArray:
    """Return rows (n, ...) with those that hold NaN or inf replaced by the last before, else 0."""
    known = np.isfinite(rows).all(axis=tuple(range(1, rows.ndim)))
    last = np.maximum.accumulate(np.where(known, np.arange(len(rows)), -1))
    filled = np.array(rows[np.maximum(last, 0)])
    filled[last < 0] = 0.0
    return filled


def least_by(values: FloatArray, group: AnyIntArray, count: int) -> FloatArray:
    """Return the smallest value (count,) of each group, NaN for a group without any."""
    result = np.full(count, np.inf)
    np.minimum.at(result, group, values)
    return np.where(np.isfinite(result), result, np.nan)


@dataclass(frozen=True, slots=True)
class _Column:
    """What a field holds: one value per ``of``, of this type and shape; no dtype: no array."""

    of: str
    dtype: Any
    shape: tuple[int | None, ...]


def column(of: str, *shape: int | None, dtype: Any = np.float64) -> dict[str, Any]:  # noqa: ANN401
    """Return the metadata of a dataclass field that is a column, with the shape of one row.

    ``of``: what a row is; a dataclass may hold columns of several things. ``dtype`` None: a tuple
    of values, or a mapping of columns by name.
    """
    return {"column": _Column(of, dtype, shape)}


def _columns(owner: Any, of: str | None = None) -> list[tuple[Field[Any], _Column]]:  # noqa: ANN401
    declared = [(f, f.metadata["column"]) for f in fields(owner) if "column" in f.metadata]
    return [(f, spec) for f, spec in declared if of is None or spec.of == of]


def freeze_columns(owner: Any, **counts: int) -> None:  # noqa: ANN401 - any dataclass
    """Check the columns of a frozen dataclass under construction and make them read-only.

    ``counts``: number of rows by what a row is.
    """
    for f, spec in _columns(owner):
        value, n = getattr(owner, f.name), counts[spec.of]
        if spec.dtype is not None:
            _freeze(owner, f.name, spec.dtype, (n, *spec.shape))
            continue
        parts = value.items() if isinstance(value, Mapping) else [(f.name, value)]
        for name, part in parts:
            if part is not None and len(part) != n:
                raise ValueError(f"{type(owner).__name__}.{name}: {len(part)} values for {n} rows")


def columns_at(owner: Any, of: str, index: AnyIntArray) -> dict[str, Any]:  # noqa: ANN401
    """Return the columns of a dataclass by name, with the rows ``index`` (k,) only."""
    return {f.name: _at(getattr(owner, f.name), index) for f, _ in _columns(owner, of)}


def columns_joined(parts: Sequence[Any], of: str) -> dict[str, Any]:
    """Return the columns of dataclasses by name, behind each other; all have them, or none."""
    return {
        f.name: _joined(f.name, [getattr(part, f.name) for part in parts])
        for f, _ in _columns(parts[0], of)
    }


def _at(values: Any, index: AnyIntArray) -> Any:  # noqa: ANN401 - array, tuple, mapping or None
    if values is None:
        return None
    if isinstance(values, np.ndarray):
        return taken(values, index)
    if isinstance(values, Mapping):
        return {name: _at(part, index) for name, part in values.items()}
    return tuple(values[i] for i in index.tolist())


def _joined(name: str, parts: list[Any]) -> Any:  # noqa: ANN401 - as ``_at``
    if all(part is None for part in parts):
        return None
    if any(part is None for part in parts):
        raise ValueError(f"{name}: filled in some parts only")
    if isinstance(parts[0], np.ndarray):
        return np.concatenate(parts)
    if isinstance(parts[0], Mapping):
        shared = [key for key in parts[0] if all(key in part for part in parts)]
        return {key: _joined(key, [part[key] for part in parts]) for key in shared}
    return tuple(value for part in parts for value in part)


class Table:
    """Base of dataclasses of which every field is a column, or a table, of the same length."""

    __slots__ = ()

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(getattr(self, self._names()[0]))

    @classmethod
    @cache
    def _names(cls) -> list[str]:
        return [f.name for f in fields(cls)]  # type: ignore[arg-type]

    def rows(self, index: Rows) -> Self:
        """Return the rows ``index`` (k,)."""
        columns = (getattr(self, name) for name in self._names())
        return type(self)(
            *(c.rows(index) if isinstance(c, Table) else taken(c, index) for c in columns)
        )

    @classmethod
    def concat(cls, parts: Sequence[Self]) -> Self:
        """Return all rows, behind each other; at least one part."""
        columns = ([getattr(part, name) for part in parts] for name in cls._names())
        return cls(
            *((c[0].concat if isinstance(c[0], Table) else np.concatenate)(c) for c in columns)
        )


_STEPS = np.array([1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0])


def stepped(values: FloatArray) -> FloatArray:
    """Return the next smaller round value of each, so that neighbours share one."""
    positive = np.maximum(np.where(np.isfinite(values), values, 1e6), 1e-9)
    decade = 10.0 ** np.floor(np.log10(positive))
    step = np.searchsorted(_STEPS, positive / decade * (1.0 + 1e-12), side="right") - 1
    return np.asarray(_STEPS[np.clip(step, 0, None)] * decade)
