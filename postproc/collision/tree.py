"""Which pieces of two solids may be near each other: trees of boxes, all entries at once.

Arrays of one entry each are the pairs of solids in their places.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered, taken
from postproc.collision.boxes import outside
from postproc.collision.pieces import CHILDREN, FEW_VERTICES, Pieces
from postproc.records import dataclass

SLACK = 1e-9
"""Rounding of positions [m]: nothing nearer than this counts as proven apart."""


@dataclass(frozen=True, slots=True)
class PieceTree:
    """Boxes (m) of pieces, of 16 of them each, and so on up to all of a solid, in its frame.

    ``centre``, ``half`` (m, 3) [m]; ``count`` (m,) children, which stand from ``child`` (m,) on; 0:
    it is the box of piece number ``piece`` (m,) of all. ``root``, ``size`` (b,): the box of each
    solid, and how many pieces are in it. ``corners`` (m,): where a convex piece of few vertices has
    them in ``vertices`` (3, v, s) [m], the last one again and again; else -1.
    """

    centre: FloatArray
    half: FloatArray
    child: IndexArray
    count: IndexArray
    piece: IndexArray
    root: IndexArray
    size: IndexArray
    corners: IndexArray
    vertices: FloatArray

    @staticmethod
    def of(solids: list[Pieces]) -> PieceTree:
        """Return the tree of all solids."""
        boxes = [box for solid in solids for box in solid.boxes]
        low, high = (np.concatenate([box[end] for box in boxes]) for end in (0, 1))
        child, count, piece = np.zeros((3, len(low)), dtype=np.int64)
        corners, vertices = np.full(len(low), -1), [np.zeros((0, 3, FEW_VERTICES))]
        root: list[int] = []
        begin, pieces, known = 0, 0, 0
        for solid in solids:
            below = len(solid.boxes[0][0])
            piece[begin : begin + below] = np.arange(pieces, pieces + below)
            place, few = solid.few
            corners[begin + place] = np.arange(known, known + len(place))
            vertices.append(few)
            pieces, known = pieces + below, known + len(place)
            for box, _ in solid.boxes[1:]:
                here, step = begin + below + np.arange(len(box)), CHILDREN * np.arange(len(box))
                child[here], count[here] = begin + step, np.minimum(below - step, CHILDREN)
                begin, below = begin + below, len(box)
            root.append(begin)
            begin += 1
        size = np.array([len(solid.start) for solid in solids])
        places = 0.5 * (low + high), 0.5 * (high - low), child, count, piece
        of_pieces = np.ascontiguousarray(np.moveaxis(np.concatenate(vertices), 0, -1))
        return PieceTree(*places, np.array(root), size, corners, of_pieces)

    def near(
        self,
        first: IndexArray,
        second: IndexArray,
        R: FloatArray,
        p: FloatArray,
        enough: FloatArray,
    ) -> tuple[IndexArray, IndexArray, IndexArray, FloatArray]:
        """Return pairs of pieces (m,) whose boxes are as near as is enough: entry, pieces, gap [m].

        The pieces of the body that has fewer are boxed along the axes of the other one, whose tree
        is searched for them; what is found must be near along their own axes too. Where any
        distance is wanted, what two boxes are apart at most is enough.

        Args:
            first: (k,) bodies.
            second: (k,) bodies.
            R: (k, 3, 3) axes of the second body's frame in the first's.
            p: (k, 3) [m] its origin.
            enough: (k,) [m].
        """
        swapped = self.size[first] > self.size[second]
        guest, host = np.where(swapped, second, first), np.where(swapped, first, second)
        back = np.swapaxes(R, 1, 2)
        turn = np.where(swapped[:, None, None], R, back)
        shift = np.where(swapped[:, None], p, -np.einsum("kij,kj->ki", back, p))
        limit, root = enough + SLACK, self.root[host]
        entry, guests, centre, half = self._guests(self.root[guest], root, turn, shift, limit)
        row, node, gap = self._hosts(entry, root, centre, half, limit, np.isinf(enough))
        entry, guests = entry[row], guests[row]
        back = np.swapaxes(taken(turn, entry), 1, 2)
        away = np.einsum("kij,kj->ki", back, taken(self.centre, node) - taken(shift, entry))
        size = np.einsum("kij,kj->ki", np.abs(back), taken(self.half, node))
        away = np.abs(away - taken(self.centre, guests))
        gap = np.maximum(gap, outside((away - size - taken(self.half, guests)).T))
        kept = np.flatnonzero(gap <= limit[entry])
        entry, one, two = entry[kept], self.piece[guests[kept]], self.piece[node[kept]]
        is_swapped = swapped[entry]
        return entry, np.where(is_swapped, two, one), np.where(is_swapped, one, two), gap[kept]

    def _guests(
        self,
        node: IndexArray,
        root: IndexArray,
        turn: FloatArray,
        shift: FloatArray,
        limit: FloatArray,
    ) -> tuple[IndexArray, IndexArray, FloatArray, FloatArray]:
        """Return pieces near the box of the other body: entry (g,), box, centre, half (g, 3) [m].

        Args:
            node: (k,) boxes of the bodies.
            root: (k,) box of the other body.
            turn: (k, 3, 3) axes of the body's frame in the other's.
            shift: (k, 3) [m] its origin.
            limit: (k,) [m].
        """
        entry, found = np.arange(len(node)), []
        while True:
            R = taken(turn, entry)
            centre = np.einsum("kij,kj->ki", R, taken(self.centre, node)) + taken(shift, entry)
            half = np.einsum("kij,kj->ki", np.abs(R), taken(self.half, node))
            kept = self._reach(centre, half, root[entry], limit[entry])
            leaf = kept & (self.count[node] == 0)
            found.append((entry[leaf], node[leaf], centre[leaf], half[leaf]))
            open_ = np.flatnonzero(kept & ~leaf)
            if not len(open_):
                break
            owner, step = numbered(self.count[node[open_]])
            entry, node = entry[open_[owner]], self.child[node[open_[owner]]] + step
        entry, node, centre, half = (np.concatenate(part) for part in zip(*found, strict=True))
        few = np.flatnonzero(self.corners[node] >= 0)
        points = self.vertices.take(self.corners[node[few]], axis=2)
        R, p = taken(turn, entry[few]), taken(shift, entry[few])
        for axis in range(3):  # vertices reach less far than the box around them
            along = np.einsum("jvm,mj->vm", points, R[:, axis])
            low, high = along.min(axis=0), along.max(axis=0)
            centre[few, axis], half[few, axis] = 0.5 * (low + high) + p[:, axis], 0.5 * (high - low)
        near = np.flatnonzero(self._reach(centre, half, root[entry], limit[entry]))
        return entry[near], node[near], taken(centre, near), taken(half, near)

    def _reach(
        self, centre: FloatArray, half: FloatArray, node: IndexArray, limit: FloatArray
    ) -> BoolArray:
        """Return which boxes (m, 3) are within limits (m,) [m] of other boxes, node (m,)."""
        away = np.abs(centre - taken(self.centre, node)) - half - taken(self.half, node)
        return np.asarray(outside(away.T) <= limit)

    def _hosts(
        self,
        entry: IndexArray,
        root: IndexArray,
        centre: FloatArray,
        half: FloatArray,
        limit: FloatArray,
        is_any: BoolArray,
    ) -> tuple[IndexArray, IndexArray, FloatArray]:
        """Return pieces near boxes (g,) in the frame of theirs: row of the box, piece's box, gap.

        Args:
            entry: (g,) of each box.
            root: (k,) box of the body that is searched.
            centre: (g, 3) [m] of the boxes.
            half: (g, 3) [m].
            limit: (k,) [m]; lowered in place where any distance is wanted.
            is_any: (k,) where that is.
        """
        row, node, found = np.arange(len(entry)), root[entry], []
        while True:
            away = np.abs(taken(centre, row) - taken(self.centre, node))
            size = taken(half, row) + taken(self.half, node)
            some = np.flatnonzero(is_any[entry[row]])
            if len(some):
                farthest = np.linalg.norm((away + size)[some], axis=1)
                np.minimum.at(limit, entry[row[some]], farthest + SLACK)
            gap = outside((away - size).T)
            kept = gap <= limit[entry[row]]
            leaf = kept & (self.count[node] == 0)
            found.append((row[leaf], node[leaf], gap[leaf]))
            open_ = np.flatnonzero(kept & ~leaf)
            if not len(open_):
                break
            owner, step = numbered(self.count[node[open_]])
            row, node = row[open_[owner]], self.child[node[open_[owner]]] + step
        row, node, gap = (np.concatenate(part) for part in zip(*found, strict=True))
        return row, node, gap
