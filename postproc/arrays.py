"""Shape checks and read-only arrays for the frozen types."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]


def frozen_floats(owner: object, name: str, shape: tuple[int | None, ...]) -> None:
    """Replace field ``name`` of a frozen dataclass by a read-only float64 array of this shape.

    Args:
        owner: the dataclass instance under construction.
        name: the field.
        shape: expected shape; ``None`` stands for any length.

    Raises:
        ValueError: if the shape differs.
    """
    _freeze(owner, name, np.float64, shape)


def frozen_ints(owner: object, name: str, shape: tuple[int | None, ...]) -> None:
    """As ``frozen_floats`` for int32."""
    _freeze(owner, name, np.int32, shape)


def frozen_bools(owner: object, name: str, shape: tuple[int | None, ...]) -> None:
    """As ``frozen_floats`` for booleans."""
    _freeze(owner, name, np.bool_, shape)


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
