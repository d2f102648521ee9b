"""Approximated corners of a program: how far the tool may pass them, and what it may hit there.

Read from the text alone: which motions end in C_DIS, C_PTP, C_VEL, C_ORI or C_SPL, with which
$APO in force. C_DIS counts the distance of the tool point; of the others the controller knows more
than the text says, so they may begin in the middle of the motion and end in the middle of the next.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, blocks, taken
from postproc.controller import Blend, MotionType
from postproc.errors import RunKind, Severity
from postproc.geometry import inverse
from postproc.kinematics import NEARER, Corners, Kinematics, bound_of, corner_miss, joint_share
from postproc.paths import Paths
from postproc.process import ALONG_AXIS, on_the_way_out
from postproc.units import DEG, MM
from postproc.verification.report import AT_MOST, Measure, Remark, Said, listed
from postproc.verification.run import Run

if TYPE_CHECKING:
    from postproc.collision import Scene

SLACK = 0.02
"""Digits of the text may cost this share of the tolerance of a corner."""
_FULL_TURN = 2.0 * np.pi


def blended(paths: Paths) -> AnyIntArray:
    """Return the motions whose end is approximated, with joints known around it."""
    trace = paths.trace
    at = np.flatnonzero(~trace.is_exact[:-1])
    at = at[at > 0]
    known = np.asarray(np.isfinite(paths.q).all(axis=1))
    step = np.abs(np.diff(paths.q, axis=0, prepend=paths.q[:1]))
    moves = np.asarray(step.max(axis=1, initial=0.0) > 0.0)
    good = known[at - 1] & known[at] & known[at + 1] & moves[at] & moves[at + 1]
    return np.asarray(at[good])


def corners_of(paths: Paths, kinematics: Kinematics, at: AnyIntArray) -> Corners:
    """Return the corners at the ends of motions ``at`` (c,)."""
    trace, curves = paths.trace, paths.curves
    reach = np.where(trace.blend[at] == Blend.DISTANCE, trace.column("cdis")[at], np.inf)
    tool = trace.tools[trace.column("tool")[at].astype(np.int64)]
    ends = [_end(paths, kinematics, at, side, reach, tool) for side in (0, 1)]
    T_corner = curves.T_robroot_flange[at]
    T = np.stack([ends[0][1], T_corner, ends[1][1]], axis=1) @ tool[:, None]
    external = np.stack([ends[0][2], paths.external[at], ends[1][2]], axis=1)
    return Corners(
        np.stack([ends[0][0], paths.q[at], ends[1][0]], axis=1),
        T,
        np.stack([trace.is_cp[at], trace.is_cp[at + 1]], axis=1),
        tool,
        external,
        np.stack([ends[0][3], ends[1][3]], axis=1),
    )


def _end(
    paths: Paths,
    kinematics: Kinematics,
    at: AnyIntArray,
    side: int,
    reach: FloatArray,
    tool: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return joints, flange, axes, joints half way at one end (``side``) of an approximation."""
    motion, trace, curves = at + side, paths.trace, paths.curves
    q, T = paths.q[at].copy(), curves.T_robroot_flange[at].copy()
    middle = np.full_like(q, np.nan)
    way = np.full(len(at), 0.5)
    joint, path = np.flatnonzero(~trace.is_cp[motion]), np.flatnonzero(trace.is_cp[motion])
    if len(joint):
        far, corner = paths.q[(at - 1 if not side else at + 1)[joint]], paths.q[at[joint]]
        way[joint] = joint_share(kinematics, far, corner, tool[joint], reach[joint])
        q[joint] = corner + way[joint, None] * (far - corner)
        T[joint] = kinematics.fk(q[joint])
    length = np.maximum(curves.length[motion[path]], 1e-12)
    way[path] = np.minimum(reach[path] / length, 0.5)
    share = way if side else 1.0 - way
    external = curves.external_at(motion, share, paths.external)
    if len(path):
        T[path], q[path] = _solved(paths, kinematics, motion[path], share[path], at[path])
        bent = path[trace.motion_type[motion[path]] != MotionType.LIN]
        half = 0.5 * way[bent] if side else 1.0 - 0.5 * way[bent]
        middle[bent] = _solved(paths, kinematics, motion[bent], half, at[bent])[1]
    return q, T, external, middle


