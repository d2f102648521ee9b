"""The finest stage of culling: boxes of the pieces of two surfaces instead of whole bodies.

A curved panel fills little of its own box; cut into pieces, each with a box of its own, it can be
proven apart from a tool a few millimetres in front of it without an exact test.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, members, taken
from postproc.collision.boxes import box_gap, seen_from
from postproc.collision.cull import SLACK, Near
from postproc.collision.shape import Shape


class PieceBounds:
    """Lower bounds of the distance of two surfaces from the boxes of their pieces.

    Args:
        shapes: shapes (b) of the bodies.
        first, second: (p,) bodies of each pair.
    """

    def __init__(self, shapes: list[Shape], first: np.ndarray, second: np.ndarray) -> None:
        self._first, self._second = first, second
        self._count = np.array([len(shape.pieces) for shape in shapes])
        self._start = np.cumsum(self._count) - self._count
        self._centre = np.vstack([shape.pieces.centre for shape in shapes])
        self._axes = np.vstack([shape.pieces.axes for shape in shapes])
        self._half = np.vstack([shape.pieces.half for shape in shapes])
        self._low = np.vstack([shape.low for shape in shapes])
        self._high = np.vstack([shape.high for shape in shapes])
        self._longest = np.array([int(np.argmax(shape.half)) for shape in shapes])
        along = np.repeat(self._longest, self._count)[:, None]
        self._lowest = np.take_along_axis(self._low, along, axis=1)[:, 0]
        self._highest = np.take_along_axis(self._high, along, axis=1)[:, 0]
        self._whole = (
            np.stack([shape.centre for shape in shapes]),
            np.stack([shape.axes for shape in shapes]),
            np.stack([shape.half for shape in shapes]),
        )

    def refine(
        self, near: Near, R_a_b: FloatArray, p_a_b: FloatArray, threshold: FloatArray
    ) -> tuple[np.ndarray, FloatArray]:
        """Return which entries may still be nearer than their thresholds, and their bounds.

        Args:
            near: pairs to look at (k).
            R_a_b: (k, 3, 3) axes of the second body's frame in the first's.
            p_a_b: (k, 3) [m] its origin.
            threshold: (k,) [m].

        Returns:
            Indices (h,) in growing order, and lower bounds (h,) [m], 0 where surfaces may touch.
        """
        a, b = self._first[near.pair], self._second[near.pair]
        whole = (self._count[a] == 1) & (self._count[b] == 1)
        split = np.flatnonzero(~whole)
        bound = near.bound.copy()
        bound[split] = np.inf
        for rows in np.array_split(split, max(1, -(-len(split) // 4096))):
            self._refine(rows, a, b, R_a_b, p_a_b, threshold, bound)
        kept = np.flatnonzero(bound <= threshold + SLACK)
        return kept, np.maximum(bound[kept], near.bound[kept])

    def _refine(
        self,
        rows: np.ndarray,
        a: np.ndarray,
        b: np.ndarray,
        R_a_b: FloatArray,
        p_a_b: FloatArray,
        threshold: FloatArray,
        bound: FloatArray,
    ) -> None:
        """Lower ``bound`` of the given rows to the least of their pairs of pieces, in place."""
        R, p = taken(R_a_b, rows), taken(p_a_b, rows)
        entry, piece_b = self._pieces_near(
            b[rows], self._box(a[rows]), _inverse(R, p), threshold[rows]
        )
        piece_a = np.zeros(len(entry), dtype=np.int64)
        if (self._count[a[rows]] > 1).any():
            other = self._box(b[rows][entry], piece_b)
            frame = taken(R, entry), taken(p, entry)
            again, piece_a = self._pieces_near(a[rows][entry], other, frame, threshold[rows][entry])
            entry, piece_b = entry[again], piece_b[again]
        if not len(entry):
            return
        one, two = self._box(a[rows][entry], piece_a), self._box(b[rows][entry], piece_b)
        R_pieces, p_pieces = seen_from(one[:2], two[:2], taken(R, entry), taken(p, entry))
        gap = box_gap(np.moveaxis(R_pieces, 0, -1), p_pieces.T, one[2].T, two[2].T)
        np.minimum.at(bound, rows[entry], np.maximum(gap, 0.0))

    def _box(
        self, body: np.ndarray, piece: np.ndarray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return centre (k, 3), axes (k, 3, 3), half (k, 3) of bodies or of their pieces."""
        index = body if piece is None else self._start[body] + piece
        boxes = self._whole if piece is None else (self._centre, self._axes, self._half)
        return taken(boxes[0], index), taken(boxes[1], index), taken(boxes[2], index)

    def _pieces_near(
        self,
        body: np.ndarray,
        box: tuple[FloatArray, FloatArray, FloatArray],
        frame: tuple[FloatArray, FloatArray],
        threshold: FloatArray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return (row, piece) of bodies (k,) whose pieces may be near boxes (k) of other frames.

        ``frame``: rotation and origin of each box's frame in the frame of the body.
        """
        centre_shape, axes, _ = self._box(body)
        back = np.swapaxes(axes, 1, 2)
        centre = np.einsum("kij,kj->ki", frame[0], box[0]) + frame[1] - centre_shape
        centre = np.einsum("kij,kj->ki", back, centre)
        extent = np.einsum("kij,kj->ki", np.abs(back @ frame[0] @ box[1]), box[2])
        low, high = centre - extent, centre + extent
        # the axis along which the body is longest rules out most
        every, longest = np.arange(len(body)), self._longest[body]
        limit = threshold + SLACK
        lowest, highest = low[every, longest] - limit, high[every, longest] + limit
        found: list[tuple[np.ndarray, np.ndarray]] = [(every[:0], every[:0])]
        for one in members(body, len(self._start)).tolist():
            own, first = np.flatnonzero(body == one), int(self._start[one])
            pieces = slice(first, first + int(self._count[one]))
            near = self._lowest[pieces] <= highest[own][:, None]
            near &= self._highest[pieces] >= lowest[own][:, None]
            row, piece = np.nonzero(near)
            row, piece = own[row], piece + first
            apart = np.maximum(
                taken(self._low, piece) - taken(high, row),
                taken(low, row) - taken(self._high, piece),
            )
            np.maximum(apart, 0.0, out=apart)
            close = np.einsum("ki,ki->k", apart, apart) <= limit[row] ** 2
            found.append((row[close], piece[close] - first))
        row, piece = (np.concatenate(column) for column in zip(*found, strict=True))
        return row, piece


def _inverse(R: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    back = np.swapaxes(R, 1, 2)
    return back, -np.einsum("kij,kj->ki", back, p)
