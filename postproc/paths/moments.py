"""Pose, speed, direction of every joint and process load at every moment of a run.

The controller's own speed along the path is the programmed one; the joint speeds are central
differences of the joint path over ``WINDOW`` to both sides, since no drive follows shorter changes.
Where the robot stops they are 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray, forward_filled
from postproc.cell import Cell
from postproc.paths.motion import Paths
from postproc.paths.times import chains, durations, motion_times
from postproc.records import dataclass
from postproc.units import DEG

WINDOW = 0.01
"""Half the time [s] over which joint speeds are averaged."""
TURNED = 1e-3 * DEG
"""A joint that moves back by this much [rad] has turned back; digits move it by less."""
FINEST = 1e-4 * DEG
"""No gear loses less [rad]."""


@dataclass(frozen=True, slots=True)
class Moments:
    """Moments of a run in columns of length n.

    q (n, 6) commanded joint angles [rad]; qd (n, 6) their speed [rad/s]; direction (n, 6) the side
    -1..1 that each joint was moved to, as ``directions`` has it; process (n, 6) wrench of the
    process ON the tool at and in axes of the TCP [N, N*m], 0 where the tool does not work.
    ``tool`` (n,): index of the tool in the cell, None: the first for all.
    """

    q: FloatArray
    qd: FloatArray
    direction: FloatArray
    process: FloatArray
    tool: AnyIntArray | None = None

    def __len__(self) -> int:
        """Return the number of moments."""
        return len(self.q)

    def rows(self, rows: AnyIntArray) -> Moments:
        """Return some of the moments."""
        tool = None if self.tool is None else self.tool[rows]
        return Moments(self.q[rows], self.qd[rows], self.direction[rows], self.process[rows], tool)

    def under(self, process: FloatArray) -> Moments:
        """Return the same moments with the tool at work under one wrench (6,)."""
        loaded = np.broadcast_to(process, self.process.shape)
        return replace(self, process=loaded)

    def idle(self) -> Moments:
        """Return the same moments with the tool not at work: no load, and speed is no matter."""
        nothing = np.zeros_like(self.q)
        return replace(self, qd=nothing, process=nothing)


@dataclass(frozen=True, slots=True)
class Displacement:
    """What a model of the arm says of a run.

    Args:
        of: moments to the real tool point minus the nominal one (n, 3) [m], axes of robroot.
        lost: (6,) how far [rad] each joint turns back before it has left one side for the other.
        left: how far [m] what follows the motion may leave the tool beside a point that it is at.
        along: a run to what else moves the tool where it works, at the ends of motions and at
            samples of paths (m + s, 3) [m], axes of robroot; None: nothing does.
    """

    of: Callable[[Moments], FloatArray]
    lost: FloatArray
    left: float = 0.0
    along: Callable[[Paths], FloatArray] | None = None


def moments_of(paths: Paths, cell: Cell, lost: FloatArray | None = None) -> tuple[Moments, Moments]:
    """Return the moments at the ends of all motions (m,) and at all samples (s,), without load.

    Poses out of reach repeat the pose before.

    Args:
        paths: of the run.
        cell: whose drives it is run on.
        lost: (6,) as in ``directions``.
    """
    row, share, q, *_ = paths.in_order()
    q = forward_filled(q)
    timeline = Timeline.of(paths, cell)
    tool = paths.station.tool[row]
    every = Moments(q, timeline.speed(row, share), directions(q, lost), np.zeros_like(q), tool)
    sampled = paths.trace.is_cp[row]
    return every.rows(np.flatnonzero(share == 1.0)), every.rows(np.flatnonzero(sampled))


@dataclass(frozen=True, slots=True)
class Timeline:
    """When a run is where: motions (m,) and joints q (k, 6) [rad] at ``time`` (k,) [s].

    A motion begins at ``start`` and runs for ``needed``. Behind the last of a chain the robot
    stands for a ``pause`` of four windows; the end of that motion is the middle of it.
    """

    start: FloatArray
    needed: FloatArray
    pause: FloatArray
    time: FloatArray
    q: FloatArray

    @classmethod
    def of(cls, paths: Paths, cell: Cell) -> Timeline:
        """Return the timeline of a run at programmed speeds, without ramps."""
        m = len(paths)
        needed = np.where(paths.trace.is_cp, motion_times(paths), durations(paths, cell))
        needed = np.where(np.isfinite(needed), needed, 0.0)
        number = chains(paths)
        stop = np.r_[number[1:] != number[:-1], True][:m]
        pause = np.where(stop, 4.0 * WINDOW, 0.0)
        start = np.cumsum(needed + pause) - needed - pause
        row, share, q, *_ = paths.in_order()
        q = forward_filled(q)
        ends = np.flatnonzero(share == 1.0)
        time = np.concatenate([start[row] + share * needed[row], start + needed + pause])
        order = np.argsort(time, kind="stable")
        return cls(start, needed, pause, time[order], np.concatenate([q, q[ends]])[order])

    def speed(self, row: AnyIntArray, share: FloatArray) -> FloatArray:
        """Return the joint speeds (n, 6) [rad/s] at ``share`` (n,) of motions ``row`` (n,)."""
        at = self.start[row] + share * self.needed[row] + 0.5 * self.pause[row] * (share >= 1.0)
        ways = [
            np.interp(at + WINDOW, self.time, column) - np.interp(at - WINDOW, self.time, column)
            for column in self.q.T
        ]
        return np.stack(ways, axis=1) / (2.0 * WINDOW)


def directions(q: FloatArray, lost: FloatArray | None = None) -> FloatArray:
    """Return the side (k, 6) that each joint was moved to along joints (k, 6) in order of time.

    A gear that loses motion takes its joint along only after it has crossed its gap: from 1 at the
    end of a motion upwards the side falls to -1 in proportion to the way back. 0 before the first
    motion; a joint that stands keeps its side.

    Args:
        q: joint angles [rad].
        lost: (6,) way back [rad] from one side to the other; None: ``TURNED``.
    """
    way = np.full(6, TURNED) if lost is None else np.maximum(lost, FINEST)
    side = np.zeros_like(q)
    now = np.zeros(6)
    for i, step in enumerate(2.0 * np.diff(q, axis=0) / way, start=1):
        now = np.clip(now + step, -1.0, 1.0)
        side[i] = now
    return side
