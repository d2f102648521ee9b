"""What rows read of their points: one to three numbers, each along a direction of its own.

Any reading that the arm's point changes is a component of it, to first order: a coordinate, a dial
gauge, a distance along the line to its other end, an axis of a tracker's covariance. So a row has
the point that its readings would have, were all else as the model expects, and the directions that
it speaks of; along others it says nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.geometry import apply
from postproc.measurement import Readings
from postproc.records import dataclass

_NOTHING = 1e-9
"""Square of a direction over the largest of its row from which it counts as read."""
_LENGTHS = np.array([1.0, 1.5382 / 0.6745, 1.5382 / 1.1774, 1.0])
"""Median length of a normal error of three components over that of one, two and three."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Directions that rows (n,) read.

    root: (n, 3, 3) directions in rows, over their sd against the usual one of the row; zero where
    less was read; onto: (n, 3, 3) projects on them; count: (n,) how many; references: (n, 3, k)
    what a number of an unknown origin or plane moves their points by, as they read it; readings,
    frame: what ``seen_by`` made them of.
    """

    root: FloatArray
    onto: FloatArray
    count: IntArray
    references: FloatArray
    readings: Readings
    frame: FloatArray

    def rows(self, index: Rows | slice) -> Seen:
        """Return what some of the rows read."""
        root, onto, count = self.root[index], self.onto[index], self.count[index]
        return replace(self, root=root, onto=onto, count=count, references=self.references[index])

    def size(self, rest: FloatArray) -> FloatArray:
        """Return the lengths (n,) of errors (n, 3) [m], as of three components of the usual sd."""
        white = np.einsum("nij,nj->ni", self.root, rest)
        return np.asarray(np.linalg.norm(white, axis=1) * _LENGTHS[self.count])


def seen_by(
    readings: Readings, point: FloatArray, T_measured_robroot: FloatArray
) -> tuple[Seen, FloatArray, FloatArray]:
    """Return what rows read, the points (n, 3) that they read, and the usual sd (n,) [m].

    Args:
        readings: of the rows, in the measured frame.
        point: (n, 3) points that are expected, robroot [m].
        T_measured_robroot: (n, 4, 4), or one for all.
    """
    n = len(point)
    T = np.broadcast_to(T_measured_robroot, (n, 4, 4))
    there = apply(T, point)
    x = readings.start(there)
    row, count = readings.row, np.bincount(readings.row, minlength=n)
    usual = np.sqrt(np.bincount(row, readings.sigma**2, n) / np.maximum(count, 1))
    known = np.isfinite(readings.sigma) & np.isfinite(usual[row])
    share = np.where(known, usual[row] / np.where(known, readings.sigma, 1.0), 1.0)
    way = np.einsum("mij,mi->mj", T[row, :3, :3], readings.slopes(there, x)) * share[:, None]
    off = np.column_stack([-readings.misfit(there, x), readings.unknown_slopes(there, x)])
    products, told = np.zeros((n, 3, 3)), np.zeros((n, 3, off.shape[1]))
    np.add.at(products, row, way[:, :, None] * way[:, None])
    np.add.at(told, row, way[:, :, None] * (off * share[:, None])[:, None])
    values, axes = np.linalg.eigh(products)
    read = values > _NOTHING * values[:, -1:]
    values = np.where(read, values, 0.0)
    root = np.sqrt(values)[:, :, None] * np.swapaxes(axes, 1, 2)
    onto = (axes * read[:, None]) @ np.swapaxes(axes, 1, 2)
    inverse = (axes / np.where(read, values, np.inf)[:, None]) @ np.swapaxes(axes, 1, 2)
    moved = inverse @ told
    count = read.sum(axis=1).astype(np.int32)
    return Seen(root, onto, count, moved[:, :, 1:], readings, T), point + moved[:, :, 0], usual
