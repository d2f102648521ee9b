"""Which states of two successive key tags a cut may join at all.

From one key tag to the next the tool may spin, but only through spins at which it can stand. At
every tag the states of a branch that follow each other in spin, joint angles and all, form a *run*;
a cut leads from a run of one tag to a run of the next that holds a spin in common. Without this
rule the best sequence would leap over a forbidden range of spins between any two tags, and each
such leap would have to be refuted on its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.planning.states import NONE, States

NEAR = 0.5 * np.pi
"""States of spins beside each other, and of the same spin at successive tags, follow each other if
no joint moves more [rad]."""
Joints = NDArray[np.float32]
_FULL_TURN = 2.0 * np.pi
_DOUBLINGS = 10
"""2 to this is more than the spins of one run, all turns of the joints included."""


@dataclass(slots=True)
class Bridges:
    """The runs of states, and which of them cuts may join.

    ``stride`` (n,) of the spins of each tag; ``closed``: the first spin follows the last;
    ``loose`` (n,): tags into which any step of a branch may lead that turns the tool against
    ``carried`` (n,) [rad] by no more than ``turn`` (n,) [rad].
    """

    states: States
    stride: IndexArray
    closed: bool
    loose: BoolArray
    carried: FloatArray
    turn: FloatArray
    run: NDArray[np.int32] = field(init=False)
    _stale: BoolArray = field(init=False)
    _joined: dict[int, tuple[IndexArray, IndexArray, BoolArray]] = field(
        init=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        """Leave all runs to be found."""
        self.run = np.full(len(self.states.q), NONE, dtype=np.int32)
        self._stale = np.ones(len(self.states), dtype=np.bool_)

    def changed(self, rungs: IndexArray) -> None:
        """Forget the runs of tags (m,) of which states were taken out."""
        self._stale[rungs] = True
        for rung in np.unique(rungs).tolist():
            self._joined.pop(rung, None)
            self._joined.pop(rung + 1, None)

    def may_join(self, i: int, before: IndexArray, now: IndexArray, cost: FloatArray) -> BoolArray:
        """Return (now, before) which states a cut into tag ``i`` may join.

        Args:
            i: rung.
            before: (b,) states of the rung before.
            now: (m,) states of this one.
            cost: (N,) of all states, infinite for those that are out.
        """
        if self.loose[i]:
            branch = self.states.branch
            may = np.asarray(branch[now][:, None] == branch[before][None])
            if self.turn[i] < np.pi:
                twist = self.states.spin_of(now) + self.carried[i] - self.carried[i - 1]
                turn = twist[:, None] - self.states.spin_of(before)[None]
                turn -= _FULL_TURN * np.round(turn / _FULL_TURN)
                may &= np.abs(turn) <= self.turn[i]
            return may
        if self._stale[i] or self._stale[i - 1]:
            self._find_runs(cost)
        if i not in self._joined:
            self._joined[i] = self._join(i)
        of_now, of_before, joined = self._joined[i]
        low, first = int(self.states.offsets[i]), int(self.states.offsets[i - 1])
        return np.asarray(joined[of_now[now - low]][:, of_before[before - first]])

    def _find_runs(self, cost: FloatArray) -> None:
        """Find the runs of all tags where they are not known."""
        on = np.repeat(self._stale, np.diff(self.states.offsets))
        self.run[on] = NONE
        states = np.flatnonzero(on & np.isfinite(cost))
        self._stale[:] = False
        if not len(states):
            return
        rung = self.states.tag_of(states)
        width = self.states.spins.shape[-1]
        spin = self.states.column[states].astype(np.int64)
        place = rung * 8 + self.states.branch[states]
        order = np.argsort(place * width + spin, kind="stable")
        states, place, spin, rung = states[order], place[order], spin[order], rung[order]
        q = self.states.q[states]
        beyond = spin + self.stride[rung]
        wraps = beyond >= width
        target = place * width + np.where(wraps & self.closed, beyond % width, beyond)
        target[wraps & (not self.closed)] = NONE
        follow = _near(place * width + spin, q, target, q)
        after = np.where(follow == NONE, np.arange(len(states)), follow)
        self.run[states] = states[_labels(after)]

    def _join(self, i: int) -> tuple[IndexArray, IndexArray, BoolArray]:
        """Return the run's number of every state of a rung, and of the one before; which may join.

        The last is (runs now, runs before).
        """
        low, first, end = (int(self.states.offsets[k]) for k in (i, i - 1, i + 1))
        runs_now, of_now = np.unique(self.run[low:end], return_inverse=True)
        runs_before, of_before = np.unique(self.run[first:low], return_inverse=True)
        joined = np.zeros((len(runs_now), len(runs_before)), dtype=np.bool_)
        width = self.states.spins.shape[-1]
        key = self.states.branch[first:end].astype(np.int64) * width
        key += self.states.column[first:end]
        old = np.flatnonzero(self.run[first:low] != NONE)
        new = np.flatnonzero(self.run[low:end] != NONE)
        old = old[np.argsort(key[old], kind="stable")]
        q = self.states.q
        if len(old):
            same = _near(key[old], q[first + old], key[low - first + new], q[low + new])
            hit = same != NONE
            joined[of_now[new[hit]], of_before[old[same[hit]]]] = True
        return of_now, of_before, joined


def _near(keys: IndexArray, q: Joints, wanted: IndexArray, q_wanted: Joints) -> IndexArray:
    """Return for each wanted key the row (m,) of the key whose joints are near, ``NONE`` if none.

    Args:
        keys: (n,) rising, several rows of one key for the turns of the joints.
        q: (n, 6) [rad].
        wanted: (m,) keys.
        q_wanted: (m, 6) [rad].
    """
    low = np.searchsorted(keys, wanted, side="left")
    high = np.searchsorted(keys, wanted, side="right")
    found = np.full(len(wanted), NONE, dtype=np.int64)
    for copy in range(int((high - low).max(initial=0))):
        at = np.minimum(low + copy, len(keys) - 1)
        near = (low + copy < high) & (np.abs(q[at] - q_wanted).max(axis=1) <= NEAR)
        found[near] = at[near]
    return found


def _labels(after: IndexArray) -> IndexArray:
    """Return one number (n,) for all rows that follow each other; an end follows itself."""
    jump, least = after, np.arange(len(after))
    for _ in range(_DOUBLINGS):
        least = np.minimum(least, least[jump])
        jump = jump[jump]
    ends = after[jump] == jump
    return np.where(ends, jump, least)
