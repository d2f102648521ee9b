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
    return len(checker.problem) == len(tags) > LAP + AHEAD and is_plain and not between.is_cut.any()


def _lapped(
    checker: Checker, tags: IndexArray, options: SearchOptions, between: Interpolation
) -> PoseSearch | None:
    """Return the search over the poses that the laps chose; None where a tag has none."""
    laps: list[tuple[Window, Edges]] = []
    for low in range(0, len(tags), LAP):
        first, high = max(low - 1, 0), min(low + LAP, len(tags))
        lap = PoseSearch.of(checker, tags[first : high + AHEAD], options, between)
        if laps:
            _begin_at(lap, laps[-1][0])
        if (lap.found.path == NONE).any():
            return None
        laps.append(_taken(lap, np.arange(low - first, high - first)))
    own = Window.concat([window for window, _ in laps])
    edges = Edges.concat([edges for _, edges in laps])
    whole = PoseSearch.of(checker, tags, replace(options, window=own), between)
    if len(whole.states.q) != len(tags):
        return None
    whole.known.asked[:] |= CHECKED
    return replace(whole, keys=replace(whole.keys, edges=edges))


def _begin_at(lap: PoseSearch, before: Window) -> None:
    """Leave of the first tag of a lap the state alone in which the one ``before`` ended."""
    count = int(lap.states.offsets[1])
    off = np.abs(lap.states.q[:count] - before.q[-1]).max(axis=1)
    off[lap.states.branch[:count] != before.branch[-1]] = np.inf
    out = np.arange(count) != int(off.argmin())
    lap.ladder.cost[:count][out] = np.inf


def _taken(lap: PoseSearch, rows: IndexArray) -> tuple[Window, Edges]:
    """Return what a lap chose for some of its tags, by rows (k,), and their stiffest poses."""
    kept, states, known = lap.found.path[rows], lap.states, lap.options.window
    best = yardstick(lap.checker.problem, states, lap.keys.edges)
    best = best[rows] if known is None else known.best[lap.tags[rows]]
    branch, q = states.branch[kept].astype(np.int64), states.q[kept].astype(np.float64)
    spins, tilt = states.spin_of(kept)[:, None], np.zeros(len(rows), dtype=np.int64)
    return Window(spins, branch, q, tilt, best), lap.keys.edges.rows(rows)
