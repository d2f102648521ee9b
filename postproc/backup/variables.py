"""The variables of a data list of the controller: names without case, values as Python's own."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from postproc import krl
from postproc.arrays import FloatArray
from postproc.backup.archive import Archive
from postproc.errors import KrlError, ReadError, SourceRef
from postproc.geometry import kuka_from_transform, transform_from_kuka
from postproc.records import dataclass

FRAME = "X Y Z A B C"
_FASTEST = 1e4
"""No axis has a larger rated speed [deg/s or mm/s]."""
_TARGET = re.compile(r"([$\w]+)\s*(?:\[\s*([\d,\s]*)\])?$")
_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}


@dataclass(frozen=True, slots=True)
class Variables:
    """The values of a data list: (NAME, index) to value, index 0 for what is no array.

    Numbers are float or int, strings str, enumeration constants ``#NAME``, structures a mapping
    with upper-case keys (brackets of strings dropped).
    """

    place: str
    values: Mapping[tuple[str, int], Any]
    lines: Mapping[tuple[str, int], int]

    def source(self, name: str, index: int = 0) -> SourceRef:
        """Return where a variable has its value."""
        return SourceRef(self.place, self.lines.get((name, index), 1))

    def get(self, name: str, index: int = 0) -> Any:  # noqa: ANN401 - any value of KRL
        """Return a value, None where it is not given."""
        return self.values.get((name, index))

    def number(self, name: str, index: int = 0) -> float | None:
        """Return a finite number, None where there is none."""
        value = self.get(name, index)
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
        return None

    def text(self, name: str, index: int = 0) -> str:
        """Return a string without the blanks around it, empty where there is none."""
        value = self.get(name, index)
        return value.strip() if isinstance(value, str) else ""

    def parts(self, name: str, keys: str, index: int = 0) -> list[float] | None:
        """Return components of a structure such as ``X Y Z``, None unless all are numbers."""
        return numbers_of(self.get(name, index), keys)

    def indices(self, name: str) -> list[int]:
        """Return the indices of an array that have a value."""
        return sorted(index for known, index in self.values if known == name)


def numbers_of(value: Any, keys: str) -> list[float] | None:  # noqa: ANN401 - any value of KRL
    """Return components of a structure, None unless all are finite numbers."""
    found = [value.get(key) for key in keys.split()] if isinstance(value, dict) else []
    numbers = [float(v) for v in found if isinstance(v, int | float) and math.isfinite(v)]
    return numbers if len(numbers) == len(keys.split()) else None


def read_variables(archive: Archive, name: str) -> Variables:
    """Return the variables of a data list in a backup."""
    place = archive.place(name)
    text = decoded(archive.read(name))
    try:
        (module,) = krl.parse_files({file_name(name): text.encode("utf-8", errors="replace")})
    except KrlError as problem:
        line = problem.source.line if problem.source else 1
        raise ReadError("BAK005", problem.message, SourceRef(place, line)) from None
    if module.data is None:
        raise ReadError("BAK005", "no KRL data list, expected DEFDAT", SourceRef(place))
    values: dict[tuple[str, int], Any] = {}
    lines: dict[tuple[str, int], int] = {}
    for target, value, line in module.data.values():
        match = _TARGET.match(target.strip())
        if match is not None:
            first = (match[2] or "").split(",")[0].strip()
            key = match[1].upper(), int(first) if first.isdigit() and len(first) < 6 else 0
            values[key], lines[key] = _plain(value), line
    return Variables(place, values, lines)


def rated_speed(data: Variables, axis: int, per_turn: float) -> float | None:
    """Return the rated speed of an axis [1/s] that goes ``per_turn`` with a turn of its gear."""
    rpm, ratio = data.number("$VEL_AXIS_MA", axis), data.parts("$RAT_MOT_AX", "N D", axis)
    if rpm is None or ratio is None or not ratio[0]:
        return None
    speed = per_turn / 60.0 * rpm * ratio[1] / abs(ratio[0])
    return round(speed, 6) if 0.0 < speed < _FASTEST else None


def matrix(frame: Sequence[float]) -> FloatArray:
    """Return the transform (4, 4) [m] of X Y Z A B C [mm, deg]."""
    return transform_from_kuka(frame[:3], frame[3:])


def six(T: FloatArray, digits: int = 9) -> list[float]:
    """Return X Y Z A B C [mm, deg] of a transform (4, 4), rounded."""
    return [round(float(v), digits) + 0.0 for part in kuka_from_transform(T) for v in part]


def file_name(name: str) -> str:
    """Return the name of a file without its folders."""
    return name.replace("\\", "/").rpartition("/")[2]


def decoded(raw: bytes) -> str:
    """Return text of a controller, also where an editor put a byte order mark in front."""
    for mark, encoding in _MARKS.items():
        if raw.startswith(mark):
            return raw.decode(encoding, errors="replace")
    return krl.text_of(raw)


def _plain(value: krl.Value) -> Any:  # noqa: ANN401 - any value of KRL
    if isinstance(value, krl.Text):
        return value.value
    if isinstance(value, krl.Enum):
        return f"#{value.name.upper()}"
    if isinstance(value, krl.Pose | krl.Axes):
        return dict(krl.components(value))
    if isinstance(value, krl.Aggregate):
        return {key.upper().removesuffix("[]"): _plain(part) for key, part in value.fields}
    return value
