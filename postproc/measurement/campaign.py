"""A measuring campaign in several files: the rows of all, in the order given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.errors import DataError, SourceRef
from postproc.measurement.columns import (
    CONDITIONS,
    LABELS,
    NAMED_CONDITIONS,
    QUANTITIES,
    Empty,
    Quantity,
)
from postproc.measurement.file import read_measurements
from postproc.measurement.rows import MeasurementSet

_ALL_OR_NONE = (Empty.COLUMN, Empty.BETWEEN)


def read_campaign(paths: Sequence[str | Path], set_aside: bool = False) -> MeasurementSet:
    """Read one or more measurement files of the same robot and tool.

    Loads, approach directions and speeds that one of the files does not have count as none there,
    as in a single file; columns of unknown names count where all files have them. A file without a
    column ``station`` is a station of its own, named as the file; likewise its reflector, where
    another file names some.

    Args:
        paths: the files.
        set_aside: leave rows out that lack a joint angle or any reading, with a remark.

    Raises:
        DataError: MEA011 for a time, temperature or orientation in some of the files only; and
            those of ``read_measurements``.
        ReadError: IO001, IO002.
    """
    parts = [read_measurements(path, set_aside) for path in paths]
    if len(parts) > 1:
        parts = _with_stations(parts)
    whole = parts[0]
    for part in parts[1:]:
        whole = _joined(whole, part)
    return whole


def _with_stations(parts: Sequence[MeasurementSet]) -> list[MeasurementSet]:
    """Return the files with labels of station and reflector in all of them."""
    taken: set[str] = set()
    named = any(part.reflector is not None for part in parts)
    found = []
    for part in parts:
        labels: dict[str, Any] = {}
        if part.station is None:
            labels["station"] = (_free_name(part.path, taken),) * len(part)
        if named and part.reflector is None:
            labels["reflector"] = ("",) * len(part)
        found.append(replace(part, **labels))
    return found


def _free_name(path: str, taken: set[str]) -> str:
    """Return the name of a file that is not taken yet, and take it."""
    stem = name = Path(path).stem
    number = 1
    while name in taken:
        number += 1
        name = f"{stem} {number}"
    taken.add(name)
    return name


def _joined(first: MeasurementSet, second: MeasurementSet) -> MeasurementSet:
    for part in QUANTITIES:
        there = [getattr(rows, part.field) is not None for rows in (first, second)]
        if part.field != "sigma" and part.empty in _ALL_OR_NONE and there[0] != there[1]:
            with_, without = (first, second) if there[0] else (second, first)
            raise DataError(
                "MEA011",
                f"{', '.join(part.names)} is filled in in {with_.path} and not in {without.path}, "
                "expected in both or in none",
                SourceRef(second.path, 1),
            )
    labels: dict[str, Any] = {name: _labels(first, second, name) for name in LABELS}
    return replace(
        first,
        line=np.concatenate([first.line, second.line]),
        ids=(*first.ids, *_own_names(first, second)),
        **labels,
        remarks=(*first.remarks, *second.remarks),
        extra=_extra(first, second),
        **{part.field: _stacked(first, second, part) for part in QUANTITIES},
    )


def _stacked(first: MeasurementSet, second: MeasurementSet, part: Quantity) -> Any:  # noqa: ANN401
    """Return the numbers of both; missing loads, directions and speeds are zeros."""
    values = [getattr(rows, part.field) for rows in (first, second)]
    known = [v for v in values if v is not None]
    if not known:
        return None
    missing = np.nan if part.empty is Empty.PART else 0.0
    if part.field == "sigma":
        missing = float(np.median([np.median(v) for v in known]))
    counts = [(len(rows), *known[0].shape[1:]) for rows in (first, second)]
    both = zip(values, counts, strict=True)
    return np.concatenate([np.full(count, missing) if v is None else v for v, count in both])


def _own_names(first: MeasurementSet, second: MeasurementSet) -> tuple[str, ...]:
    """Return the second's row names, with its file's name where the first has the same."""
    taken = set(first.ids)
    stem = Path(second.path).stem
    return tuple(f"{stem}:{name}" if name in taken else name for name in second.ids)


def _labels(first: MeasurementSet, second: MeasurementSet, name: str) -> tuple[str, ...] | None:
    given = [(getattr(part, name), len(part)) for part in (first, second)]
    if all(labels is None for labels, _ in given):
        return None
    return tuple(label for labels, n in given for label in (labels or ("",) * n))


def _extra(first: MeasurementSet, second: MeasurementSet) -> dict[str, object]:
    found: dict[str, object] = {}
    for name in dict.fromkeys((*first.extra, *second.extra)):
        values, more = (_condition(rows, name) for rows in (first, second))
        if values is None or more is None:
            continue
        if isinstance(values, np.ndarray) and isinstance(more, np.ndarray):
            found[name] = np.concatenate([values, more])
        else:
            found[name] = tuple(str(v) for v in (*values, *more))
    return found


def _condition(rows: MeasurementSet, name: str) -> Any:  # noqa: ANN401 - numbers or labels
    """Return a further column; one of a known name is empty where the file does not have it."""
    if name in rows.extra or name not in CONDITIONS:
        return rows.extra.get(name)
    if name in NAMED_CONDITIONS:
        return ("",) * len(rows)
    return np.full(len(rows), np.nan)
