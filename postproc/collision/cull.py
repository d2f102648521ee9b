"""Culling: which pairs of bodies may be nearer than a threshold, for many configurations at once.

Two stages, each a rigorous lower bound of the distance: axis-aligned boxes of all pairs, then
oriented boxes of the survivors. What stays is for ``distance``. Arrays run over configurations
last.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray, Table, taken
from postproc.collision.boxes import box_gap, seen_from
from postproc.collision.shape import Shape
from postproc.collision.tree import SLACK
from postproc.records import dataclass

_TOGETHER = 100_000
"""So many gaps are worked out at once: few calls, and all stays in the cache of the processor."""


@dataclass(frozen=True, slots=True)
class Frames:
    """Links at n configurations ``q`` (n, 6 + k): ``link`` (l, 3, 4, n) their frames in robroot."""

    q: FloatArray
    link: FloatArray

    def __len__(self) -> int:
        """Return the number of configurations."""
        return int(self.link.shape[-1])


@dataclass(frozen=True, slots=True)
class Placed(Frames):
    """Bodies that move, placed for n configurations, in robroot.

    ``slot`` (b,): where each body stands below, of those that move or of those that stand still;
    ``centre`` (m, 3, n), ``axes`` (m, 3, 3, n) and ``extent`` (m, 3, n) of the boxes of those that
    move: centre, axes as columns, half size along the axes of robroot [m].
    """

    slot: np.ndarray
    centre: FloatArray
    axes: FloatArray
    extent: FloatArray


@dataclass(frozen=True, slots=True)
class Near(Table):
    """Pairs that may be near, in order of pair, then configuration.

    ``pair`` (k,), ``row`` (k,), ``bound`` (k,) [m] lower bound of the distance of the surfaces
    (0 where they may touch).
    """

    pair: np.ndarray
    row: np.ndarray
    bound: FloatArray


class Culler:
    """Bounds of distances between the bodies of a scene, for a fixed table of pairs.

    Args:
        shapes: shapes (b) in the frames of their links; bodies of the world in robroot.
        links: (b,) link that carries each; 0 for what stands still in robroot.
        first, second: (p,) bodies of each pair.
    """

    def __init__(
        self, shapes: list[Shape], links: np.ndarray, first: np.ndarray, second: np.ndarray
    ) -> None:
        self.shapes, self.links, self.first, self.second = shapes, links, first, second
        self._centre = np.stack([shape.centre for shape in shapes])
        self._axes = np.stack([shape.axes for shape in shapes])
        self._half = np.stack([shape.half for shape in shapes])
        self._is_still = links == 0
        self._slot = np.where(self._is_still, np.cumsum(self._is_still), np.cumsum(~self._is_still))
        self._slot -= 1
        # of each body its centre, then its axes
        vectors = np.concatenate([self._centre[:, None], np.swapaxes(self._axes, 1, 2)], axis=1)
        self._carried = [
            (link, self._slot[links == link], vectors[links == link].reshape(-1, 3))
            for link in np.unique(links[links > 0]).tolist()
        ]
        still = np.flatnonzero(self._is_still)
        self._still_centre = self._centre[still, :, None]
        self._still_axes = self._axes[still, :, :, None]
        self._still_extent = _extent(self._still_axes, self._half[still])

    def place(self, frames: Frames) -> Placed:
        """Return the bodies where links stand."""
        n, count = len(frames), int((~self._is_still).sum())
        centre = np.empty((count, 3, n))
        axes = np.empty((count, 3, 3, n))
        for link, slot, vectors in self._carried:
            R, p = frames.link[link, :, :3], frames.link[link, :, 3]
            # (3 rows of R, 4 vectors of each body, n): one product for each row of the rotation
            turned = np.matmul(vectors, R).reshape(3, len(slot), 4, n).transpose(1, 0, 2, 3)
            centre[slot] = turned[:, :, 0] + p
            axes[slot] = turned[:, :, 1:]
        extent = _extent(axes, self._half[~self._is_still])
        return Placed(frames.q, frames.link, self._slot, centre, axes, extent)

    def bodies_near(
        self, placed: Placed, threshold: FloatArray, wanted: BoolArray | None = None
    ) -> Near:
        """Return pairs whose boxes are nearer than the threshold.

        Args:
            placed: the bodies.
            threshold: (p, n) or (p, 1) [m], not negative.
            wanted: (p, n) or (p, 1), pairs to look at; None: all.
        """
        pair, row = self._axis_aligned(placed, threshold, wanted)
        R_a_b, p_a_b = self._relative(placed, pair, row)
        half_a = taken(self._half, self.first[pair]).T
        half_b = taken(self._half, self.second[pair]).T
        gap = box_gap(R_a_b, p_a_b, half_a, half_b)
        limit = threshold[pair, row] if threshold.shape[1] > 1 else threshold[pair, 0]
        kept = np.flatnonzero(gap <= limit + SLACK)
        return Near(pair[kept], row[kept], np.maximum(gap[kept], 0.0))

    def entries_near(self, near: Near, R: FloatArray, p: FloatArray, limit: FloatArray) -> Near:
        """Return entries with their bounds, from the boxes of the two bodies alone.

        Args:
            near: entries (k).
            R: (k, 3, 3) rotation from ``relative``.
            p: (k, 3) origin from ``relative`` [m].
            limit: (k,) [m]; entries farther apart than this get an infinite bound.
        """
        a, b = self.first[near.pair], self.second[near.pair]
        one, two = ((taken(self._centre, body), taken(self._axes, body)) for body in (a, b))
        R_boxes, centre = seen_from(one, two, R, p)
        gap = box_gap(
            np.ascontiguousarray(np.moveaxis(R_boxes, 0, -1)),
            np.ascontiguousarray(centre.T),
            taken(self._half, a).T,
            taken(self._half, b).T,
        )
        bound = np.where(gap <= limit + SLACK, np.maximum(gap, 0.0), np.inf)
        return Near(near.pair, near.row, bound)

    def axis_aligned_bound(self, placed: Placed) -> FloatArray:
        """Return lower bounds (p, n) [m] of the distances, from axis-aligned boxes only."""
        bound = np.empty((len(self.first), len(placed)))
        for part, gap in self._gaps(placed):
            np.maximum(gap, 0.0, out=gap)
            bound[:, part] = np.sqrt(np.einsum("kin,kin->kn", gap, gap))
        return bound

    def _gaps(self, placed: Placed) -> Iterator[tuple[slice, FloatArray]]:
        """Yield parts of the configurations, and the gaps (p, 3, m) along the axes of robroot."""
        size = max(1, _TOGETHER // max(1, len(self.first)))
        for part in (slice(low, low + size) for low in range(0, len(placed), size)):
            moving = placed.centre[:, :, part], placed.extent[:, :, part]
            centre, extent = np.empty((2, len(self._slot), 3, moving[0].shape[-1]))
            centre[self._is_still], extent[self._is_still] = self._still_centre, self._still_extent
            centre[~self._is_still], extent[~self._is_still] = moving
            gap = taken(centre, self.second)
            gap -= taken(centre, self.first)
            np.abs(gap, out=gap)
            gap -= taken(extent, self.second)
            gap -= taken(extent, self.first)
            yield part, gap

    def _axis_aligned(
        self, placed: Placed, threshold: FloatArray, wanted: BoolArray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        near = np.empty((len(self.first), len(placed)), dtype=bool)
        limit = np.broadcast_to(threshold + SLACK, near.shape)
        for part, gap in self._gaps(placed):
            np.less_equal(gap.max(axis=1), limit[:, part], out=near[:, part])
        if wanted is not None:
            near &= wanted
        pair, row = np.nonzero(near)
        return pair, row

    def _relative(
        self, placed: Placed, pair: np.ndarray, row: np.ndarray
    ) -> tuple[FloatArray, FloatArray]:
        """Return axes (3, 3, k) and centre (3, k) of the second body's box in the first's."""
        A, centre_a = self._oriented(placed, self.first[pair], row)
        B, centre_b = self._oriented(placed, self.second[pair], row)
        step = centre_b - centre_a
        R = A[0][:, None] * B[0] + A[1][:, None] * B[1] + A[2][:, None] * B[2]
        return R, A[0] * step[0] + A[1] * step[1] + A[2] * step[2]

    def _oriented(
        self, placed: Placed, body: np.ndarray, row: np.ndarray
    ) -> tuple[FloatArray, FloatArray]:
        """Return axes (3, 3, k) and centre (3, k) of the boxes of bodies (k,) in rows (k,)."""
        axes, centre = np.empty((3, 3, len(body))), np.empty((3, len(body)))
        slot, is_still = self._slot[body], self._is_still[body]
        some = np.flatnonzero(is_still)
        axes[:, :, some] = self._still_axes[slot[some], :, :, 0].transpose(1, 2, 0)
        centre[:, some] = self._still_centre[slot[some], :, 0].T
        some = np.flatnonzero(~is_still)
        axes[:, :, some] = placed.axes[slot[some], :, :, row[some]].transpose(1, 2, 0)
        centre[:, some] = placed.centre[slot[some], :, row[some]].T
        return axes, centre

    def relative(self, frames: Frames, near: Near) -> tuple[FloatArray, FloatArray]:
        """Return rotation (k, 3, 3) and origin (k, 3) of the second body's frame in the first's."""
        A = frames.link[self.links[self.first[near.pair]], :, :, near.row]
        B = frames.link[self.links[self.second[near.pair]], :, :, near.row]
        R_a = np.swapaxes(A[:, :, :3], 1, 2)
        return R_a @ B[:, :, :3], np.einsum("kij,kj->ki", R_a, B[:, :, 3] - A[:, :, 3])


def _extent(axes: FloatArray, half: FloatArray) -> FloatArray:
    """Return half sizes (m, 3, n) along the axes of robroot of boxes with axes (m, 3, 3, n)."""
    extent: FloatArray = np.abs(axes[:, :, 0]) * half[:, 0, None, None]
    extent += np.abs(axes[:, :, 1]) * half[:, 1, None, None]
    extent += np.abs(axes[:, :, 2]) * half[:, 2, None, None]
    return extent
