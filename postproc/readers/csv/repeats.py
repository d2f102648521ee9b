"""Repeated names in a point list: one point measured several times is one point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.readers.text import Faults
from postproc.units import MM

SPREAD = 1.0 * MM
"""Rows of one name that lie within this [m] of each other are repeated measurements."""


def merged_repeats(
    names: list[str], others: Sequence[Sequence[object]], points: FloatArray, line: IntArray,
    faults: Faults,
) -> tuple[FloatArray, IndexArray] | None:  # fmt: skip
    """Return the mean point of each name and the first row of each, None if no name repeats.

    Rows without a name stay as they are, and one hole may stand in several operations, with several
    tools, depths or speeds, and in several bases.

    Args:
        names: of the n rows.
        others: columns of the n rows that tell rows of one name apart.
        points: (n, 3) [m].
        line: (n,) source lines.
        faults: for the warning and the error.

    Raises:
        ReadError: CSV040 if rows of one name are far apart.
    """
    keys = list(zip(names, *others, strict=True))
    if len(set(keys)) == len(names) and "" not in names:
        return None
    index: dict[object, int] = {}
    group = np.array(
        [
            index.setdefault(key if name else (key, row), len(index))
            for row, (key, name) in enumerate(zip(keys, names, strict=True))
        ]
    )
    if len(index) == len(names):
        return None
    first = np.full(len(index), len(names), dtype=np.int64)
    np.minimum.at(first, group, np.arange(len(names)))
    mean = np.zeros((len(index), 3))
    np.add.at(mean, group, points)
    mean /= np.bincount(group)[:, None]
    gap = np.linalg.norm(points - points[first[group]], axis=1)
    far = np.flatnonzero(gap > SPREAD)
    if len(far):
        row = int(far[0])
        raise faults.error(
            "CSV040",
            f"{names[row]!r} stands for two points {gap[row] / MM:.3f} mm apart, "
            f"the other in line {line[first[group[row]]]}",
            int(line[row]),
            hint="give each point its own name; rows within 1 mm count as repeated measurements",
        )
    faults.warn(
        "CSV140",
        f"{len(names) - len(index)} rows repeat a name: repeated measurements, their mean is taken",
        int(line[np.setdiff1d(np.arange(len(names)), first)[0]]),
    )
    return mean, first
