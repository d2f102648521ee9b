"""Aligns two long sequences of program lines: which line of one is which line of the other.

Lines that are the same and stand once on both sides are anchors (the longest chain of them that is
in order on both sides); between anchors the cheapest alignment is searched in a band around the
diagonal, where two motions cost the more the farther apart their targets are.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import FloatArray, IndexArray, longest_rising
from postproc.records import dataclass

GAP = 1.0
"""Cost of a line that the other program has not."""
FAR = 2.1
"""Cost of two lines that must not be taken for one: more than leaving both alone."""
OTHER = 0.5
"""Cost of two lines that are not the same."""
NEARNESS = 0.02
"""What distance adds to it up to ``CLOSE``: enough to place a gap, too little to make one."""
CLOSE, APART = 20.0, 120.0
"""Targets [mm or deg] nearer than the first are taken for one; beyond the second rather not."""
OTHER_WORD = 0.3
MAX_BAND = 1500
_MARGIN = 40
_SUB, _UP, _LEFT = 0, 1, 2


@dataclass(frozen=True, slots=True)
class Lines:
    """One program's lines in columns.

    ``key`` (n,): equal for lines that are the same in everything that is compared;
    ``group`` (n,): lines of different groups are never taken for one; ``word`` (n,);
    ``numbers`` (n, 6): target of a motion, 0 for others.
    """

    key: IndexArray
    group: IndexArray
    word: IndexArray
    numbers: FloatArray

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.key)


def align(old: Lines, new: Lines) -> tuple[IndexArray, IndexArray]:
    """Return pairs (p,), (p,) of lines that are taken for one, in order on both sides."""
    i, j = _anchors(old.key, new.key)
    left, right = [i], [j]
    for stretches in _gaps(i, j, len(old), len(new)):
        pairs = _gap_pairs(old, new, *stretches)
        left.append(pairs[0])
        right.append(pairs[1])
    i, j = np.concatenate(left), np.concatenate(right)
    order = np.argsort(i, kind="stable")
    return i[order], j[order]


def _gaps(
    i: IndexArray, j: IndexArray, n: int, m: int
) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Yield the stretches (a, b), (c, d) between anchors that hold lines on both sides."""
    starts_old, starts_new = np.r_[0, i + 1], np.r_[0, j + 1]
    stops_old, stops_new = np.r_[i, n], np.r_[j, m]
    both = (stops_old > starts_old) & (stops_new > starts_new)
    for k in np.flatnonzero(both).tolist():
        yield ((int(starts_old[k]), int(stops_old[k])), (int(starts_new[k]), int(stops_new[k])))