def _solved(
    paths: Paths, kinematics: Kinematics, motion: AnyIntArray, share: FloatArray, at: AnyIntArray
) -> tuple[FloatArray, FloatArray]:
    """Return flange and joints at shares of path motions, in the posture of the corners ``at``."""
    T = paths.curves.flange(motion, share, paths.station.externals, paths.external)
    near = paths.q[at]
    q, valid = kinematics.ik_in(T, kinematics.slot(near))
    q = kinematics.split_wrist(q, near)
    q = q + _FULL_TURN * np.round((near - q) / _FULL_TURN)
    return T, np.where(valid[:, None], q, np.nan)


def check_corners(run: Run) -> Iterator[Said]:
    """Measure how far corners of the part may be passed; at feed no more than the cell tolerates.

    Without a CAM file nothing is known to be at feed.
    """
    at, corners, cut = run.bent, run.corners, run.is_cut
    if not len(at):
        return
    T_flange = corners.T_robroot_tcp @ inverse(corners.T_flange_tcp)[:, None]
    station = run.paths.station
    places = [station.in_part(T_flange[:, k], corners.external[:, k], at)[0] for k in range(3)]
    miss = np.nan_to_num(corner_miss(*places))
    row = int(miss.argmax())
    yield Measure("corner_rounding", float(miss[row] / MM), "mm", int(at[row]))
    if not run.has_file:
        return
    limit = run.cell.motion.corner_tolerance
    bad = np.flatnonzero(cut[at] & cut[at + 1] & (miss > limit * (1.0 + SLACK)))
    for row, more in listed(bad, "corners", miss):
        text = f"the tool may pass this corner by {miss[row] / MM:.3f} mm, allowed {limit / MM:g}"
        yield Remark(RunKind.CORNER, int(at[row]), text + more)


def check_corner_ways(run: Run, scene: Scene, rows: AnyIntArray) -> Iterator[Remark]:
    """Search everywhere for collisions and straight wrists where the arm may go at corners (c,).

    The cutting solid may touch the workpiece between two motions that cut.
    """
    at, is_cut = run.bent[rows], run.is_cut
    lost, wrist, pair = np.zeros(len(at), dtype=np.bool_), np.zeros(len(at)), np.zeros_like(at)
    for own in blocks(len(at)):
        bound = bound_of(run.kinematics, run.corners.rows(rows[own]))
        hits = scene.check_corners(bound, is_cut[at[own]] & is_cut[at[own] + 1])
        lost[own], wrist[own], pair[own] = bound.lost, bound.wrist, hits.pair
    for row in np.flatnonzero(lost)[:AT_MOST].tolist():
        text = "where the arm goes at this approximated corner is not known: it leaves its posture"
        yield Remark(RunKind.CORNER, int(at[row]), text, Severity.ERROR)
    limit = run.cell.limits.singularity
    for row in np.flatnonzero(~lost & (wrist < NEARER * limit))[:AT_MOST].tolist():
        least, least_allowed = max(wrist[row], 0.0) / DEG, limit / DEG
        text = f"A5 may come within {least:.3f} deg of the straight wrist at this approximated "
        text += f"corner, expected at least {least_allowed:g} deg"
        yield Remark(RunKind.CORNER, int(at[row]), text)
    for row in np.flatnonzero(pair >= 0)[:AT_MOST].tolist():
        one, two = scene.pairs[int(pair[row])]
        text = f"{one} may hit {two} where this corner is approximated"
        yield Remark(RunKind.COLLISION, int(at[row]), text)


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

        A step goes to a pose (s + 1, 6), tool tip [m] and axis in the part, from the one before.
        """
        to = motion[1:]
        cut, out = self.cut_end[self.last[to]], self.may[to]
        for at in (pose[:-1], pose[1:]):
            out &= on_the_way_out(cut[:, :3], cut[:, 3:], at[:, :3], at[:, 3:], run.slack)
        return np.asarray(run.is_cut[to] | out)
