"""Rows of different designs in one campaign, and whether an effect holds from one to another.

A selection made inside one design of poses need not hold in another: what fits a grid at one
orientation may be wrong at random ones. So rows are told apart by how they were laid out: labels
of the file, sweeps of single joints, a constant tool orientation. An effect is then fitted without
one design and judged on it, where the frames may adapt (leave one group out, as Roberts et al.
2017, Ecography 40, 913, ask for where predictions are to leave the sampled region).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.gap.data.dataset import Samples
from postproc.records import dataclass
from postproc.units import DEG

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

    Args:
        samples: rows in the order of measuring.
        group: labels of the file; they are taken where few of them hold most rows.
    """
    n = len(samples)
    if group is not None and len(group) == n:
        named = _of_labels(np.array(group), "")
        if len(named) > 1 and named.source:
            return Designs(named.label, named.names, "group")
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
    return Designs(label, tuple(names), source or "group")


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
