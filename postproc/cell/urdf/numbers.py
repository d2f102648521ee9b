"""Numbers of URDF elements: attributes of several values, and poses."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import CellError, SourceRef
from postproc.geometry import rotation_from_abc, transform

_COUNTS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "velocity": 1, "effort": 1},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
"""How many numbers the attributes of an element hold."""
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
LARGEST = 1e6
"""No length, angle, mass or inertia of a real arm comes near this [SI]."""
_UNBOUNDED = ("effort",)
"""Some files say that it has no bound."""


def check_numbers(raw: bytes, path: Path) -> None:
    """Check the numbers of all links and joints, before anything is made of them."""
    parser, above = expat.ParserCreate(), ["", ""]

    def begin(tag: str, attributes: dict[str, str]) -> None:
        above.append(tag)
        if len(above) > 4 and above[3] in ("link", "joint"):
            for key, count in _COUNTS.get(tag, {}).items():
                text = attributes.get(key)
                if text is not None and not _are_numbers(text, count, key):
                    expected = "a finite number" if count == 1 else f"{count} finite numbers"
                    raise CellError(
                        "CEL011",
                        f"<{tag}>: {key} is {text[:60]!r}, expected {expected}",
                        SourceRef(str(path), parser.CurrentLineNumber),
                    )

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda tag: above.pop()
    parser.Parse(raw, True)


def _are_numbers(text: str, count: int, key: str) -> bool:
    words = text.split()
    if len(words) != count or not all(map(_DECIMAL.fullmatch, words)):
        return False
    most = sys.float_info.max if key in _UNBOUNDED else LARGEST
    return all(abs(float(word)) <= most for word in words)


def origin_of(element: ET.Element) -> FloatArray:
    """Return the pose (4, 4) of an element's <origin>; roll, pitch, yaw turn about fixed axes."""
    origin = element.find("origin")
    xyz = values_of(origin, "xyz", 3, 0.0)
    roll, pitch, yaw = values_of(origin, "rpy", 3, 0.0)
    return transform(rotation_from_abc(np.array([yaw, pitch, roll])), xyz)


def values_of(element: ET.Element | None, key: str, count: int, default: float) -> FloatArray:
    """Return the numbers (count,) of an attribute, ``default`` where it is not given."""
    text = element.get(key) if element is not None else None
    if text is None:
        return np.full(count, default)
    return np.array([float(word) for word in text.split()])
