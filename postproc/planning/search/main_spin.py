"""The main spin of cuts that roll the tool far: what rolls off it has to earn that.

The travel of a cut is priced by its square over the way, as it must be where a cut has to turn the
tool: the longer the way, the less. On a cut of many metres half a turn there and back is all but
free, and rounding of the grid of spins, or a difference that nobody could measure, pays for it. So
a cut that was found to roll the tool by more than a quarter turn is searched once more: what stands
off the spin that most of it has must gain ``ROLL_PRICE``.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.geometry import twist_about
from postproc.kinematics import wrapped
from postproc.ladder import NONE, Found
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.search.rungs import STEADY_BAND
from postproc.planning.states import Placement
from postproc.units import DEG

_FULL_TURN = 2.0 * np.pi
_MAIN_STEP = 5.0 * DEG
"""The main spin is looked for in steps of this."""


def main_spins(search: PoseSearch, found: Found) -> FloatArray | None:
    """Return the main spin (N,) [rad] of the tags of cuts that stand as one that rolls the tool.

    Cuts between which the tool does not turn in the air stand together: where one of them rolls it,
    that may be for the sake of the others. NaN at all other tags. A cut that has a main spin
    already keeps it. None where nothing is new, and where every tag is to stand at its best.

    Args:
        search: over key tags (n,).
        found: what it found.
    """
    if search.wish.each:
        return None
    place, is_cut = search.checker.problem.placement, search.between.is_cut
    known, is_new = search.wish.main, False
    main = np.full(len(place), np.nan) if known is None else known.copy()
    of_cut = is_cut | np.append(is_cut[1:], False)
    rows = np.flatnonzero((found.path != NONE) & of_cut[search.tags])
    if not len(rows):
        return None
    tags, spin = search.tags[rows], search.states.spin_of(found.path[rows])
    chain = np.cumsum(~is_cut)
    turns = np.abs(_turns(place, tags, spin)) > 2.0 * STEADY_BAND
    turns &= np.diff(chain[tags]) != 0
    bounds = np.flatnonzero(np.concatenate([[True], turns, [True]]))
    for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        own = tags[low:high]
        if np.isfinite(main[own]).any():
            continue
        onto = _central(place, own)
        roll = spin[low:high] - _level_spins(place, own, onto)
        cuts = np.split(roll, np.flatnonzero(np.diff(chain[own])) + 1)
        if max(_range(cut) for cut in cuts) <= 2.0 * STEADY_BAND:
            continue
        whole = np.arange(chain.searchsorted(chain[own[0]]), 1 + own[-1])
        whole = whole[of_cut[whole]]
        main[whole] = _level_spins(place, whole, onto) + _middle(roll, search.share[rows[low:high]])
        is_new = True
    return main if is_new else None


def _turns(place: Placement, tags: IndexArray, spin: FloatArray) -> FloatArray:
    """Return by how much (m-1,) [rad] the tool rolls from tag to tag (m,), its lean taken off."""
    R = _rotations(place, tags)
    own = twist_about(np.swapaxes(R[:-1], 1, 2) @ R[1:], place.tool_axis)
    return wrapped(own + np.diff(spin))


def _central(place: Placement, tags: IndexArray) -> int:
    """Return that of tags (m,) at which the tool leans least off its mean axis, robroot."""
    axis = _rotations(place, tags) @ place.tool_axis
    return int(tags[np.argmax(axis @ axis.mean(axis=0))])


def _level_spins(place: Placement, tags: IndexArray, onto: int) -> FloatArray:
    """Return the spins (m,) [rad] at which the tool stands as at spin 0 of a tag, but for its lean.

    As the arm sees it: a table may turn the work.
    """
    R_robroot_onto = _rotations(place, np.array([onto]))[0]
    R_tag_onto = np.swapaxes(_rotations(place, tags), 1, 2) @ R_robroot_onto
    return twist_about(R_tag_onto, place.tool_axis)


def _rotations(place: Placement, tags: IndexArray) -> FloatArray:
    """Return R_robroot_tcp (m, 3, 3) of tags (m,) at spin 0."""
    R_robroot_base = place.base(place.external[tags])[..., :3, :3]
    return np.asarray(R_robroot_base @ place.R_base_tcp[tags])


def _range(roll: FloatArray) -> float:
    """Return the smallest range [rad] that holds all of some angles (m,)."""
    around = np.sort(np.mod(roll, _FULL_TURN))
    return _FULL_TURN - float(np.diff(around, append=around[0] + _FULL_TURN).max())


def _middle(roll: FloatArray, weight: FloatArray) -> float:
    """Return the angle [rad] about which the most of angles (m,) lie within ``STEADY_BAND``.

    Those nearer to it count more: of two that hold as many the more central one is taken.
    """
    angles = np.arange(0.0, _FULL_TURN, _MAIN_STEP)
    off = np.abs(wrapped(roll - angles[:, None]))
    near = np.where(off <= STEADY_BAND, np.cos(off), 0.0)
    return float(angles[np.argmax(np.round(near @ weight, 9))])
