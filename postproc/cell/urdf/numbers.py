"""Numbers of URDF elements: attributes of several values, and poses."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import CellError, SourceRef
from postproc.geometry import rotation_from_abc, transform


def origin_of(element: ET.Element, path: Path) -> FloatArray:
    """Return the pose (4, 4) of an element's <origin>; roll, pitch, yaw turn about fixed axes."""
    origin = element.find("origin")
    xyz = values_of(origin, "xyz", 3, 0.0, path)
    roll, pitch, yaw = values_of(origin, "rpy", 3, 0.0, path)
    return transform(rotation_from_abc(np.array([yaw, pitch, roll])), xyz)


def values_of(
    element: ET.Element | None, key: str, count: int, default: float, path: Path
) -> FloatArray:
    """Return the numbers (count,) of an attribute, ``default`` where it is not given.

    Raises:
        CellError: CEL011 if they are not that many finite numbers.
    """
    text = element.get(key) if element is not None else None
    if text is None:
        return np.full(count, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        tag = element.tag if element is not None else "?"
        raise CellError(
            "CEL011",
            f"<{tag}>: {key} is {text!r}, expected {count} finite values",
            SourceRef(str(path)),
        )
    return np.array(values)
