"""Motions of cuts that no pose can run, told before any is tried.

Each step of a search that leads over such a motion would have to be refuted on its own.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.geometry import angle_between
from postproc.planning.checks import LARGEST_TURN, Lines, Reason, poses_between
from postproc.planning.search.leaning import as_arcs
from postproc.planning.states import Problem, cut_into, spin_values
from postproc.units import DEG

_LONG = 0.5
"""Only longer motions [m] are looked at on their way: both ends of others tell as much."""
_EVERYWHERE = np.arange(1.0, 16.0) / 16.0
_LOOKS = (
    (np.array([0.25, 0.5, 0.75]), 60.0 * DEG),
    (_EVERYWHERE, 10.0 * DEG),
    (_EVERYWHERE, 1.0 * DEG),  # near the edge of reach few spins do
)
"""At these shares of them, in such steps of spin [rad]: what passes one look is passed."""
_AT_ONCE = 64


def hopeless(problem: Problem, way: FloatArray) -> IndexArray:
    """Return the ``Reason`` (n,) for which no cut leads to a tag from the one before, or none.

    The tool axis turns by more than one motion can, or somewhere on the way the arm reaches no
    pose, at whatever spin.

    Args:
        problem: what is asked.
        way: (n,) [m] length of the path.
    """
    place, n = problem.placement, len(problem)
    found = np.full(n, int(Reason.NONE), dtype=np.int64)
    cuts = np.flatnonzero(cut_into(problem.toolpath))
    cuts = cuts[cuts > 0]
    cuts = cuts[place.given[cuts] & place.given[cuts - 1]]
    turn = angle_between(place.axis_base(cuts - 1), place.axis_base(cuts))
    lean = np.abs(problem.tilts).sum(axis=1).max()
    found[cuts[turn > LARGEST_TURN + 2.0 * lean]] = Reason.SINGULAR
    if not lean:
        long = cuts[way[cuts] - way[cuts - 1] > _LONG]
        for shares, step in _LOOKS:
            parts = [long[k : k + _AT_ONCE] for k in range(0, len(long), _AT_ONCE)]
            long = np.concatenate(
                [long[:0], *(_out_of_reach(problem, p, shares, step) for p in parts)]
            )
        found[long] = Reason.UNREACHABLE
    return found


def _out_of_reach(
    problem: Problem, tags: IndexArray, shares: FloatArray, step: float
) -> IndexArray:
    """Return those of tags (m,) on the way to which the arm somewhere reaches no pose at all."""
    place, spins = problem.placement, spin_values(step, -np.pi, np.pi)
    last, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    nothing, any_ = np.zeros((len(last), 6)), np.zeros(len(last), dtype=np.int64)
    lines = Lines(
        place.tcp(last - 1, spin),
        place.tcp(last, spin),
        nothing,
        nothing,
        any_,
        any_ == 0,
        (place.external[last - 1], place.external[last]),
    )
    as_arcs(problem, last, lines)
    row, share = np.repeat(np.arange(len(last)), len(shares)), np.tile(shares, len(last))
    flange = place.flange(poses_between(lines, row, share), lines.external_at(row, share))
    reached = problem.kinematics.ik(flange)[1].any(axis=1)
    somehow = np.any(reached.reshape(len(tags), len(spins), len(shares)), axis=1)
    return np.asarray(tags[~np.all(somehow, axis=1)])
