"""Rows that are kept apart: sealed ones, folds for comparisons, and rows of different designs.

Rows that belong together (repeats, neighbours in joint space, one group label) stay together,
else a test row has its like among the fitted ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray, Rows
from postproc.gap.data.dataset import Samples
from postproc.records import dataclass
from postproc.units import DEG

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
    """Return the set-up of each row (n,): each is parted alike, else its frame would be unknown."""
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


FEWEST = 12
"""Rows of a design; a smaller one says nothing of its own."""
LARGEST = 8
"""Designs told apart; of more orientations the nearest ones are taken together."""
_SHARE = 0.05
_COVERED = 0.8
_STILL = 0.05 * DEG
"""A joint stands within this."""
_ALIKE = 1.5 * DEG
"""Tool orientations within this are one."""
_APART = 0.05
"""Spread of the points [m] from which rows of one orientation are a grid, not a repeat."""


@dataclass(frozen=True, slots=True)
class Designs:
    """Labels (n,) 0..k-1 of rows, the names of the k designs, and what they were told by.

    source: "group", "layout", or "" where all rows are of one design.
    """

    label: IntArray
    names: tuple[str, ...]
    source: str

    def __len__(self) -> int:
        """Return the number of designs."""
        return len(self.names)

    def rows(self, index: Rows) -> Designs:
        """Return the labels of some rows; a design may be left without any."""
        return Designs(self.label[index], self.names, self.source)


def designs(samples: Samples, group: Sequence[str] | None = None) -> Designs:
    """Return the designs of a campaign.

    A selection made inside one design of poses need not hold in another: what fits a grid at one
    orientation may be wrong at random ones. So an effect is fitted without one design and judged
    on it, where the frames may adapt (leave one group out, as Roberts et al. 2017, Ecography 40,
    913, ask for where predictions are to leave the sampled region). Told by labels of the file,
    sweeps of single joints, a constant tool orientation.

    Args:
        samples: rows in the order of measuring.
        group: labels of the file; they are taken where few of them hold most rows.
    """
    n = len(samples)
    if group is not None and len(group) == n:
        named = _of_labels(np.array(group), "group")
        if len(named) > 1:
            return named
    sweep = _sweeps(samples.q)
    turn = _orientations(samples)
    words = [
        f"sweep of A{s}" if s else f"orientation {t}" if t else "varied poses"
        for s, t in zip(sweep, turn, strict=True)
    ]
    return _of_labels(np.array(words), "layout")


def _of_labels(words: FloatArray, source: str) -> Designs:
    """Return labels by size; small ones are one design together, or go to the largest."""
    n = len(words)
    found, index, counts = np.unique(words, return_inverse=True, return_counts=True)
    enough = max(FEWEST, _SHARE * n)
    order = [int(k) for k in np.argsort(-counts, kind="stable") if counts[k] >= enough]
    if len(order) < 2 or len(order) > LARGEST or counts[order].sum() < (_COVERED * n):
        return Designs(np.zeros(n, dtype=np.int32), ("all",), "")
    names = [str(found[k]) for k in order]
    number = np.full(len(found), -1, dtype=np.int32)
    number[order] = np.arange(len(order))
    label = number[index]
    rest = label < 0
    if int(rest.sum()) >= FEWEST:
        names.append("others")
        label[rest] = len(names) - 1
    else:
        label[rest] = 0
    return Designs(label, tuple(names), source)


def _sweeps(q: FloatArray) -> IntArray:
    """Return (n,) the joint 1..6 that alone moves in a run of rows, 0 elsewhere."""
    moving = np.abs(np.diff(q, axis=0)) > _STILL
    alone = np.where(moving.sum(axis=1) == 1, np.argmax(moving, axis=1) + 1, 0)
    out = np.zeros(len(q), dtype=np.int32)
    start = 0
    for end in range(1, len(alone) + 1):
        if end == len(alone) or alone[end] != alone[start]:
            if alone[start] and end - start + 1 >= FEWEST:
                out[start : end + 1] = alone[start]
            start = end
    return out


def _orientations(samples: Samples) -> IntArray:
    """Return (n,) the number 1.. of a tool orientation that many rows at other places share."""
    from scipy.spatial import cKDTree

    R = samples.frames[:, 6, :3, :3].reshape(len(samples), 9)
    left = np.ones(len(R), dtype=bool)
    out = np.zeros(len(R), dtype=np.int32)
    centres: list[FloatArray] = []
    # a rotation by a small angle moves the nine numbers by sqrt(2) times it
    tree, radius = cKDTree(R), 2.0**0.5 * _ALIKE
    few = min(FEWEST, len(R))
    away = np.asarray(tree.query(R, k=[few], distance_upper_bound=radius)[0])[:, 0]
    for row in np.flatnonzero(away < radius):
        if not left[row]:
            continue
        near = np.array(tree.query_ball_point(R[row], radius))
        near = near[left[near]]
        left[row] = False
        spread = float(np.ptp(samples.point[near], axis=0).max())
        if len(near) >= FEWEST and spread > _APART:
            left[near] = False
            centres.append(R[near].mean(axis=0))
            out[near] = len(centres)
    return _merged(out, np.array(centres))


def _merged(label: IntArray, centres: FloatArray) -> IntArray:
    """Take the nearest orientations together until there are few."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(centres) <= LARGEST - 2:
        return label
    cluster = fcluster(linkage(centres, "ward"), LARGEST - 2, "maxclust")
    return np.asarray(np.concatenate([[0], cluster])[label], dtype=np.int32)
