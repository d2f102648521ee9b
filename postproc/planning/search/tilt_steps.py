"""Cuts on whose way the tool leaves its tilt, and which steps of a tilted cut do not.

The controller turns the tool about one axis from tag to tag. Where the feed direction turns, or the
tool spins, most pairs of tilts that are allowed at two tags lean the tool out of its range between
them. That is told by the two tilts and the turn of the spin alone, whatever the arm does: all such
steps are taken out of the graph beforehand, where a search would have to refute them one by one.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from postproc.arrays import AT_ONCE, TINY, BoolArray, FloatArray, IndexArray
from postproc.geometry import angle_between, axis_angle, rotation_angle, turned_between
from postproc.kinematics import wrapped
from postproc.ladder import Joined
from postproc.model import MotionKind
from postproc.planning.checks import Lines, poses_between
from postproc.planning.states import (
    BETWEEN,
    BRANCHES,
    Problem,
    States,
    leaves_tilt_range,
    tilt_frames,
)
from postproc.records import dataclass
from postproc.units import TURN

_SHARES = np.arange(1.0, 8.0) / 8.0
"""Where on a cut the tilt of the tool is checked."""
_HALF_TURN = np.pi - 1e-3
"""A turn by more goes either way round, by the last digit: nothing is said of it beforehand."""


@dataclass(slots=True)
class TiltSteps:
    """Which steps between tilted states of successive key tags keep the tool in its tilt.

    ``tags`` (n,) of the states; ``told`` (n,): into which of them a cut leads that depends on tilt
    and turn of the spin alone: from the tag before, neither of them pinned. ``stride`` (n,) of the
    spins of each tag; ``closed``: the first spin follows the last. Cuts turn the tool against
    ``carried`` (n,) [rad] by no more than ``turn`` (n,) [rad].
    """

    problem: Problem
    states: States
    tags: IndexArray
    told: BoolArray
    stride: IndexArray
    closed: bool
    carried: FloatArray
    turn: FloatArray
    _known: dict[int, Joined] = field(init=False, default_factory=dict)
    _tables: dict[bytes, BoolArray] = field(init=False, default_factory=dict)
    _matrix: tuple[int, BoolArray] = field(init=False, default=(-1, np.zeros((0, 0), np.bool_)))

    @property
    def _width(self) -> int:
        """Spins of the finest grid."""
        return int(self.states.spins.shape[-1])

    def classes(self, i: int, cost: FloatArray) -> Joined:
        """Return branch and tilt of the states of rung ``i`` and of the one before; which may join.

        Args:
            i: rung, not the first.
            cost: of all states; which are out makes no difference.
        """
        if i not in self._known:
            self._known[i] = self._joined(i)
        return self._known[i]

    def barred(self, i: int, before: IndexArray, now: IndexArray) -> BoolArray | None:
        """Return (now, before) which cuts into rung ``i`` lean the tool too far; None: not told.

        Args:
            i: rung.
            before: (b,) states of the rung before.
            now: (m,) states of this one.
        """
        if not self.told[i]:
            return None
        if self._matrix[0] != i:
            self._matrix = i, self._all_steps(i)
        at, of = (self._attitude(i, states) for states in (now, before))
        barred = self._matrix[1][at][:, of]
        if self.turn[i] < np.pi:
            barred |= self._turns_too_fast(i, before, now)
        return np.asarray(barred)

    def _turns_too_fast(self, i: int, before: IndexArray, now: IndexArray) -> BoolArray:
        """Return (now, before) which cuts into rung ``i`` turn the tool too fast about its axis."""
        spin, start = (
            self.states.column[at].astype(np.int64) % self._width for at in (now, before)
        )
        turn = np.arange(1 - self._width, self._width) * self._spacing(i)
        turn += self.carried[i] - self.carried[i - 1]
        too_fast = np.abs(wrapped(turn)) > self.turn[i]
        return np.asarray(too_fast[np.subtract.outer(spin, start) + (self._width - 1)])

    def changed(self, rungs: IndexArray) -> None:
        """Forget nothing: which states were taken out makes no difference."""

    def is_lasting(self, i: int) -> bool:
        """Return whether the steps into rung ``i`` are told by tilt and turn alone."""
        return bool(self.told[i])

    def _joined(self, i: int) -> Joined:
        """Return the classes at a rung: the branches, and where it is told, the tilts of each."""
        low, at, high = self.states.offsets[i - 1 : i + 2].tolist()
        branch = self.states.branch[low:high].astype(np.int64)
        if not self.told[i]:
            return Joined(branch[at - low :], branch[: at - low], np.eye(BRANCHES, dtype=np.bool_))
        tilts = len(self.states.tilts)
        of = branch * tilts + self.states.column[low:high] // self.states.spins.shape[-1]
        may = np.kron(np.eye(BRANCHES, dtype=np.bool_), ~self._table(i).all(axis=2))
        return Joined(of[at - low :], of[: at - low], may)

    def _attitude(self, i: int, states: IndexArray) -> IndexArray:
        """Return the numbers (m,) of tilt and spin as ``_all_steps`` has them."""
        tilt, spin = np.divmod(self.states.column[states].astype(np.int64), self._width)
        step, count, _ = self._turns(i)
        return np.asarray(tilt * count + spin // step)

    def _spacing(self, i: int) -> float:
        """Return how far apart the finest spins of a rung are [rad]."""
        spins = self.states.spins if self.states.spins.ndim == 1 else self.states.spins[i]
        return float(np.diff(spins[:2]).sum())

    def _turns(self, i: int) -> tuple[int, int, IndexArray]:
        """Return the grid of spins that a rung and the one before share, and the turns between.

        Every how many of the finest spins, how many there are, and the numbers (d,) of turns from
        spin to spin: of a full circle once around, else backwards and forwards.
        """
        step = int(np.gcd(self.stride[i - 1], self.stride[i]))
        if not self.closed or abs(self._width * self._spacing(i) - TURN) > TINY:
            count = (self._width - 1) // step + 1
            return step, count, np.arange(1 - count, count)
        step = int(np.gcd(step, self._width))
        return step, self._width // step, np.arange(self._width // step)

    def _all_steps(self, i: int) -> BoolArray:
        """Return which attitudes at rung ``i`` (m,) those of the one before (b,) must not join."""
        _, count, turns = self._turns(i)
        of = np.arange(count)[:, None] - np.arange(count) - turns[0]
        steps = self._table(i)[:, :, of % len(turns)].swapaxes(1, 2)
        return steps.reshape(len(self.states.tilts) * count, -1)

    def _table(self, i: int) -> BoolArray:
        """Return (T, T, d) which tilts must not follow others with a turn of the spin.

        Where the path is bent alike, so are they.
        """
        key = self._bend(i)
        if key not in self._tables:
            self._tables[key] = self._worked_out(i)
        return self._tables[key]

    def _bend(self, i: int) -> bytes:
        """Return what the table of a rung depends on: the tag as it is seen from the one before."""
        place, last = self.problem.placement, self.tags[i]
        ends, around = np.array([last - 1, last]), _around(self.problem, self.tags[i : i + 1])
        R, feed, axis = place.R_base_tcp[ends], place.feed[ends], place.axis_base(ends)
        frame = R[0]
        if np.isfinite(feed[0, 0]):
            frame = np.column_stack([feed[0], axis[0], np.cross(feed[0], axis[0])])
        turn = frame.T @ R[1] @ R[0].T @ frame
        seen = np.vstack([turn, np.vstack([axis, feed, around]) @ frame])
        kinds = (self._turns(i)[0], *place.may_tilt[ends].tolist())
        return repr(kinds).encode() + (np.round(seen, 9) + 0.0).tobytes()

    def _worked_out(self, i: int) -> BoolArray:
        """Return the table of a rung (``_table``)."""
        place, last = self.problem.placement, int(self.tags[i])
        step, _, turns = self._turns(i)
        tilts = self.states.tilts
        grid = np.column_stack([np.zeros(len(tilts)), tilts])
        at, of = np.full(len(tilts), last - 1), np.full(len(tilts) * len(turns), last)
        later = np.repeat(grid, len(turns), axis=0)
        later[:, 0] = np.tile(turns * step * self._spacing(i), len(tilts))
        T = place.tcp(at, grid), place.tcp(of, later)
        leans = place.tilts(at, grid), place.tilts(of, later)
        first, second = (k.ravel() for k in np.indices((len(at), len(of))))
        result = np.zeros(len(first), dtype=np.bool_)
        for low in range(0, len(first), AT_ONCE):
            a, b = first[low : low + AT_ONCE], second[low : low + AT_ONCE]
            near = rotation_angle(T[0][a, :3, :3], T[1][b, :3, :3]) < _HALF_TURN
            a, b = a[near], b[near]
            ends, nothing = (leans[0][a], leans[1][b]), np.zeros((len(a), 6))
            any_, still = np.zeros(len(a), dtype=np.int64), np.zeros((len(a), 0))
            lines = Lines(T[0][a], T[1][b], nothing, nothing, any_, any_ == 0, (still, still))
            as_arcs(self.problem, of[b], lines)
            too_far = exceeds_tilt(self.problem, of[b], ends, lines, TINY)
            result[low + np.flatnonzero(near)] = too_far
        return result.reshape(len(tilts), len(tilts), -1).swapaxes(0, 1)


def as_arcs(problem: Problem, tags: IndexArray, lines: Lines) -> None:
    """Make arcs of the motions to tags (m,) that the toolpath reaches by arcs."""
    arcs = problem.toolpath.arcs
    is_arc = np.asarray(problem.toolpath.kind)[tags] == MotionKind.ARC
    if not len(arcs) or not is_arc.any():
        return
    number = np.asarray(problem.toolpath.arc)[tags]
    sweep = np.where(is_arc, arcs.sweep[number], 0.0)
    lines.arcs = replace(arcs.rows(number), sweep=sweep)


def exceeds_tilt(
    problem: Problem,
    tags: IndexArray,
    tilts: tuple[FloatArray, FloatArray],
    lines: Lines,
    slack: float = 0.0,
) -> BoolArray:
    """Return which cuts (m,) leave the allowed tilt on their way; tell arcs the tilt they carry.

    Args:
        problem: what is asked.
        tags: (m,) to which they lead, from the tags before.
        tilts: (m, 3) of the tool at start and end, axis times angle [rad].
        lines: (m,) the cuts.
        slack: by so much [rad] more they may.
    """
    leaves = np.zeros(len(lines), dtype=np.bool_)
    tilted = (tilts[0] != 0.0).any(axis=1) | (tilts[1] != 0.0).any(axis=1)
    upright = np.flatnonzero(~tilted)
    leaves[upright] = _exceeds_cam_axis(problem, tags, lines, upright, slack)
    rows = np.flatnonzero(tilted)
    if not len(rows):
        return leaves
    lines.tilts = tilts
    place = problem.placement
    ends, of = np.unique(tags[rows], return_inverse=True)
    frames = tilt_frames(
        _SHARES,
        (-place.axis_base(ends - 1), -place.axis_base(ends)),
        (place.feed[ends - 1], place.feed[ends]),
        _around(problem, ends),
    )
    axis = -_axes_between(lines, rows, place.tool_axis)
    frames = frames if len(ends) == 1 else frames[of]
    leaves[rows] = leaves_tilt_range(axis, frames, problem.cell.optimize.tilt, BETWEEN + slack)
    return leaves


def _exceeds_cam_axis(
    problem: Problem, tags: IndexArray, lines: Lines, rows: IndexArray, slack: float
) -> BoolArray:
    """Return which cuts ``rows`` (k,) between upright tags lean the tool out of the CAM axes.

    The controller turns the tool about one axis: where it spins while its axis turns, that leaves
    the plane of the two CAM axes, by up to about a quarter of the product of both angles.
    """
    place, most = problem.placement, BETWEEN + slack
    leaves = np.zeros(len(rows), dtype=np.bool_)
    axes = place.axis_base(tags[rows] - 1), place.axis_base(tags[rows])
    turn = rotation_angle(lines.T_from[rows, :3, :3], lines.T_to[rows, :3, :3])
    some = np.flatnonzero(0.25 * angle_between(*axes) * turn > BETWEEN)
    if len(some):
        a, b = (axis[some, None] for axis in axes)
        off = angle_between(
            _axes_between(lines, rows[some], place.tool_axis), turned_between(a, b, _SHARES)
        )
        leaves[some] = off.max(axis=1) > most
    return leaves


def _around(problem: Problem, tags: IndexArray) -> FloatArray:
    """Return by what (m, 3) [rad] the feed direction goes round to tags (m,), axis times sweep."""
    arcs, around = problem.toolpath.arcs, np.zeros((len(tags), 3))
    is_arc = np.flatnonzero(np.asarray(problem.toolpath.kind)[tags] == MotionKind.ARC)
    if len(arcs) and len(is_arc):
        number = np.asarray(problem.toolpath.arc)[tags[is_arc]]
        around[is_arc] = arcs.normal[number] * arcs.sweep[number, None]
    return around


def _axes_between(lines: Lines, rows: IndexArray, tool_axis: FloatArray) -> FloatArray:
    """Return the tool axes (m, k, 3) on the way of cuts ``rows`` (m,), at ``_SHARES`` of it."""
    count = len(_SHARES)
    if lines.arcs is not None and lines.arcs.sweep[rows].any():
        T = poses_between(lines, np.repeat(rows, count), np.tile(_SHARES, len(rows)))
        return np.asarray(T[:, :3, :3] @ tool_axis).reshape(len(rows), count, 3)
    R = lines.T_from[rows, :3, :3]
    about, angle = axis_angle(R, lines.T_to[rows, :3, :3])
    turn = angle[:, None] * _SHARES
    fixed = about * (about @ tool_axis)[:, None]
    parts = np.stack([tool_axis - fixed, np.cross(about, tool_axis), fixed], axis=-1)
    shares = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=-1)
    return np.asarray(shares @ np.swapaxes(R @ parts, 1, 2))
