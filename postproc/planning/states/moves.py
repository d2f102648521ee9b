"""Moves of the controller in columns, before they are put in order."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, Table
from postproc.model import Arcs, MoveKind, MoveRole
from postproc.records import dataclass


@dataclass(slots=True)
class Chosen:
    """The pose chosen for every tag.

    ``attitude`` (n, 3): spin, lead and side tilt [rad]; ``good`` (n,): the tag can be run;
    ``entry`` (n,): it is entered anew, by a joint move, rather than from the tag before. Columns of
    tags that are not good hold no meaning.
    """

    attitude: FloatArray
    branch: IndexArray
    q: FloatArray
    good: BoolArray
    entry: BoolArray

    def at(self, tags: IndexArray) -> Chosen:
        """Return the poses of tags (k,) only."""
        return Chosen(
            self.attitude[tags], self.branch[tags], self.q[tags], self.good[tags], self.entry[tags]
        )

    @property
    def spin(self) -> FloatArray:
        """(n,) spin about the CAM tool axis [rad]."""
        return self.attitude[:, 0]


@dataclass(slots=True)
class Moves(Table):
    """One move a row; ``order`` sorts the moves of one tag. Other columns as in ``Plan``.

    ``speed`` is NaN for PTP, and for a cut without any feed; ``arcs``: sweep 0 means straight.
    """

    tag: IndexArray
    order: IndexArray
    kind: IndexArray
    role: IndexArray
    T_base_tcp: FloatArray
    q: FloatArray
    external: FloatArray
    speed: FloatArray
    dwell: FloatArray
    aux: FloatArray
    arcs: Arcs


def moves(
    tag: IndexArray,
    order: int | IndexArray,
    kind: MoveKind | IndexArray,
    role: MoveRole | IndexArray,
    there: tuple[FloatArray, FloatArray, FloatArray],
    speed: float | FloatArray = float("nan"),
    dwell: float | FloatArray = 0.0,
    arcs: Arcs | None = None,
) -> Moves:
    """Return moves (m,) with single values repeated; without ``arcs`` all are straight.

    ``there``: where they end, T_base_tcp (m, 4, 4), joints (m, 6), external axes (m, k).
    """
    m = len(tag)
    nowhere = np.full((m, 3), np.nan)
    return Moves(
        np.asarray(tag, dtype=np.int64),
        np.broadcast_to(np.asarray(order, dtype=np.int64), (m,)).copy(),
        np.broadcast_to(np.asarray(kind, dtype=np.int64), (m,)).copy(),
        np.broadcast_to(np.asarray(role, dtype=np.int64), (m,)).copy(),
        *there,
        np.broadcast_to(np.asarray(speed, dtype=np.float64), (m,)).copy(),
        np.broadcast_to(np.asarray(dwell, dtype=np.float64), (m,)).copy(),
        nowhere,
        arcs or Arcs(nowhere, nowhere, np.full(m, np.nan), np.zeros(m)),
    )


def in_order(parts: list[Moves]) -> Moves:
    """Return all moves, by tag and order."""
    table = Moves.concat(parts)
    return table.rows(np.lexsort((table.order, table.tag)))
