"""Recordings of any format: the registry, the columns of a recording, and how rows become one.

A format yields blocks of columns by the names of ``COLUMNS``, in the units of these names; what is
common to all formats stands here: time base, wrapped angles, stretches, thinning.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.errors import DataError, SourceRef
from postproc.files import open_input, spooled
from postproc.progress import Progress
from postproc.registry import Registry
from postproc.trace.recording import PAUSE_CYCLES, SHORTEST, Recording, Thinned
from postproc.units import DEG, MM

COMMAND = tuple(f"q{i}_cmd_deg" for i in range(1, 7))
ACTUAL = tuple(f"q{i}_act_deg" for i in range(1, 7))
LINK = tuple(f"q{i}_link_deg" for i in range(1, 7))
POINT = ("x_mm", "y_mm", "z_mm")
TORQUE = tuple(f"tau{i}_Nm" for i in range(1, 7))
CURRENT = tuple(f"i{i}_A" for i in range(1, 7))
COLUMNS = (
    *("time_s", *COMMAND, *ACTUAL, *LINK, *POINT, *TORQUE, *CURRENT),
    *("line", "tag", "run"),
)
"""What a recording may hold; ``tag`` is 1 where the tool works on one, else 0."""
HEAD = 1 << 16
FASTEST = 20.0
"""No axis of an arm turns faster [rad/s]: the time base is wrong."""
NEAR = 0.88
"""Likeness from which an unknown column is a slip in the name of a known one."""
_SAME_TIME = 1e-9

Block = dict[str, FloatArray]


@runtime_checkable
class TraceFormat(Protocol):
    """How one kind of recording is read."""

    name: str

    def sniff(self, head: bytes, path: Path) -> bool:
        """Return whether a file that begins so is of this format."""
        ...

    def blocks(self, path: Path) -> Iterator[Block]:
        """Yield columns (k,) by the names of ``COLUMNS``, in order of the file.

        Raises:
            DataError: TRC001 not readable, TRC002 wrong columns, TRC003 not a number.
        """
        ...


TRACES: Registry[TraceFormat] = Registry("traces", "postproc.trace.formats", TraceFormat)


def read_recording(path: str | Path, progress: Progress | None = None) -> Recording:
    """Return a recording of any registered format.

    Args:
        path: the file; of a pair of files (DIAdem) the one with the header.
        progress: called with (bytes done, bytes in all, what).

    Raises:
        DataError: TRC001 no known format, TRC002 columns missing, unknown or half there, TRC003
            not a number, TRC004 a time base that cannot be right, TRC005 too few rows.
        ReadError: IO001, IO002.
    """
    place = Path(path)
    with spooled(place):
        with open_input(place) as stream:
            head = stream.read(HEAD)
        known = [part for _, part in TRACES if part.sniff(head, place)]
        if not known:
            names = ", ".join(name for name, _ in TRACES)
            raise DataError(
                "TRC001",
                f"no recording of a known format, known are {names}",
                SourceRef(str(path)),
                hint="a CSV needs a header with time_s and q1_cmd_deg ... q6_cmd_deg",
            )
        thinned = Thinned()
        for block in known[0].blocks(place):
            thinned.add(block)
            if progress is not None:
                progress(thinned.total, 0, "reading rows")
    return _recording(str(path), thinned)


def check_columns(path: str, names: Sequence[str], line: int = 1) -> list[str]:
    """Refuse a header that lacks what every recording has, or slips in a name.

    Returns:
        The columns that are not known, which nothing reads.

    Raises:
        DataError: TRC002.
    """
    place = SourceRef(path, line)
    if len(set(names)) < len(names):
        twice = next(name for name in names if list(names).count(name) > 1)
        raise DataError("TRC002", f"column {twice!r} appears twice", place)
    unknown = [name for name in names if name not in COLUMNS]
    missing = [name for name in COLUMNS if name not in names]
    for name in unknown:
        near = difflib.get_close_matches(name, missing, 1, NEAR)
        if near:
            raise DataError("TRC002", f"unknown column {name!r}, did you mean {near[0]!r}?", place)
    for group in (("time_s",), COMMAND):
        gone = [name for name in group if name not in names]
        if gone:
            raise DataError("TRC002", f"the column {gone[0]!r} is missing", place)
    for group in (ACTUAL, POINT, TORQUE, CURRENT):
        have = [name for name in group if name in names]
        if have and len(have) < len(group):
            gone = [name for name in group if name not in names]
            raise DataError(
                "TRC002", f"the column {gone[0]!r} is missing beside {have[0]!r}", place
            )
    return unknown


def _recording(path: str, thinned: Thinned) -> Recording:
    columns = thinned.columns()
    count = len(columns.get("time_s", ()))
    if count < SHORTEST:
        raise DataError("TRC005", f"{count} rows, at least {SHORTEST} are needed", SourceRef(path))
    remarks: list[str] = []
    good = np.isfinite(columns["time_s"])
    for name in COMMAND:
        good &= np.isfinite(columns[name])
    if not good.all():
        remarks.append(f"{np.sum(~good)} rows without time or command are left out")
    run = columns.get("run", np.ones(count))
    run = np.where(np.isfinite(run), run, -1.0)
    rows, stretch = _stretches(columns["time_s"], run, columns["row"], good)
    repeated = int(good.sum()) - len(rows)
    if repeated:
        remarks.append(f"{repeated} rows repeat a time and are left out")
    if len(rows) < SHORTEST:
        raise DataError("TRC005", f"{len(rows)} rows whose time rises", SourceRef(path))
    taken = {name: values[rows] for name, values in columns.items() if name != "row"}
    time = taken["time_s"]
    command = _joints(taken, COMMAND, stretch, None)
    if command is None:
        raise DataError("TRC002", "no commanded joint angles", SourceRef(path))
    _check_time(path, time, command, stretch)
    actual = _joints(taken, ACTUAL, stretch, command)
    point = _group(taken, POINT, MM)
    line = taken.get("line")
    tag = taken.get("tag")
    if thinned.total > count:
        remarks.append(f"of {thinned.total} rows {count} are used, in blocks evenly spread")
    return Recording(
        path,
        time,
        stretch.astype(np.int32),
        run[rows].astype(np.int32),
        command,
        actual,
        _joints(taken, LINK, stretch, command),
        point,
        _group(taken, TORQUE, 1.0),
        _group(taken, CURRENT, 1.0),
        None if line is None else np.where(np.isfinite(line), line, -1).astype(np.int32),
        None if tag is None else tag > 0.0,
        thinned.total,
        tuple(remarks),
    )


def _stretches(
    time: FloatArray, run: FloatArray, number: FloatArray, good: FloatArray
) -> tuple[IndexArray, IndexArray]:
    """Return the rows whose time rises, and the stretch of each: of one run, no cycle missing."""
    rows = np.flatnonzero(good)
    step = np.diff(time[rows])
    rising = step[step > _SAME_TIME]
    cycle = float(np.median(rising)) if len(rising) else 1.0
    same = np.concatenate([[False], np.abs(step) <= _SAME_TIME])
    same[1:] &= np.diff(run[rows]) == 0
    rows = rows[~same]
    step = np.diff(time[rows])
    ends = (np.diff(run[rows]) != 0) | (step < 0.0) | (step > PAUSE_CYCLES * cycle)
    ends |= np.diff(number[rows]) > PAUSE_CYCLES
    stretch = np.concatenate([[0], np.cumsum(ends)])
    long = np.bincount(stretch)[stretch] >= SHORTEST
    return rows[long], np.unique(stretch[long], return_inverse=True)[1]


def _group(columns: Block, names: Sequence[str], unit: float) -> FloatArray | None:
    """Return columns (n, k) in SI, NaN for what is missing; None where all of it is."""
    if not any(name in columns for name in names):
        return None
    nothing = np.full(len(columns["time_s"]), np.nan)
    values = np.stack([columns.get(name, nothing) for name in names], axis=1) * unit
    return None if np.isnan(values).all() else values


def _joints(
    columns: Block, names: Sequence[str], stretch: IndexArray, beside: FloatArray | None
) -> FloatArray | None:
    """Return angles (n, 6) [rad] without whole turns in a stretch, within half a turn of others."""
    angles = _group(columns, names, DEG)
    if angles is None:
        return None
    turn = 2.0 * np.pi
    if beside is not None:
        return np.asarray(angles - turn * np.rint((angles - beside) / turn))
    leaps = np.rint(np.diff(angles, axis=0) / turn)
    leaps[np.diff(stretch) != 0] = 0.0
    angles[1:] -= turn * np.cumsum(leaps, axis=0)
    return angles


def _check_time(path: str, time: FloatArray, command: FloatArray, stretch: IndexArray) -> None:
    inside = np.diff(stretch) == 0
    step = np.diff(time)[inside]
    speed = np.abs(np.diff(command, axis=0)[inside]) / step[:, None]
    typical = np.quantile(speed, 0.99, axis=0) if len(step) else np.zeros(6)
    worst = int(np.argmax(typical))
    if typical[worst] > FASTEST:
        raise DataError(
            "TRC004",
            f"axis {worst + 1} would turn at {typical[worst] / DEG:.0f} deg/s, expected time_s in"
            " seconds and angles in degrees",
            SourceRef(path),
        )


def numbered(blocks: Iterable[Block]) -> Iterator[Block]:
    """Yield blocks with the number of each row, so that what is left out ends a stretch."""
    first = 0
    for block in blocks:
        count = len(block["time_s"])
        yield block | {"row": np.arange(first, first + count, dtype=np.float64)}
        first += count
