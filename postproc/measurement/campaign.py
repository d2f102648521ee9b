"""A measuring campaign in several files: the rows of all, in the order given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.errors import DataError, SourceRef
from postproc.measurement.columns import QUANTITIES, Empty, Quantity
from postproc.measurement.file import read_measurements
from postproc.measurement.rows import MeasurementSet


def read_campaign(paths: Sequence[str | Path]) -> MeasurementSet:
    """Read one or more measurement files of the same robot, tool and measured frame.

    Loads, approach directions and speeds that one of the files does not have count as none there,
    as in a single file; columns of unknown names count where all files have them.

    Raises:
        DataError: MEA011 for a time, temperature or orientation in some of the files only; and
            those of ``read_measurements``.
        ReadError: IO001, IO002.
    """
    parts = [read_measurements(path) for path in paths]
    whole = parts[0]
    for part in parts[1:]:
        whole = _joined(whole, part)
    return whole


def _joined(first: MeasurementSet, second: MeasurementSet) -> MeasurementSet:
    for part in QUANTITIES:
        there = [getattr(rows, part.field) is not None for rows in (first, second)]
        if part.empty is Empty.COLUMN and there[0] != there[1]:
            with_, without = (first, second) if there[0] else (second, first)
            raise DataError(
                "MEA011",
                f"{', '.join(part.names)} is filled in in {with_.path} and not in {without.path}, "
                "expected in both or in none",
                SourceRef(second.path, 1),
            )
    return replace(
        first,
        line=np.concatenate([first.line, second.line]),
        ids=(*first.ids, *_own_names(first, second)),
        group=_groups(first, second),
        extra=_extra(first, second),
        **{part.field: _stacked(first, second, part) for part in QUANTITIES},
    )


def _stacked(first: MeasurementSet, second: MeasurementSet, part: Quantity) -> Any:  # noqa: ANN401
    """Return the numbers of both; missing loads, directions and speeds are zeros."""
    values = [getattr(rows, part.field) for rows in (first, second)]
    if values[0] is None and values[1] is None:
        return None
    nothing = [np.zeros((len(rows), len(part.names))) for rows in (first, second)]
    return np.concatenate([z if v is None else v for v, z in zip(values, nothing, strict=True)])


def _own_names(first: MeasurementSet, second: MeasurementSet) -> tuple[str, ...]:
    """Return the second's row names, with its file's name where the first has the same."""
    taken = set(first.ids)
    stem = Path(second.path).stem
    return tuple(f"{stem}:{name}" if name in taken else name for name in second.ids)


def _groups(first: MeasurementSet, second: MeasurementSet) -> tuple[str, ...] | None:
    if first.group is None and second.group is None:
        return None
    return tuple(
        label
        for part in (first, second)
        for label in (part.group if part.group is not None else ("",) * len(part))
    )


def _extra(first: MeasurementSet, second: MeasurementSet) -> dict[str, object]:
    found: dict[str, object] = {}
    for name, values in first.extra.items():
        more = second.extra.get(name)
        if more is None:
            continue
        if isinstance(values, np.ndarray) and isinstance(more, np.ndarray):
            found[name] = np.concatenate([values, more])
        else:
            found[name] = tuple(str(v) for v in (*values, *more))
    return found
