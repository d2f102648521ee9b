"""KUKA Trace (KSS 8): pairs of DIAdem files, a text header ``.dat`` and raw numbers ``.r64``.

One pair for each module: ``NAME_NextGenDrive#1`` to ``#6`` (drives), ``NAME_KRCIpo``
(interpolator). Any of the headers is given; its neighbours are found by name and joined on their
own times. Names of channels are German or English.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError, SourceRef
from postproc.files import open_input, read_bytes
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


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers of one channel, read in parts: offset + factor * raw.

    ``raw`` None: the number of each value itself. ``width`` columns are interleaved in the file.
    """

    raw: Path | None
    column: int
    width: int
    count: int
    offset: float
    factor: float

    def part(self, low: int, high: int) -> FloatArray:
        """Return the values ``low`` to ``high``."""
        if self.raw is None:
            return self.offset + self.factor * np.arange(low, high, dtype=np.float64)
        with open_input(self.raw) as stream:
            stream.seek(8 * low * self.width)
            data = stream.read(8 * (high - low) * self.width)
        table = np.frombuffer(data[: len(data) // 8 * 8], dtype="<f8")
        return np.asarray(self.offset + self.factor * table[self.column - 1 :: self.width])

    def begin(self, value: float, low: int) -> int:
        """Return the last number at or after ``low`` whose value is not above ``value``."""
        if self.raw is None:
            return max(low, min(self.count - 1, int((value - self.offset) / self.factor)))
        while low + BLOCK < self.count and self.part(low + BLOCK, low + BLOCK + 1)[0] <= value:
            low += BLOCK
        values = self.part(low, min(low + BLOCK, self.count))
        return low + max(0, int(np.searchsorted(values, value, side="right")) - 1)


def _blocks(path: Path) -> Iterator[Block]:
    series: dict[str, tuple[Values, Values]] = {}
    for header in _modules(path):
        for name, pair in _channels(header).items():
            series.setdefault(name, pair)
    gone = [name for name in COMMAND if name not in series]
    if gone:
        text = f"no channel holds {gone[0]}, expected Sollposition of all axes"
        raise DataError("TRC002", text, SourceRef(str(path)))
    master = series[COMMAND[0]][0]
    low = max(float(t.part(0, 1)[0]) for t, _ in series.values())
    high = min(float(t.part(t.count - 1, t.count)[0]) for t, _ in series.values())
    at = dict.fromkeys(series, 0)
    for first in range(0, master.count, BLOCK):
        time = master.part(first, min(first + BLOCK, master.count))
        time = time[(time >= low - _SAME) & (time <= high + _SAME)]
        if not len(time):
            continue
        block = {"time_s": time}
        for name, (times, values) in series.items():
            start = at[name] = times.begin(float(time[0]) + _SAME, at[name])
            stop = start
            while True:
                stop = min(times.count, stop + BLOCK)
                own = times.part(start, stop)
                if stop == times.count or own[-1] >= time[-1]:
                    break
            block[name] = np.interp(time, own, values.part(start, stop))
        yield block


def _modules(path: Path) -> list[Path]:
    """Return the headers of one recording, that of the given one first."""
    found = _MODULE.match(path.stem)
    if not found:
        return [path]
    beside = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == path.suffix.lower())
    same = [p for p in beside if (m := _MODULE.match(p.stem)) and m[1] == found[1]]
    return [path, *(p for p in same if p != path)]


def _channels(header: Path) -> dict[str, tuple[Values, Values]]:
    """Return times and values of the channels of a module, by the names of our columns."""
    channels = _read_header(header)
    module = _MODULE.match(header.stem)
    own = module[3] if module else None
    time = None
    found = {}
    for channel in channels:
        if _TIME.match(channel.name):
            time = _values(header, channels, channel, _unit(channel, 1.0))
    if time is None:
        raise DataError("TRC002", "no channel of time", SourceRef(str(header)))
    for channel in channels:
        names = next((names for names, words in _KINDS if words.search(channel.name)), None)
        at = _AXIS.search(channel.name)
        axis = at[1] if at else own
        if names is None or axis is None:
            continue
        unit = _unit(channel, DEG) / DEG if names in (COMMAND, ACTUAL) else 1.0
        values = _values(header, channels, channel, unit)
        count = min(time.count, values.count)
        found[names[int(axis) - 1]] = (replace(time, count=count), replace(values, count=count))
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


def _values(header: Path, channels: list[Channel], channel: Channel, unit: float) -> Values:
    """Return the values of a channel, times ``unit``."""
    codes = channel.codes
    place = SourceRef(str(header))
    try:
        offset, factor = float(codes.get(240, 0.0)) * unit, float(codes.get(241, 1.0)) * unit
        count = int(codes[220])
        if codes.get(210, "").upper().startswith("IMPLI"):
            return Values(None, 1, 1, count, offset, factor)
        name, column = codes[211], int(codes.get(221, 1))
    except (KeyError, ValueError):
        text = f"channel {channel.name!r} lacks its number of values, file or column"
        raise DataError("TRC003", text, place) from None
    if codes.get(214, "REAL64").upper() != "REAL64":
        text = f"channel {channel.name!r} is {codes[214]!r}, expected REAL64"
        raise DataError("TRC003", text, place)
    raw = header.parent / Path(name.replace("\\", "/")).name
    with open_input(raw) as stream:
        size = stream.seek(0, 2) // 8
    width = max(int(c.codes.get(221, 1)) for c in channels if c.codes.get(211) == name)
    have = max(0, (size - column) // width + 1)
    if have < count or count < 1:
        text = f"{name} holds {have} of {count} values of channel {channel.name!r}"
        raise DataError("TRC003", text, place)
    return Values(raw, column, width, count, offset, factor)


TRACES.register("kuka_trace")(DiademFormat())
