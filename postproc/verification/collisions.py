"""Collisions along the executed motions, between the sampled poses as well.

Nothing is missed between two poses, whether joints move, external axes or both.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, taken
from postproc.errors import RunKind
from postproc.process import ALONG_AXIS, on_the_way_out
from postproc.verification.corners import check_corner_ways
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Run

_AT_ONCE = 100_000
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
    from postproc.collision import Scene

    paths, at = run.paths, run.bent
    motion, share, q, point, axis = paths.in_order()
    external = paths.curves.external_at(motion, share, paths.external)
    known = np.isfinite(q).all(axis=1)
    pose = np.hstack([point, axis])[known]
    motion, q = motion[known], np.hstack([q, external])[known]
    if len(q) < 2:
        return
    steps = _touching(run, motion, pose)
    frames = np.stack([paths.station.tool, paths.station.base], axis=1)
    for pair in np.unique(frames[np.unique(motion[1:])], axis=0):
        own = (frames == pair).all(axis=1)
        rows = np.flatnonzero(own[motion[1:]])
        scene = Scene.shared(run.cell.with_tool(*pair.tolist()), run.kinematics)
        if not scene.pairs:
            continue
        if motion[0] == 0 and own[0]:  # where the program begins nothing may touch yet
            first = scene.check(q[:1])
            if first.hit[0]:
                yield 0, first.pairs[int(first.pair[0])]
        for part in _parts(motion[rows + 1]):
            own_rows = rows[part]
            hits = scene.check_paths(
                taken(q, own_rows),
                taken(q, own_rows + 1),
                steps[own_rows],
                track=motion[own_rows + 1],
            )
            for row in np.flatnonzero(hits.hit).tolist():
                yield int(motion[own_rows[row] + 1]), hits.pairs[int(hits.pair[row])]
        corner = np.flatnonzero(own[at] & own[at + 1])
        if len(corner):
            yield from check_corner_ways(run, scene, corner)


def _parts(motion: AnyIntArray) -> Iterator[slice]:
    """Yield steps (s,) of successive motions, ``_AT_ONCE`` or some more, no motion in two parts."""
    low = 0
    while low < len(motion):
        high = int(np.searchsorted(motion, motion[min(low + _AT_ONCE, len(motion)) - 1], "right"))
        yield slice(low, high)
        low = high


def _touching(run: Run, motion: AnyIntArray, pose: FloatArray) -> BoolArray:
    """Return the steps (s,) on which cutting solids may touch the workpiece.

    Args:
        run: the program.
        motion: (s + 1,) of each sampled pose; a step goes to a pose from the one before.
        pose: (s + 1, 6) tool tip [m] and tool axis in the part.
    """
    paths, is_cut = run.paths, run.is_cut
    end = np.hstack([paths.end_point, paths.end_axis])
    way = np.diff(end[:, :3], axis=0, prepend=np.nan)
    is_out = np.einsum("mi,mi->m", way, end[:, 3:]) <= -ALONG_AXIS * np.linalg.norm(way, axis=1)
    # what leaves along its axis with the feed has cut where it began
    cut_end = np.where(is_out[:, None], np.roll(end, 1, axis=0), end)
    last = np.maximum.accumulate(np.where(is_cut, np.arange(len(is_cut)), -1))
    station = paths.station
    same = (last >= 0) & (station.tool == station.tool[last]) & (station.base == station.base[last])
    to = motion[1:]
    cut = cut_end[last[to]]
    # a sub-program begins with a joint motion that stays where the one before ended
    stays = paths.stands & (np.linalg.norm(way, axis=1) < _STILL)
    out = same[to] & (paths.trace.is_cp | stays)[to]
    for at in (pose[:-1], pose[1:]):
        out &= on_the_way_out(cut[:, :3], cut[:, 3:], at[:, :3], at[:, 3:], run.slack)
    return np.asarray(is_cut[to] | out)