def _anchors(old: IndexArray, new: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Return pairs of lines that are the same: heads, tails, and unique ones that are in order."""
    common = min(len(old), len(new))
    head = _equal(old[:common], new[:common])
    tail = _equal(old[head:][::-1], new[head:][::-1])
    stop_old, stop_new = len(old) - tail, len(new) - tail
    chain = _unique_chain(old[head:stop_old], new[head:stop_new])
    between = np.array(chain, dtype=np.int64).reshape(-1, 2) + head
    ends = np.arange(tail)
    return (
        np.concatenate([np.arange(head), between[:, 0], stop_old + ends]),
        np.concatenate([np.arange(head), between[:, 1], stop_new + ends]),
    )


def _equal(old: IndexArray, new: IndexArray) -> int:
    """Return how many lines are the same from the beginning."""
    count = min(len(old), len(new))
    differ = np.flatnonzero(old[:count] != new[:count])
    return int(differ[0]) if len(differ) else count


def _unique_chain(old: IndexArray, new: IndexArray) -> list[tuple[int, int]]:
    keys_old, first_old, count_old = np.unique(old, return_index=True, return_counts=True)
    keys_new, first_new, count_new = np.unique(new, return_index=True, return_counts=True)
    once_old, once_new = count_old == 1, count_new == 1
    _, at_old, at_new = np.intersect1d(keys_old[once_old], keys_new[once_new], return_indices=True)
    i = first_old[once_old][at_old]
    j = first_new[once_new][at_new]
    order = np.argsort(i, kind="stable")
    i, j = i[order], j[order]
    chain = longest_rising(j.tolist())
    return list(zip(i[chain].tolist(), j[chain].tolist(), strict=True))


def _gap_pairs(
    old: Lines, new: Lines, left: tuple[int, int], right: tuple[int, int]
) -> tuple[IndexArray, IndexArray]:
    n, m = left[1] - left[0], right[1] - right[0]
    i, j = np.arange(*left), np.arange(*right)
    if n == m:
        cost = _cost(old, new, i, j)
        if n == 1 or (cost <= OTHER + NEARNESS).all():
            fits = cost < FAR
            return i[fits], j[fits]
    if abs(n - m) + _MARGIN > MAX_BAND:
        return _coarse(old, new, i, j)
    return _banded(old, new, left, right)


def _cost(old: Lines, new: Lines, i: IndexArray, j: IndexArray) -> FloatArray:
    """Return the cost (k,) of taking line i (k,) of the old for line j (k,) of the new program."""
    off = np.abs(old.numbers[i] - new.numbers[j]).max(axis=-1, initial=0.0)
    cost = OTHER + NEARNESS * np.minimum(off / CLOSE, 1.0)
    cost += np.clip((off - CLOSE) / (APART - CLOSE), 0.0, 1.0)
    cost += OTHER_WORD * (old.word[i] != new.word[j])
    cost = np.where(old.key[i] == new.key[j], 0.0, cost)
    return np.where(old.group[i] == new.group[j], cost, FAR)


def _coarse(old: Lines, new: Lines, i: IndexArray, j: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Pair two stretches of very different length from their beginnings."""
    k = min(len(i), len(j))
    fits = _cost(old, new, i[:k], j[:k]) < FAR
    return i[:k][fits], j[:k][fits]


def _banded(
    old: Lines, new: Lines, left: tuple[int, int], right: tuple[int, int]
) -> tuple[IndexArray, IndexArray]:
    """Return the cheapest alignment of two stretches within a band around their diagonal."""
    (a, b), (c, d) = left, right
    n, m = b - a, d - c
    half = (abs(n - m) + _MARGIN) // 2 + 1 if max(n, m) > _MARGIN else max(n, m) + 1
    centre = np.rint(np.arange(n + 1) * (m / max(n, 1))).astype(np.int64)
    low = np.clip(centre - half - abs(n - m) // 2, 0, m)
    high = np.clip(centre + half + abs(n - m) // 2, 0, m)
    previous = GAP * np.arange(low[0], high[0] + 1, dtype=np.float64)
    moves: list[NDArray[np.int8]] = [np.full(len(previous), _LEFT, dtype=np.int8)]
    for row in range(1, n + 1):
        columns = np.arange(low[row], high[row] + 1)
        substituted = np.full(len(columns), np.inf)
        inside = (columns >= 1) & (columns - 1 >= low[row - 1]) & (columns - 1 <= high[row - 1])
        at = columns[inside]
        if len(at):
            cost = _cost(old, new, np.full(len(at), a + row - 1), c + at - 1)
            substituted[inside] = previous[at - 1 - low[row - 1]] + cost
        removed = np.full(len(columns), np.inf)
        above = (columns >= low[row - 1]) & (columns <= high[row - 1])
        removed[above] = previous[columns[above] - low[row - 1]] + GAP
        best = np.minimum(substituted, removed)
        steps = GAP * np.arange(len(columns))
        current = np.minimum.accumulate(best - steps) + steps
        move = np.where(substituted <= removed, _SUB, _UP).astype(np.int8)
        move[current < best - 1e-12] = _LEFT
        moves.append(move)
        previous = current
    return _trace_back(moves, low, n, m, a, c)


def _trace_back(
    moves: list[NDArray[np.int8]], low: IndexArray, n: int, m: int, a: int, c: int
) -> tuple[IndexArray, IndexArray]:
    rows: list[int] = []
    columns: list[int] = []
    row, column = n, m
    while row > 0 and column > 0:
        move = int(moves[row][column - low[row]])
        if move == _SUB:
            rows.append(a + row - 1)
            columns.append(c + column - 1)
        row -= move in (_SUB, _UP)
        column -= move in (_SUB, _LEFT)
    return np.array(rows[::-1], dtype=np.int64), np.array(columns[::-1], dtype=np.int64)
