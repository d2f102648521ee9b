"""A long search lap by lap, so that memory is that of a lap.

A lap is searched with some tags of the next, from the pose in which the one before ends, and one
pose a tag stays of it. So another family of poses is taken on where that pays within a lap: what
it costs to change, some units, is little beside a lap of that many tags. Cuts are searched whole:
what joins their tags reaches far.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import IndexArray
from postproc.ladder import NONE
from postproc.planning.checks import Checker
from postproc.planning.search.between import Interpolation
from postproc.planning.search.constants import AHEAD, LAP
from postproc.planning.search.edges import Edges
from postproc.planning.search.pose_search import CHECKED, PoseSearch
from postproc.planning.search.rungs import SearchOptions, Window, yardstick


def searched(
    checker: Checker, tags: IndexArray, options: SearchOptions | None, between: Interpolation
) -> PoseSearch:
    """Return the search over key tags (n,), of a long job the one over what its laps chose.

    Arguments as of ``PoseSearch.of``.
    """
    options = options or SearchOptions()
    by_laps = _is_long(checker, tags, options, between)
    whole = _lapped(checker, tags, options, between) if by_laps else None
    return whole or PoseSearch.of(checker, tags, options, between)


def _is_long(
    checker: Checker, tags: IndexArray, options: SearchOptions, between: Interpolation
) -> bool:
    problem = checker.problem
    is_plain = options.least is None and options.stretch is None and not options.parted
    is_plain &= len(problem.tilts) == 1 and problem.cell.optimize.loss_bound is None
    return len(tags) > LAP + AHEAD and is_plain and not between.is_cut.any()


def _lapped(
    checker: Checker, tags: IndexArray, options: SearchOptions, between: Interpolation
) -> PoseSearch | None:
    """Return the search over the poses that the laps chose; None where a tag has none."""
    n = len(checker.problem)
    own = Window(
        spins=np.zeros((n, 1)),
        branch=np.zeros(n, dtype=np.int64),
        q=np.zeros((n, 6)),
        tilt=np.zeros(n, dtype=np.int64),
        best=np.full(n, np.nan),
    )
    edges = Edges.none(np.full(n, np.nan))
    for low in range(0, len(tags), LAP):
        if not _took_lap(checker, tags, options, between, low, own, edges):
            return None
    whole = PoseSearch.of(checker, tags, replace(options, window=own), between)
    if len(whole.states.q) != len(tags):
        return None
    whole.asked[:] |= CHECKED
    own_edges = Edges(*(getattr(edges, name)[tags] for name in Edges.__slots__))
    return replace(whole, edges=own_edges)


def _begin_at(lap: PoseSearch, own: Window, tag: int) -> None:
    """Leave of the first tag of a lap, ``tag``, the state alone in which the last one ended."""
    count = int(lap.states.offsets[1])
    off = np.abs(lap.states.q[:count] - own.q[tag]).max(axis=1)
    off[lap.states.branch[:count] != own.branch[tag]] = np.inf
    out = np.arange(count) != int(off.argmin())
    lap.ladder.cost[:count][out] = np.inf


def _took_lap(
    checker: Checker,
    tags: IndexArray,
    options: SearchOptions,
    between: Interpolation,
    low: int,
    own: Window,
    edges: Edges,
) -> bool:
    """Note in place what the lap from tag ``low`` on chose; return whether each tag has a pose."""
    first, high = max(low - 1, 0), min(low + LAP, len(tags))
    part = tags[first : high + AHEAD]
    lap = PoseSearch.of(checker, part, options, between)
    if first < low:
        _begin_at(lap, own, int(part[0]))
    path = lap.found.path
    if (path == NONE).any():
        return False
    done = slice(low - first, high - first)
    at, kept = part[done], path[done]
    own.spins[at, 0], own.branch[at] = lap.states.spin_of(kept), lap.states.branch[kept]
    own.q[at] = lap.states.q[kept]
    if options.window is None:
        own.best[at] = yardstick(checker.problem, lap.states, lap.edges)[done]
    else:
        own.best[at] = options.window.best[at]
    for name in Edges.__slots__:
        getattr(edges, name)[at] = getattr(lap.edges, name)[done]
    return True
