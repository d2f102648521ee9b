"""Collisions along the executed motions, between the sampled poses as well.

Nothing is missed between two poses, whether joints move, external axes or both.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, taken
from postproc.errors import RunKind
from postproc.process import ALONG_AXIS, on_the_way_out
from postproc.verification.corners import check_corner_ways
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Run

if TYPE_CHECKING:
    from postproc.collision import Scene

_AT_ONCE = 40_000
"""Steps that are checked together, so that memory stays bounded."""
_STILL = 1e-6
"""A tool point that moves by less [m] against the part stays where it is."""


def check_collisions(run: Run) -> Iterator[Said]:
    """Yield each pair that touches, once a motion, and no more than a few in all."""
    hits: dict[tuple[int, tuple[str, str]], None] = {}
    for found in _hits(run):
        if isinstance(found, Remark):
            yield found
        elif found not in hits and len(hits) < AT_MOST:
            hits[found] = None
            motion, (one, two) = found
            yield Remark(RunKind.COLLISION, motion, f"{one} hits {two} on the way there")


def _hits(run: Run) -> Iterator[Remark | tuple[int, tuple[str, str]]]:
    """Yield (motion, the pair that touches on the way to its end), and what is said of corners."""
    station, at = run.paths.station, run.bent
    frames = np.stack([station.tool, station.base], axis=1)
    out = _WaysOut.of(run)
    for motion, q, pose in _parts(run):
        steps = out.touching(run, motion, pose)
        for pair in np.unique(frames[np.unique(motion[1:])], axis=0):
            own = (frames[motion] == pair).all(axis=1)
            scene = _scene(run, pair)
            if not scene.pairs:
                continue
            if motion[0] == 0 and own[0]:  # where the program begins nothing may touch yet
                first = scene.check(q[:1])
                if first.hit[0]:
                    yield 0, first.pairs[int(first.pair[0])]
            rows = np.flatnonzero(own[1:])
            to = motion[rows + 1]
            hits = scene.check_paths(taken(q, rows), taken(q, rows + 1), steps[rows], track=to)
            for row in np.flatnonzero(hits.hit).tolist():
                yield int(to[row]), hits.pairs[int(hits.pair[row])]
    for pair in np.unique(frames[at], axis=0):
        own = (frames == pair).all(axis=1)
        corner = np.flatnonzero(own[at] & own[at + 1])
        scene = _scene(run, pair)
        if len(corner) and scene.pairs:
            yield from check_corner_ways(run, scene, corner)


def _scene(run: Run, frames: AnyIntArray) -> Scene:
    """Return the scene with a tool and a base (2,) of the cell."""
    from postproc.collision import Scene

    return Scene.shared(run.cell.with_tool(*frames.tolist()), run.kinematics)


def _parts(run: Run) -> Iterator[tuple[AnyIntArray, FloatArray, FloatArray]]:
    """Yield motion (s + 1,), axes (s + 1, 6 + k) and pose (s + 1, 6) of successive steps.

    The poses that are reached, in order of time. A part holds ``_AT_ONCE`` or some more, begins
    with the last pose of the part before, and has all steps of its motions.
    """
    paths, low = run.paths, 0
    before: tuple[AnyIntArray, FloatArray, FloatArray] | None = None
    ends = np.searchsorted(paths.row, np.arange(1, len(paths) + 1)) + np.arange(1, len(paths) + 1)
    while low < len(paths):
        done = int(ends[low - 1]) if low else 0
        high = min(int(np.searchsorted(ends, done + _AT_ONCE)) + 1, len(paths))
        motion, share, q, point, axis = paths.in_order(low, high)
        external = paths.curves.external_at(motion, share, paths.external)
        known = np.isfinite(q).all(axis=1)
        part = motion[known], np.hstack([q, external])[known], np.hstack([point, axis])[known]
        if before is not None:
            joined = [np.concatenate(both) for both in zip(before, part, strict=True)]
            part = joined[0], joined[1], joined[2]
        if len(part[0]) > 1:
            yield part
        before = (part[0][-1:], part[1][-1:], part[2][-1:]) if len(part[0]) else None
        low = high


class _WaysOut(NamedTuple):
    """Where the tool may come from the part: cutting solids may touch it there.

    ``cut_end`` (m, 6): where each motion cuts last, tip and tool axis in the part; ``last`` (m,):
    the last motion that cuts up to each; ``may`` (m,): motions that may leave what that has cut.
    """

    cut_end: FloatArray
    last: AnyIntArray
    may: BoolArray

    @classmethod
    def of(cls, run: Run) -> _WaysOut:
        """Return those of a program."""
        paths, is_cut = run.paths, run.is_cut
        end = np.hstack([paths.end_point, paths.end_axis])
        way = np.diff(end[:, :3], axis=0, prepend=np.nan)
        size = np.linalg.norm(way, axis=1)
        is_out = np.einsum("mi,mi->m", way, end[:, 3:]) <= -ALONG_AXIS * size
        # what leaves along its axis with the feed has cut where it began
        cut_end = np.where(is_out[:, None], np.roll(end, 1, axis=0), end)
        last = np.maximum.accumulate(np.where(is_cut, np.arange(len(is_cut)), -1))
        at = paths.station
        same = (last >= 0) & (at.tool == at.tool[last]) & (at.base == at.base[last])
        # a sub-program begins with a joint motion that stays where the one before ended
        stays = paths.stands & (size < _STILL)
        return cls(cut_end, last, same & (paths.trace.is_cp | stays))

    def touching(self, run: Run, motion: AnyIntArray, pose: FloatArray) -> BoolArray:
        """Return the steps (s,) on which cutting solids may touch the workpiece.

        Args:
            run: the program.
            motion: (s + 1,) of each sampled pose; a step goes to a pose from the one before.
            pose: (s + 1, 6) tool tip [m] and tool axis in the part.
        """
        to = motion[1:]
        cut, out = self.cut_end[self.last[to]], self.may[to]
        for at in (pose[:-1], pose[1:]):
            out &= on_the_way_out(cut[:, :3], cut[:, 3:], at[:, :3], at[:, 3:], run.slack)
        return np.asarray(run.is_cut[to] | out)
