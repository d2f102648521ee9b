"""Do the bodies collide in given configurations, and which pair?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.collision.engine import CHUNK, Candidates, Engine
from postproc.records import dataclass

NO_PAIR = -1


@dataclass(frozen=True, slots=True)
class Hits:
    """Answer for n configurations.

    Args:
        hit: (n,) whether any pair collides.
        pair: (n,) index into ``pairs`` of the first pair that does, by the order of ``pairs``;
            -1 where none does.
        pairs: names of the tested pairs.
    """

    hit: BoolArray
    pair: IndexArray
    pairs: tuple[tuple[str, str], ...]

    def name(self, row: int) -> str:
        """Return ``A and B`` of the pair that collides in a row, empty if none does."""
        return " and ".join(self.pairs[self.pair[row]]) if self.hit[row] else ""


@dataclass(slots=True)
class Tally:
    """How much work a check was: pairs, those left by culling, exact tests."""

    pairs: int = 0
    exact: int = 0


def check(
    engine: Engine,
    q: FloatArray,
    contact: BoolArray | None,
    tally: Tally | None = None,
    only: BoolArray | None = None,
    likely: IndexArray | None = None,
) -> Hits:
    """Return for each configuration (n, 6) [rad] whether it collides.

    Args:
        engine: the scene.
        q: (n, 6) [rad].
        contact: (n,) where cutting solids may touch the workpiece; None: nowhere.
        tally: counts the work.
        only: (p,) the pairs to look at; None: all.
        likely: (n,) the pair that each probably collides by, -1 for none: where it does the others
            are not looked at, and it is the one that is told.
    """
    pair = np.full(len(q), NO_PAIR, dtype=np.int64)
    wanted = engine.wanted(contact) if only is None else engine.wanted(contact) & only[:, None]
    wanted = np.broadcast_to(wanted, (len(wanted), len(q)))
    if likely is not None:
        wanted = _without_likely(engine, q, likely, wanted, pair)
    todo = np.flatnonzero(pair == NO_PAIR)
    margin = engine.table.margin[:, None]
    for part in chunks(len(todo)):
        rows = todo[part]
        found = engine.candidates(engine.place(q[rows]), margin, wanted[:, rows])
        entries = first_hits(engine, found)
        pair[rows[found.near.row[entries]]] = found.near.pair[entries]
        if tally is not None:
            tally.pairs += len(engine.table) * len(rows)
            tally.exact += len(found)
    return Hits(pair != NO_PAIR, pair, engine.names)


def _without_likely(
    engine: Engine, q: FloatArray, likely: IndexArray, wanted: BoolArray, pair: IndexArray
) -> BoolArray:
    """Return wanted pairs (p, n) without the likely (n,); where these collide ``pair`` is set."""
    known = np.flatnonzero(likely != NO_PAIR)
    known = known[wanted[likely[known], known]]
    for part in chunks(len(known)):
        rows = known[part]
        met = rows[engine.met(q[rows], likely[rows])]
        pair[met] = likely[met]
    left = wanted.copy()
    left[likely[known], known] = False
    return left


def chunks(count: int, size: int = CHUNK) -> Iterator[slice]:
    """Yield slices of at most ``size`` that cover ``count`` rows."""
    for start in range(0, count, size):
        yield slice(start, min(count, start + size))


def first_hits(engine: Engine, found: Candidates) -> np.ndarray:
    """Return the first entry of each row that collides, ordered by row."""
    margin = engine.table.margin[found.near.pair]
    every = np.arange(len(found))
    distance = engine.distances(found, every, margin, margin, margin, found.near.row)
    return np.flatnonzero(distance <= margin)
