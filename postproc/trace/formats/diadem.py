"""KUKA Trace (KSS 8): pairs of DIAdem files, a text header ``.dat`` and raw numbers ``.r64``.

One pair for each module: ``NAME_NextGenDrive#1`` to ``#6`` (drives), ``NAME_KRCIpo``
(interpolator). Any of the headers is given; its neighbours are found by name and joined on their
own times. Names of channels are German or English.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes
from postproc.records import dataclass
from postproc.trace.reading import ACTUAL, COMMAND, CURRENT, TORQUE, TRACES, Block, numbered
from postproc.trace.recording import BLOCK
from postproc.units import DEG, unit_named

_MODULE = re.compile(r"^(.*?)_?(NextGenDrive#?(\d)|KRCIpo)$", re.IGNORECASE)
_AXIS = re.compile(r"(?:\bA|Achse\s*|Axis\s*|#)([1-6])\b", re.IGNORECASE)
_TIME = re.compile(r"^(zeit|time)\b", re.IGNORECASE)
_KINDS = (
    (COMMAND, re.compile(r"soll-?\s*position|(set|command|nominal)\w*\s*position", re.IGNORECASE)),
    (ACTUAL, re.compile(r"ist-?\s*position|actual\s*position", re.IGNORECASE)),
    (TORQUE, re.compile(r"ist-?\s*moment|actual\s*(torque|moment)", re.IGNORECASE)),
    (CURRENT, re.compile(r"ist-?\s*strom|actual\s*current", re.IGNORECASE)),
)
_SAME = 1e-9
_FALLBACK_UNITS = {"°": DEG, "grad": DEG}


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel of a header: name, unit, and the codes of its data."""

    name: str
    unit: str
    codes: dict[int, str]


class DiademFormat:
    """Trace of a KRC4 as it lies in the controller's folder."""

    name = "kuka_trace"

    def sniff(self, head: bytes, path: Path) -> bool:
        """Return whether a DIAdem header begins."""
        del path
        return b"#BEGINGLOBALHEADER" in head or b"#BEGINCHANNELHEADER" in head

    def blocks(self, path: Path) -> Iterator[Block]:
        """Yield the channels of all modules on the times of the first one."""
        return numbered(_blocks(path))


def _blocks(path: Path) -> Iterator[Block]:
    series: dict[str, tuple[FloatArray, FloatArray]] = {}
    for header in _modules(path):
        for name, pair in _channels(header).items():
            series.setdefault(name, pair)
    gone = [name for name in COMMAND if name not in series]
    if gone:
        text = f"no channel holds {gone[0]}, expected Sollposition of all axes"
        raise DataError("TRC002", text, SourceRef(str(path)))
    time = series[COMMAND[0]][0]
    low = max(float(t[0]) for t, _ in series.values())
    high = min(float(t[-1]) for t, _ in series.values())
    time = time[(time >= low - _SAME) & (time <= high + _SAME)]
    columns = {name: np.interp(time, t, v) for name, (t, v) in series.items()}
    whole = {"time_s": time} | columns
    for first in range(0, len(time), BLOCK):
        yield {name: values[first : first + BLOCK] for name, values in whole.items()}


def _modules(path: Path) -> list[Path]:
    """Return the headers of one recording, that of the given one first."""
    found = _MODULE.match(path.stem)
    if not found:
        return [path]
    beside = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == path.suffix.lower())
    same = [p for p in beside if (m := _MODULE.match(p.stem)) and m[1] == found[1]]
    return [path, *(p for p in same if p != path)]


def _channels(header: Path) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return times and values of the channels of a module, by the names of our columns."""
    channels = _read_header(header)
    module = _MODULE.match(header.stem)
    own = module[3] if module else None
    raw: dict[str, FloatArray] = {}
    time = None
    found = {}
    for channel in channels:
        if _TIME.match(channel.name):
            time = _values(header, channels, channel, raw) * _unit(channel, 1.0)
    if time is None:
        raise DataError("TRC002", "no channel of time", SourceRef(str(header)))
    for channel in channels:
        names = next((names for names, words in _KINDS if words.search(channel.name)), None)
        at = _AXIS.search(channel.name)
        axis = at[1] if at else own
        if names is None or axis is None:
            continue
        values = _values(header, channels, channel, raw)
        if names in (COMMAND, ACTUAL):
            values = values * (_unit(channel, DEG) / DEG)
        count = min(len(time), len(values))
        found[names[int(axis) - 1]] = (time[:count], values[:count])
    return found


def _unit(channel: Channel, usual: float) -> float:
    unit = unit_named(channel.unit)
    if unit is not None:
        return unit.factor
    return _FALLBACK_UNITS.get(channel.unit.strip().lower(), usual)


def _read_header(path: Path) -> list[Channel]:
    text = read_bytes(path).decode("cp1252", "replace")
    channels: list[Channel] = []
    codes: dict[int, str] | None = None
    for number, line in enumerate(text.splitlines(), 1):
        mark = line.strip().upper()
        if mark == "#BEGINCHANNELHEADER":
            codes = {}
        elif mark == "#ENDCHANNELHEADER" and codes is not None:
            channels.append(Channel(codes.get(200, ""), codes.get(202, ""), codes))
            codes = None
        elif codes is not None and mark:
            code, _, value = line.partition(",")
            if not code.strip().isdigit():
                raise DataError("TRC003", f"{line[:40]!r} is no code", SourceRef(str(path), number))
            codes[int(code)] = value.strip()
    return channels


def _values(
    header: Path, channels: list[Channel], channel: Channel, raw: dict[str, FloatArray]
) -> FloatArray:
    """Return the values of a channel in its own unit."""
    codes = channel.codes
    place = SourceRef(str(header))
    try:
        offset, factor = float(codes.get(240, 0.0)), float(codes.get(241, 1.0))
        count = int(codes[220])
        if codes.get(210, "").upper().startswith("IMPLI"):
            return np.asarray(offset + factor * np.arange(count))
        name, column = codes[211], int(codes.get(221, 1))
    except (KeyError, ValueError):
        text = f"channel {channel.name!r} lacks its number of values, file or column"
        raise DataError("TRC003", text, place) from None
    if codes.get(214, "REAL64").upper() != "REAL64":
        text = f"channel {channel.name!r} is {codes[214]!r}, expected REAL64"
        raise DataError("TRC003", text, place)
    if name not in raw:
        data = read_bytes(header.parent / Path(name.replace("\\", "/")).name)
        raw[name] = np.frombuffer(data[: len(data) // 8 * 8], dtype="<f8")
    width = max(int(c.codes.get(221, 1)) for c in channels if c.codes.get(211) == name)
    values = raw[name][column - 1 :: width][:count]
    if len(values) < count:
        text = f"{name} holds {len(values)} of {count} values of channel {channel.name!r}"
        raise DataError("TRC003", text, place)
    return np.asarray(offset + factor * values)


TRACES.register("kuka_trace")(DiademFormat())
