"""Rows that are kept apart: sealed ones, opened once at the end, and folds for comparisons.

Rows that belong together (repeats, neighbours in joint space, one group label) stay together,
else a test row has its like among the fitted ones.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.data.dataset import Samples
from postproc.records import dataclass

SEALED_SHARE = 0.25
FEWEST = 40
"""Rows below which none is sealed."""
_MOST_SEALED = 0.5
"""No place with more of the rows is sealed: one pose read again and again is all there is."""
FOLDS = 8
STRETCHES = 5
_SEED = 20220115
"""Fixed: the same file gives the same split."""


@dataclass(frozen=True, slots=True)
class Split:
    """Rows (n,) kept apart.

    sealed: not looked at before the end: some places, and a stretch of time; fold: number of
    neighbouring poses, 0..k-1; stretch: of rows that follow each other; neither holds a whole
    set-up; cluster: of alike rows.
    """

    sealed: BoolArray
    fold: IntArray
    stretch: IntArray
    cluster: IntArray

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1


def split(samples: Samples, group: tuple[str, ...] | None) -> Split:
    """Return the split of a campaign.

    Args:
        samples: rows.
        group: labels; with at least eight of them they are the units, else pose clusters are.
    """
    n = len(samples)
    rng = np.random.default_rng(_SEED)
    unit = _units(samples)
    labels = _labels(group, n)
    if labels is not None and FOLDS <= int(labels.max()) + 1 <= n // 2:
        cluster = labels
        fold = _dealt(cluster, FOLDS, rng)
    else:
        features = _features(samples)
        cluster = _clusters(features, max(2, min(n // 5, 120)), rng)
        fold = np.zeros(n, dtype=np.int32)
        for k in range(int(unit.max()) + 1):
            here = np.flatnonzero(unit == k)
            fold[here] = _clusters(features[here], min(FOLDS, max(2, len(here) // 6)), rng)
    rank, size = _course(samples, unit)
    stretch = (rank * min(STRETCHES, max(2, n // 12)) // size).astype(np.int32)
    sealed = np.zeros(n, dtype=bool)
    if n >= FEWEST:
        sealed = _late(rank, size, 0.4 * SEALED_SHARE, rng)
        sealed |= _sealed(cluster, 0.6 * SEALED_SHARE, rng)
    return Split(sealed, fold, stretch, cluster)


def _units(samples: Samples) -> IntArray:
    """Return the number (n,) 0.. of the set-up of each row.

    Each set-up is parted alike, so that none is left out as a whole: its frame would be unknown.
    """
    n = len(samples)
    labels = np.zeros((n, 1)) if samples.set_up is None else samples.set_up
    return np.unique(labels, axis=0, return_inverse=True)[1].reshape(n).astype(np.int32)


def _course(samples: Samples, unit: IntArray) -> tuple[IntArray, IntArray]:
    """Return where each row (n,) comes in its set-up's course, and how many rows (n,) that has."""
    n = len(samples)
    order = np.lexsort((np.arange(n), samples.course, unit))
    count = np.bincount(unit)
    rank = np.empty(n, dtype=np.int32)
    rank[order] = np.arange(n) - np.repeat(np.cumsum(count) - count, count)
    return rank, count[unit].astype(np.int32)


def _late(rank: IntArray, size: IntArray, share: float, rng: np.random.Generator) -> BoolArray:
    """Return one stretch of rows that follow each other, of each set-up."""
    n = len(rank)
    length = int(share * n)
    start = int(rng.integers(0, n - length + 1))
    part = rank / size
    return np.asarray((part >= start / n) & (part < (start + length) / n))


def _labels(group: tuple[str, ...] | None, n: int) -> IntArray | None:
    if group is None or len(group) != n:
        return None
    return np.unique(np.array(group), return_inverse=True)[1].astype(np.int32)


def _features(samples: Samples) -> FloatArray:
    """Return the pose as place of the point and direction of the last links, scaled."""
    place = samples.point / (np.std(samples.point, axis=0).max() + 1e-9)
    turned = samples.frames[:, 6, :3, :2].reshape(len(samples), 6)
    return np.concatenate([place, turned], axis=1)


def _clusters(features: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Return k-means labels, 0..k-1 without gaps."""
    n = len(features)
    centres = features[rng.choice(n, min(count, n), replace=False)]
    label = np.zeros(n, dtype=np.int32)
    for _ in range(12):
        square = (
            np.sum(features**2, axis=1)[:, None]
            - 2.0 * features @ centres.T
            + np.sum(centres**2, axis=1)
        )
        label = np.argmin(square, axis=1).astype(np.int32)
        for k in range(len(centres)):
            if np.any(label == k):
                centres[k] = features[label == k].mean(axis=0)
    return np.unique(label, return_inverse=True)[1].astype(np.int32)


def _sealed(cluster: IntArray, share: float, rng: np.random.Generator) -> BoolArray:
    sealed = np.zeros(len(cluster), dtype=bool)
    for k in rng.permutation(int(cluster.max()) + 1):
        if sealed.mean() >= share:
            break
        here = cluster == k
        if here.mean() <= _MOST_SEALED:
            sealed |= here
    return sealed


def _dealt(cluster: IntArray, folds: int, rng: np.random.Generator) -> IntArray:
    order = rng.permutation(int(cluster.max()) + 1)
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.arange(len(order)) % folds
    return np.asarray(number[cluster])
