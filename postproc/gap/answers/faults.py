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
    """Yield class, name and values (n,) or (n, k) of everything logged that a set may follow."""
    if samples.wrench is not None:
        yield "load", "direction of the force", samples.wrench[:, :3]
        yield "load", "force", np.linalg.norm(samples.wrench[:, :3], axis=1)
    if samples.direction is not None:
        yield "approach", "dir", samples.direction
    if samples.qd is not None:
        yield "speed", "qd", samples.qd
    yield "time", "time", samples.course
    if samples.temperature is not None:
        yield "temperature", "temperature", samples.temperature
    for name, values in samples.extra.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiu" and bool(np.all(np.isfinite(array))):
            yield "condition", name, array.astype(np.float64)


def _chance(values: FloatArray, bad: BoolArray) -> float:
    """Return how often values of a set lie so far to one side by chance.

    Ranks of one column (Mann and Whitney), means of several (Hotelling): a mount that a pull
    opens follows a direction that is no axis.
    """
    from scipy.special import fdtrc
    from scipy.stats import mannwhitneyu

    if float(np.ptp(values)) <= 0.0:
        return 1.0
    one, other = values[bad], values[~bad]
    if values.ndim == 1:
        return float(mannwhitneyu(one, other, alternative="two-sided").pvalue)
    apart = one.mean(axis=0) - other.mean(axis=0)
    each = np.concatenate([one - one.mean(axis=0), other - other.mean(axis=0)])
    freedom, k = len(values) - 2, int(np.linalg.matrix_rank(each))
    if freedom <= k:
        return 1.0
    inverse = np.linalg.pinv(each.T @ each / freedom)
    square = float(apart @ inverse @ apart) * len(one) * len(other) / len(values)
    return float(fdtrc(k, freedom - k + 1, square * (freedom - k + 1) / (k * freedom)))
