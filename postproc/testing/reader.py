"""What every reader must keep: SI units, true source lines, honest sniffing, one clear error.

The checks read a file of the format that the author gives, whole and damaged in many ways.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from postproc.errors import PostprocError
from postproc.model import MotionKind, ToolPath
from postproc.readers import HEAD_BYTES, LENGTH_UNITS, Reader, ReadOptions
from postproc.testing.contract import require

Check = Callable[[Reader, Path, ReadOptions], None]
_NOT_CAM = (b"", b"\n\n", b"Dear all,\nplease find enclosed\n", bytes(range(1, 256)))
_DAMAGES = 12
"""Of each kind."""


def check_sniff(reader: Reader, path: Path, options: ReadOptions) -> None:
    """It is sure of its own file, less sure of what is none, and fails on nothing."""
    del options
    own = reader.sniff(path.read_bytes()[:HEAD_BYTES])
    _require(0.0 < own <= 1.0, reader, f"it sniffs its own file with {own}, expected above 0 to 1")
    for head in _NOT_CAM:
        try:
            other = reader.sniff(head)
        except Exception as problem:  # noqa: BLE001 - whatever a foreign reader may raise
            _require(False, reader, f"sniffing {head[:20]!r} fails: {problem!r}")
        _require(0.0 <= other < own, reader, f"it sniffs {head[:20]!r} with {other}")


def check_toolpath(reader: Reader, path: Path, options: ReadOptions) -> None:
    """What it reads stands in SI units, and every tag has its line and its tables."""
    before = path.read_bytes()
    toolpath = reader.read(str(path), options)
    _require(path.read_bytes() == before, reader, "it changes the file")
    _require(len(toolpath) > 0, reader, "it finds no tag in its own file")
    for good, reason in _columns(toolpath, path):
        _require(good, reader, reason)


def check_again(reader: Reader, path: Path, options: ReadOptions) -> None:
    """The same file gives the same toolpath."""
    first, second = (reader.read(str(path), options) for _ in range(2))
    _require(_same(first, second), reader, "it reads something else the second time")


def check_damage(reader: Reader, path: Path, options: ReadOptions) -> None:
    """A damaged file is read, or refused with one clear error that names file and line."""
    content = path.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        broken = Path(folder) / path.name
        for what, damaged in _damages(content):
            broken.write_bytes(damaged)
            _read_or_refuse(reader, broken, options, what)
        broken.unlink()
        _read_or_refuse(reader, broken, options, "a missing file")


CHECKS: tuple[Check, ...] = (check_sniff, check_toolpath, check_again, check_damage)
"""All that is asked of a reader."""


def check_reader(reader: Reader, path: str | Path, options: ReadOptions | None = None) -> None:
    """Hold a reader to its contract.

    Args:
        reader: the part that the entry point names.
        path: a file of its format with at least two tags.
        options: needed to read this file.

    Raises:
        PluginError: PLG004 with what it breaks.
    """
    require(isinstance(reader, Reader), "the reader", "it has no sniff and no read")
    for check in CHECKS:
        check(reader, Path(path), options or ReadOptions())


def _columns(toolpath: ToolPath, path: Path) -> Iterator[tuple[bool, str]]:
    n, lines = len(toolpath), len(path.read_bytes().splitlines())
    length = np.linalg.norm(toolpath.axes, axis=1)
    yield toolpath.path == str(path), "the toolpath does not carry the path as it was given"
    yield toolpath.units in LENGTH_UNITS, f"units {toolpath.units!r}, expected one of LENGTH_UNITS"
    yield bool(((toolpath.line >= 1) & (toolpath.line <= lines)).all()), "a line is not in the file"
    yield bool(np.isin(toolpath.kind, list(MotionKind)).all()), "a kind is no MotionKind"
    feed = toolpath.feed[np.isfinite(toolpath.feed)]
    yield bool((feed > 0.0).all()), "a feed is not above zero; NaN stands for none"
    blend = _finite(np.asarray(toolpath.largest_blend))
    yield bool(((blend >= 0.0) & (blend <= 1.0)).all()), "a largest_blend is not from 0 to 1 m"
    share = _finite(np.asarray(toolpath.joint_fraction))
    yield bool(((share > 0.0) & (share <= 1.0)).all()), "a joint_fraction is not above 0 to 1"
    # 100 m and 10 m/s are beyond any robot: a file in mm that was not scaled
    yield bool((np.abs(_finite(toolpath.points)) < 100.0).all()), "points are not in metres"
    yield bool((feed < 10.0).all()), "feeds are not in metres per second"
    yield bool((np.abs(_finite(length) - 1.0) < 1e-6).all()), "a tool axis is no unit vector"
    for name in ("operation", "tool", "arc", "cycle"):
        index, table = getattr(toolpath, name), getattr(toolpath, f"{name}s")
        inside = (index >= -1) & (index < len(table))
        yield bool(inside.all()), f"{name} points beyond the table of {name}s"
    inside = all(0 <= event.index <= n for event in toolpath.events)
    yield inside, "an event stands before a tag that is not there"


def _finite(values: Any) -> Any:  # noqa: ANN401 - arrays of any shape
    return values[np.isfinite(values)]


def _damages(content: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield what was done to a file, and what it became."""
    rng = np.random.default_rng(7)
    lines = content.splitlines(keepends=True)
    for share in np.linspace(0.1, 0.95, _DAMAGES):
        yield f"{share:.0%} of a file", content[: int(share * len(content))]
    for row in rng.integers(0, len(lines), _DAMAGES).tolist():
        yield f"without line {row + 1}", b"".join(lines[:row] + lines[row + 1 :])
        yield f"line {row + 1} twice", b"".join(lines[: row + 1] + lines[row:])
    digits = [at for at, byte in enumerate(content) if chr(byte).isdigit()]
    for at in rng.choice(digits, _DAMAGES).tolist() if digits else ():
        yield f"byte {at} no digit", content[:at] + b"x" + content[at + 1 :]


def _read_or_refuse(reader: Reader, path: Path, options: ReadOptions, what: str) -> None:
    try:
        toolpath = reader.read(str(path), options)
    except PostprocError as error:
        place = error.source
        good = place is not None and place.path == str(path) and place.line >= 1
        _require(good, reader, f"{what}: the error names no place in the file: {error}")
    except Exception as problem:  # noqa: BLE001 - whatever a foreign reader may raise
        _require(False, reader, f"{what}: it fails with {problem!r}")
    else:
        for good, reason in _columns(toolpath, path):
            _require(good, reader, f"{what}: {reason}")


def _same(first: Any, second: Any) -> bool:  # noqa: ANN401 - columns and tables of a toolpath
    if isinstance(first, np.ndarray):
        return isinstance(second, np.ndarray) and np.array_equal(
            first, second, equal_nan=first.dtype.kind == "f"
        )
    if is_dataclass(first):
        names = [column.name for column in fields(first)]
        return all(_same(getattr(first, name), getattr(second, name)) for name in names)
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(_same, first, second))
    if isinstance(first, Mapping):
        return first.keys() == second.keys() and all(_same(first[k], second[k]) for k in first)
    return bool(first == second) or (first != first and second != second)


def _require(good: bool, reader: Reader, reason: str) -> None:
    require(good, f"the reader {type(reader).__name__}", reason)
