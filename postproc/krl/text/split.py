"""Where a long program is cut into sub-programs.

A part ends where the robot stands still anyway and is out of the material: before a re-entry, at
the end of an operation, before a rapid; in the middle of a cut only where nothing else is in reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from postproc.arrays import IntArray
from postproc.errors import EmitError, SourceRef
from postproc.records import dataclass

NO_BORDER = -1
"""Quality of a place at which no file may end."""
SHARE = 0.5
"""A part is at least this share of the largest allowed one, unless an operation ends before."""


@dataclass(frozen=True, slots=True)
class Part:
    """Moves ``first`` to ``stop - 1`` of a program."""

    first: int
    stop: int

    def __len__(self) -> int:
        """Return the number of moves."""
        return self.stop - self.first


def split(
    quality: Sequence[int] | IntArray,
    max_points: int,
    forced: Sequence[int] = (),
    source: SourceRef | None = None,
) -> tuple[Part, ...]:
    """Return the parts of a program, which cover all moves, of at most so many points each.

    ``quality`` (m,): how good a border before move i is: ``NO_BORDER``, 0 = only if there is no
    other (in the middle of a cut), higher is better; of equally good ones the last is taken. Before
    moves ``forced`` there must be a border. ``source``: where the largest number is given. EMT302
    if it is less than 2, or than moves without a border.
    """
    if max_points < 2:
        text = f"max_points_per_file is {max_points}, expected at least 2"
        raise EmitError("EMT302", text, source)
    marks = np.asarray(quality, dtype=np.int64)
    stops = sorted({0, len(marks), *(i for i in forced if 0 < i < len(marks))})
    parts: list[Part] = []
    for first, stop in pairwise(stops):
        parts += _pieces(marks, first, stop, max_points, source)
    return tuple(parts)


def _pieces(
    marks: np.ndarray, first: int, stop: int, max_points: int, source: SourceRef | None
) -> list[Part]:
    parts = []
    while stop - first > max_points:
        high = first + max_points
        for low in (first + max(1, int(SHARE * max_points)), first + 1):
            window = marks[low : high + 1]
            if window.max() > NO_BORDER:
                break
        else:
            more = np.append(marks[high + 1 : stop], 0) > NO_BORDER
            needed = max_points + 1 + int(more.argmax())
            text = (
                f"max_points_per_file is {max_points}, but the {needed} "
                "motions of a hole, with what is called there, stand in one file"
            )
            raise EmitError("EMT302", text, source)
        border = low + int(np.flatnonzero(window == window.max())[-1])
        parts.append(Part(first, border))
        first = border
    parts.append(Part(first, stop))
    return parts


def suffixes(count: int) -> tuple[str, ...]:
    """Return the endings of the names of ``count`` parts: ``_001``, ``_002`` ..."""
    width = max(3, len(str(count)))
    return tuple(f"_{number:0{width}d}" for number in range(1, count + 1))
