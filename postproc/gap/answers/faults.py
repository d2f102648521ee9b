"""Rows far off that follow something that was logged: no measuring faults, but a riddle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.data import Samples
from postproc.gap.fit import Problem, gross_faults
from postproc.records import dataclass

FEWEST = 4
"""Rows of a set that can be said to follow anything."""
_SURE = 1e-3
"""Probability by chance, over all columns looked at, below which a set follows one."""


@dataclass(frozen=True, slots=True)
class Followed:
    """What a set of rows follows: (n,) these rows, the class of it (None: nothing), the column."""

    rows: BoolArray
    part: str | None = None
    column: str = ""


def followed(problem: Problem, bad: BoolArray) -> Followed:
    """Return what rows (n,) that look like faults follow, gross ones aside."""
    bad = bad & ~gross_faults(problem.gap)
    count = int(bad.sum())
    none = Followed(np.zeros(len(bad), dtype=bool))
    if count < FEWEST or count > len(bad) // 2:
        return none
    told = []
    columns = list(_columns(problem.samples))
    for kind, name, values in columns:
        told.append((_chance(values, bad), kind, name))
    p, kind, name = min(told, default=(1.0, "", ""))
    if p * len(columns) > _SURE:
        return none
    return Followed(bad, kind, name)


def _columns(samples: Samples) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield class, name and values (n,) of everything logged that a set may follow."""
    if samples.wrench is not None:
        for k, axis in enumerate("xyz"):
            yield "load", f"f{axis}_N", samples.wrench[:, k]
        yield "load", "force", np.linalg.norm(samples.wrench[:, :3], axis=1)
    if samples.direction is not None:
        for k in range(6):
            yield "approach", f"dir{k + 1}", samples.direction[:, k]
    if samples.qd is not None:
        for k in range(6):
            yield "speed", f"qd{k + 1}", samples.qd[:, k]
    yield "time", "time", samples.course
    if samples.temperature is not None:
        yield "temperature", "temperature", samples.temperature
    for name, values in samples.extra.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiu" and bool(np.all(np.isfinite(array))):
            yield "condition", name, array.astype(np.float64)


def _chance(values: FloatArray, bad: BoolArray) -> float:
    """Return how often ranks of a set lie so far to one side by chance (Mann and Whitney)."""
    from scipy.stats import mannwhitneyu

    if float(np.ptp(values)) <= 0.0:
        return 1.0
    return float(mannwhitneyu(values[bad], values[~bad], alternative="two-sided").pvalue)
