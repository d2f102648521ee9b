"""Rows far off that follow something that was logged: no measuring faults, but a riddle."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.data import Samples
from postproc.gap.fit import Problem, gross_faults
from postproc.records import dataclass

FEWEST = 4
"""Rows of a set that can be said to follow anything."""
_SURE = 1e-3
"""Probability by chance, over all columns looked at, below which a set follows one."""

_FEW = 8
"""Rows of a set for which ranks are no normal distribution yet."""
_SUSPECT = 0.05


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
    from scipy.special import erfc

    if float(np.ptp(values)) <= 0.0:
        return 1.0
    count, n = int(bad.sum()), len(bad)
    _, place, alike = np.unique(values, return_inverse=True, return_counts=True)
    rank = (np.cumsum(alike) - 0.5 * (alike - 1.0))[place]
    off = abs(float(rank[bad].sum()) - 0.5 * count * (n + 1))
    ties = float(np.sum(alike**3.0 - alike)) / (n * (n - 1))
    spread = np.sqrt(count * (n - count) / 12.0 * (n + 1 - ties))
    chance = float(min(erfc((off - 0.5) / spread / np.sqrt(2.0)), 1.0))
    if count > _FEW or ties or chance > _SUSPECT:
        return chance
    return min(2.0 * _exact(round(0.5 * count * (n - count) - off), count, n - count), 1.0)


def _exact(most: int, count: int, others: int) -> float:
    """Return the chance that a set of ranks without ties lies within so many steps of one end.

    Sets are counted as partitions: how far each of ``count`` rows is moved past the ``others``.
    """
    ways = [1] + [0] * most
    for part in range(1, count + 1):
        for steps in range(most, others + part - 1, -1):
            ways[steps] -= ways[steps - others - part]
        for steps in range(part, most + 1):
            ways[steps] += ways[steps - part]
    return sum(ways) / comb(others + count, count)
