"""A program as it is run, with all that it is judged by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray
from postproc.cell import Cell
from postproc.kinematics import Corners, Kinematics
from postproc.krl import KrlModule
from postproc.paths import Paths
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Cuts:
    """Which motions cut, and what the CAM file asks for between them.

    ``number`` (m,): of the cut that a motion belongs to, 0 for lines and arcs, -1 for none;
    ``asked``: places in ``trace.events`` of what the file asks for; ``led`` (m,): motions that end
    where the file itself leads into a cut. Both None without a file: then nobody knows.
    """

    number: AnyIntArray
    asked: frozenset[int] | None = None
    led: BoolArray | None = None

    @classmethod
    def of(
        cls,
        paths: Paths,
        number: AnyIntArray,
        asked: frozenset[int] | None = None,
        led: BoolArray | None = None,
    ) -> Cuts:
        """Return the cuts; a joint motion that stays where it is is part of the cut around it."""
        rows, m = np.arange(len(paths)), len(paths)
        moves = ~paths.stands
        before = np.maximum.accumulate(np.where(moves, rows, -1))
        behind = np.minimum.accumulate(np.where(moves, rows, m)[::-1])[::-1]
        known = np.append(number, -1)
        inside = ~moves & (known[before] == known[behind])
        return cls(np.where(inside, known[before], number), asked, led)

    @property
    def inside(self) -> BoolArray:
        """(m + 1,) whether the place before a motion is between two motions of one cut."""
        same = (self.number[1:] == self.number[:-1]) & (self.number[1:] >= 0)
        return np.r_[False, same, False] if len(self.number) else np.zeros(1, dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class Run:
    """A program as it is run in its cell.

    ``is_cut`` (m,): motions that cut, as the CAM file or else their speed tells; ``cuts``: the same
    with what the file asks for; ``corners``: approximated ones, at the ends of motions ``bent``
    (c,); ``slack`` [m]: how far commanded points may be off the real ones; ``may_stand``: the user
    knows that cuts at a standstill of the spindle are meant; ``needs_start``: there is something to
    drill or mill, and the CAM file starts no spindle.
    """

    paths: Paths
    cell: Cell
    kinematics: Kinematics
    modules: Sequence[KrlModule]
    is_cut: BoolArray
    cuts: Cuts
    bent: AnyIntArray
    corners: Corners
    slack: float
    may_stand: bool
    needs_start: bool

    @property
    def has_file(self) -> bool:
        """Whether a CAM file says what cuts."""
        return self.cuts.asked is not None
