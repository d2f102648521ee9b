"""Which states of two successive key tags a cut may join at all.

From one key tag to the next the tool may spin, but only through spins at which it can stand. At
every tag the states of a branch that follow each other in spin, joint angles and all, form a *run*;
a cut leads from a run of one tag to a run of the next that holds a spin in common. Without this
rule the best sequence would leap over a forbidden range of spins between any two tags, and each
such leap would have to be refuted on its own.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import AT_ONCE, BoolArray, FloatArray, IndexArray, members, taken
from postproc.ladder import NONE, Joined
from postproc.planning.states import BRANCHES, States
from postproc.records import dataclass
from postproc.units import TURN

NEAR = 0.5 * np.pi
"""States of spins beside each other, and of the same spin at successive tags, follow each other if
no joint moves more [rad]."""
Joints = NDArray[np.float32]
_SAME_BRANCH = np.eye(BRANCHES, dtype=np.bool_)
_OUT = 0
"""Class of the states that are out."""


@dataclass(slots=True)
class Bridges:
    """The runs of states, and which of them cuts may join.

    ``stride`` (n,) of the spins of each tag; ``closed``: the first spin follows the last;
    ``loose`` (n,): tags into which any step of a branch may lead that turns the tool against
    ``carried`` (n,) [rad] by no more than ``turn`` (n,) [rad], half a turn where any will do.
    """

    states: States
    stride: IndexArray
    closed: bool
    loose: BoolArray
    carried: FloatArray
    turn: FloatArray
    run: NDArray[np.int32] = field(init=False)
    _stale: BoolArray = field(init=False)
    _known: dict[int, Joined] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Leave all runs to be found."""
        self.run = np.full(len(self.states.q), NONE, dtype=np.int32)
        self._stale = np.ones(len(self.states), dtype=np.bool_)

    def changed(self, rungs: IndexArray) -> None:
        """Forget the runs of tags (m,) of which states were taken out."""
        self._stale[rungs] = True
        for rung in members(np.append(rungs, rungs + 1), len(self.states) + 1).tolist():
            self._known.pop(rung, None)

    def classes(self, i: int, cost: FloatArray) -> Joined:
        """Return the classes of the states of rung ``i`` and of the one before; which may join.

        Args:
            i: rung, not the first.
            cost: (N,) of all states, infinite for those that are out.
        """
        if i not in self._known:
            self._find_runs(cost)
            self._join(i)
        return self._known[i]

    def barred(self, i: int, before: IndexArray, now: IndexArray) -> BoolArray | None:
        """Return (now, before) which cuts into tag ``i`` turn the tool too fast; None: none.

        Args:
            i: rung.
            before: (b,) states of the rung before.
            now: (m,) states of this one.
        """
        if self.turn[i] >= np.pi:
            return None
        twist = self.states.spin_of(now) + self.carried[i] - self.carried[i - 1]
        turn = twist[:, None] - self.states.spin_of(before)[None]
        turn -= TURN * np.round(turn / TURN)
        return np.asarray(np.abs(turn) > self.turn[i])

    def is_lasting(self, i: int) -> bool:
        """Return that it is not: runs end where states are taken out."""
        return False

    def _find_runs(self, cost: FloatArray) -> None:
        """Find the runs of all tags where they are not known."""
        if not self._stale.any():
            return
        on = np.repeat(self._stale, np.diff(self.states.offsets))
        self.run[on] = NONE
        states = np.flatnonzero(on & np.isfinite(cost))
        self._stale[:] = False
        if not len(states):
            return
        width = self.states.spins.shape[-1]
        spin = self.states.column[states].astype(np.int64)
        place = self._place(states)
        order = np.argsort(place * width + spin, kind="stable")
        states, place, spin = states[order], place[order], spin[order]
        q = taken(self.states.q, states)
        beyond = spin + self.stride[place // BRANCHES]
        wraps = beyond >= width
        target = place * width + np.where(wraps & self.closed, beyond % width, beyond)
        target[wraps & (not self.closed)] = NONE
        follow = _near(place * width + spin, q, target, q)
        after = np.where(follow == NONE, np.arange(len(states)), follow)
        longest = int(np.bincount(place - place.min()).max())
        self.run[states] = states[_labels(after, longest)]

    def _place(self, states: IndexArray) -> IndexArray:
        """Return a number (m,) for rung and branch of states."""
        return np.asarray(self.states.tag_of(states) * BRANCHES + self.states.branch[states])

    def _join(self, i: int) -> None:
        """Find which runs may join at a rung, and at those behind it where that is not known."""
        last = min(i + AT_ONCE, len(self.states))
        rungs = np.array([k for k in range(i, last) if k not in self._known])
        offsets, is_loose = self.states.offsets, self.loose[rungs]
        own = np.zeros(len(self.states), dtype=np.bool_)
        own[rungs[~is_loose]] = True
        own[i - 1 : -1] |= own[i:]
        first = int(offsets[i - 1])
        states = first + np.flatnonzero(np.repeat(own, np.diff(offsets))[first:])
        states = states[self.run[states] != NONE]
        runs, number = np.unique(self.run[states], return_inverse=True)
        starts = np.searchsorted(runs, offsets)
        label = np.zeros(int(offsets[last]) - first, dtype=np.int64)
        label[states - first] = _OUT + 1 + number - starts[self.states.tag_of(states)]
        now, before = (found - first for found in self._same_spin(states))
        branch = self.states.branch[first : offsets[last]].astype(np.int64)
        for k, loose in zip(rungs.tolist(), is_loose.tolist(), strict=True):
            a, b, c = (int(offsets[j]) - first for j in (k - 1, k, k + 1))
            if loose:
                self._known[k] = Joined(branch[b:c], branch[a:b], _SAME_BRANCH)
                continue
            low, high = np.searchsorted(now, (b, c)).tolist()
            shape = 1 + np.diff(starts[[k - 1, k, k + 1]])[::-1]
            may = np.zeros(shape, dtype=np.bool_)
            may[label[now[low:high]], label[before[low:high]]] = True
            self._known[k] = Joined(label[b:c], label[a:b], may)

    def _same_spin(self, states: IndexArray) -> tuple[IndexArray, IndexArray]:
        """Return pairs (k,) of states of successive rungs with the same spin and near joints.

        Those of the later rung rise.
        """
        width, q = self.states.spins.shape[-1], self.states.q
        key = self._place(states) * width + self.states.column[states]
        order = np.argsort(key, kind="stable")
        found = _near(key[order], taken(q, states[order]), key - BRANCHES * width, taken(q, states))
        hit = np.flatnonzero(found != NONE)
        return states[hit], states[order[found[hit]]]


def _near(keys: IndexArray, q: Joints, wanted: IndexArray, q_wanted: Joints) -> IndexArray:
    """Return for each wanted key the row (m,) of the key of near joints, ``NONE`` if none."""
    low = np.searchsorted(keys, wanted, side="left")
    high = np.searchsorted(keys, wanted, side="right")
    found = np.full(len(wanted), NONE, dtype=np.int64)
    for copy in range(int((high - low).max(initial=0))):
        at = np.minimum(low + copy, len(keys) - 1)
        near = (low + copy < high) & (np.abs(taken(q, at) - q_wanted).max(axis=1) <= NEAR)
        found[near] = at[near]
    return found


def _labels(after: IndexArray, longest: int) -> IndexArray:
    """Return one number (n,) for all rows that follow each other; an end follows itself.

    No more than ``longest`` rows do.
    """
    jump, least = after, np.arange(len(after))
    for _ in range(longest.bit_length()):
        least = np.minimum(least, least[jump])
        jump = jump[jump]
    ends = after[jump] == jump
    return np.where(ends, jump, least)
