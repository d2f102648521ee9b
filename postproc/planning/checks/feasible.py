"""Whether states and motions can be run, and if not, why: reach, limit, singularity, collision."""

from __future__ import annotations

from dataclasses import field, fields, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.arrays import (
    AT_ONCE,
    ROUNDING,
    BoolArray,
    FloatArray,
    IndexArray,
    blocks,
    numbered,
    taken,
)
from postproc.geometry import STEP_SWEEP, arc_poses, line_poses, path_length, rotation_angle
from postproc.model import Arcs
from postproc.planning.states import Problem, Strokes
from postproc.records import dataclass
from postproc.units import DEG, MM

if TYPE_CHECKING:
    from postproc.collision import Scene

STEP_LENGTH = 0.01
"""Longest piece [m] of a motion between two checked poses."""
LARGEST_TURN = 175.0 * DEG
"""A path motion that turns the tool farther could go either way round on the controller [rad]."""
STEP_ANGLE = 4.0 * DEG
"""Largest turn [rad] of the tool between two checked poses."""
SHORT = 0.3
"""A motion below this share of both is checked at its ends only."""
MORE_CLEARANCE = 0.3e-3
"""What a plan keeps beyond the clearance of the cell [m]: digits of the text and other places of
sampling may cost that much before the program is found wanting."""
RESOLUTION = 0.2e-3
"""Contact grazed on a shorter way [m] may pass a plan."""
JUMP = 40.0 * DEG
"""A joint that moves more than this over such a piece is passing a singularity."""


class Reason(IntEnum):
    """Why something cannot be run; the finding is ``PLN`` + number."""

    NONE = 0
    UNREACHABLE = 101
    JOINT_LIMIT = 102
    SINGULAR = 103
    COLLISION = 104
    SPEED = 105


@dataclass(slots=True)
class Verdict:
    """Reason (m,) for each item, and the colliding pair (m,) as an index or -1."""

    reason: IndexArray
    pair: IndexArray

    @property
    def good(self) -> BoolArray:
        """(m,) whether nothing stands against it."""
        return np.asarray(self.reason == Reason.NONE)

    @classmethod
    def clean(cls, m: int) -> Verdict:
        """Return a verdict with nothing against anything."""
        return cls(np.zeros(m, dtype=np.int64), np.full(m, -1, dtype=np.int64))

    def refuse(self, rows: IndexArray | BoolArray, reason: Reason) -> None:
        """Set the reason of rows that have none yet."""
        fresh = np.zeros(len(self.reason), dtype=np.bool_)
        fresh[rows] = True
        self.reason[fresh & self.good] = reason

    def collide(self, rows: IndexArray, pairs: IndexArray) -> None:
        """Note collisions of rows that are good so far, the first of each row."""
        fresh = np.nonzero(self.reason[rows] == Reason.NONE)[0]
        fresh = fresh[np.unique(rows[fresh], return_index=True)[1]]
        self.reason[rows[fresh]], self.pair[rows[fresh]] = Reason.COLLISION, pairs[fresh]


@dataclass(slots=True)
class Lines:
    """Straight or circular CP motions, one a row.

    Args:
        T_from: (m, 4, 4) TCP in the workpiece frame; T_to: (m, 4, 4).
        q_from: (m, 6); q_to: (m, 6) [rad].
        branch: (m,); contact: (m,) the tool may touch the workpiece.
        external: (m, k) where the external axes stand at start and at end [m or rad]; in between
            they move in step with the way.
        arcs: (m,) sweep 0 means straight; None: all are.
        tilts: (m, 3) [rad] by which the tool is tilted at start and end of arcs, as ``arc_poses``.
    """

    T_from: FloatArray
    T_to: FloatArray
    q_from: FloatArray
    q_to: FloatArray
    branch: IndexArray
    contact: BoolArray
    external: tuple[FloatArray, FloatArray]
    arcs: Arcs | None = None
    tilts: tuple[FloatArray, FloatArray] | None = None

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.q_from)

    def cut(self, own: slice) -> Lines:
        """Return some of the motions."""

        def part(column: Any) -> Any:  # noqa: ANN401 - a column, a pair of them, arcs, or none
            if isinstance(column, Arcs):
                return column.rows(np.arange(len(self))[own])
            return tuple(map(part, column)) if isinstance(column, tuple) else column[own]

        columns = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{k: part(c) for k, c in columns.items() if c is not None})

    def external_at(self, row: IndexArray, share: FloatArray) -> FloatArray:
        """Return where the external axes stand (k, e) at ``share`` (k,) of motions ``row`` (k,)."""
        start, end = self.external
        moved: FloatArray = start[row] + share[:, None] * (end - start)[row]
        return moved

    @property
    def length(self) -> FloatArray:
        """(m,) [m] along the path."""
        start, end = self.T_from[:, :3, 3], self.T_to[:, :3, 3]
        if self.arcs is None:
            return np.asarray(np.linalg.norm(end - start, axis=1))
        return path_length(start, end, self.arcs.radius, self.arcs.sweep)


@dataclass(slots=True)
class Track:
    """Sampled joint paths of motions: row (k,), share (k,) 0..1, joints (k, 6), ends included."""

    row: IndexArray
    share: FloatArray
    q: FloatArray

    @classmethod
    def joined(cls, parts: dict[int, Track]) -> Track:
        """Return the tracks of motions that stand one behind the other, by the first of each."""
        return cls(
            np.concatenate([part.row + low for low, part in parts.items()]),
            np.concatenate([part.share for part in parts.values()]),
            np.concatenate([part.q for part in parts.values()]),
        )


@dataclass(slots=True)
class Checker:
    """Checks against one problem and one scene (None: no collision check).

    ``ways``: points (k, 6) between the ends of free ways round something, found for a connection,
    and how long [rad] a connection by them may be. ``trees``: for the ends of each connection that
    a random tree was grown for after how many rounds it ended, and the way (k, 6) found.
    """

    problem: Problem
    scene: Scene | None
    checked: int = field(default=0, init=False)
    pairs: tuple[tuple[str, str], ...] = field(default=(), init=False)
    ways: list[tuple[FloatArray, float]] = field(default_factory=list, init=False)
    trees: dict[bytes, tuple[int, FloatArray | None]] = field(default_factory=dict, init=False)

    @property
    def strokes(self) -> Strokes:
        """The strokes of the tags."""
        return self.problem.strokes

    def states(
        self,
        tags: IndexArray,
        q: FloatArray,
        attitude: FloatArray,
        branch: IndexArray,
        free: BoolArray | None = None,
    ) -> Verdict:
        """Check poses at tags, with the whole stroke where the tag has one.

        Args:
            tags: (m,) indices.
            q: (m, 6) [rad].
            attitude: (m, 3) spin, lead, side tilt [rad], or spins (m,) alone.
            branch: (m,).
            free: (m,) known to be free of collision, stroke and all, with axes whole turns away:
                what is left to check is whether the axes get there. None: nothing is known.
        """
        verdict = Verdict.clean(len(tags))
        unknown = np.ones(len(tags), dtype=np.bool_) if free is None else ~free
        part = self.poses(tags[unknown], q[unknown])
        verdict.reason[unknown], verdict.pair[unknown] = part.reason, part.pair
        rows = np.nonzero(self.strokes.is_stroke[tags] & verdict.good)[0]
        if len(rows):
            at = tags[rows], q[rows], attitude[rows], branch[rows]
            self._stroke(verdict, rows, *at, ~unknown[rows])
        # known of none: it is asked only where the axes can get there, which another turn may not
        rows = np.nonzero((self.problem.ways_out[tags] > 0.0) & verdict.good)[0]
        if len(rows):
            self._way_out(verdict, rows, tags[rows], q[rows], attitude[rows], branch[rows])
        return verdict

    def _way_out(
        self,
        verdict: Verdict,
        rows: IndexArray,
        tags: IndexArray,
        q: FloatArray,
        attitude: FloatArray,
        branch: IndexArray,
    ) -> None:
        """Check the way by which the tool backs off from the end of a cut, where it is in reach."""
        placement = self.problem.placement
        T_top, top, can_leave = self.problem.way_out(tags, attitude, branch, q)
        kept = np.flatnonzero(can_leave)
        T, external = placement.tcp(tags[kept], attitude[kept]), placement.external[tags[kept]]
        touch = np.ones(len(kept), dtype=np.bool_)
        lines = Lines(T, T_top[kept], q[kept], top[kept], branch[kept], touch, (external, external))
        part = self.lines(lines)[0]
        bad = part.reason == Reason.COLLISION
        verdict.collide(rows[kept[bad]], part.pair[bad])

    def poses(self, tags: IndexArray, q: FloatArray, likely: IndexArray | None = None) -> Verdict:
        """Check poses (m, 6) at tags (m,) for collision, without strokes.

        ``likely`` (m,): the pair that each probably collides by, -1 where nobody knows.
        """
        verdict = Verdict.clean(len(tags))
        verdict.refuse(~self.problem.placement.given[tags], Reason.UNREACHABLE)
        poses = self._standing(q, self.problem.placement.external[tags])
        contact = self.problem.is_contact[tags]
        self._hits(verdict, np.arange(len(tags)), poses, contact, likely)
        return verdict

    def _stroke(
        self,
        verdict: Verdict,
        rows: IndexArray,
        tags: IndexArray,
        q: FloatArray,
        attitude: FloatArray,
        branch: IndexArray,
        free: BoolArray,
    ) -> None:
        """Check free way from the top to the start of the feed, then the feed down to the depth.

        Strokes ``free`` (m,) are known to be free of collision.
        """
        problem, strokes = self.problem, self.strokes
        external = problem.placement.external[tags]
        heights = [strokes.top[tags], strokes.clear[tags], -strokes.depth[tags]]
        T, joints = list[FloatArray](), list[FloatArray]()
        for k, height in enumerate(heights):
            T.append(problem.placement.tcp(tags, attitude, height))
            if k and np.array_equal(height, heights[k - 1]):
                joints.append(joints[-1])
                continue
            solved, reached = problem.solve(T[-1], external, branch, q)
            verdict.refuse(rows[~reached], Reason.UNREACHABLE)
            solved = np.where(reached[:, None], solved, q)
            verdict.refuse(rows[~problem.within(solved)], Reason.JOINT_LIMIT)
            verdict.refuse(rows[~problem.regular(solved)], Reason.SINGULAR)
            joints.append(solved)
        for start, end, touch in ((0, 1, False), (1, 2, True)):
            moving = (heights[start] - heights[end] > ROUNDING) & verdict.good[rows]
            kept = np.nonzero(moving)[0]
            lines = Lines(
                T[start][kept],
                T[end][kept],
                joints[start][kept],
                joints[end][kept],
                branch[kept],
                np.full(len(kept), touch),
                (external[kept], external[kept]),
            )
            part = self.lines(lines, free=free[kept])[0]
            bad = ~part.good
            verdict.reason[rows[kept[bad]]] = part.reason[bad]
            verdict.pair[rows[kept[bad]]] = part.pair[bad]

    def lines(
        self, lines: Lines, together: IndexArray | None = None, free: BoolArray | None = None
    ) -> tuple[Verdict, Track]:
        """Check CP motions between their ends, which are taken as checked but for collision.

        ``together`` (m,): successive motions of the same number are looked at as one first, which
        is faster where most are free. ``free`` (m,): known to be free of collision.
        """
        verdict = Verdict.clean(len(lines))
        track = self.track(lines, verdict)
        if self.scene is not None and len(lines):
            good = (verdict.good if free is None else verdict.good & ~free)[track.row]
            number = np.arange(len(lines)) if together is None else together
            row = track.row[good]
            poses = self._standing(taken(track.q, good), lines.external_at(row, track.share[good]))
            self._sweep(verdict, row, poses, lines.contact, number)
        return verdict, track

    def track(self, lines: Lines, verdict: Verdict) -> Track:
        """Return the joint paths of CP motions; notes what stands against them."""
        if len(lines) <= AT_ONCE:
            return self._tracked(lines, verdict)
        parts: dict[int, Track] = {}
        for own in blocks(len(lines)):
            found = Verdict(verdict.reason[own], verdict.pair[own])
            parts[own.start] = self._tracked(lines.cut(own), found)
        return Track.joined(parts)

    def _tracked(self, lines: Lines, verdict: Verdict) -> Track:
        row, share = self._shares(lines)
        turn = rotation_angle(lines.T_from[:, :3, :3], lines.T_to[:, :3, :3])
        verdict.refuse(np.nonzero(turn > LARGEST_TURN)[0], Reason.SINGULAR)
        inner = (share > 0.0) & (share < 1.0)
        q = taken(lines.q_from, row) + share[:, None] * taken(lines.q_to - lines.q_from, row)
        if inner.any():
            which = row[inner]
            T = poses_between(lines, which, share[inner])
            external = lines.external_at(which, share[inner])
            solved, reached = self.problem.solve(T, external, lines.branch[which], taken(q, inner))
            verdict.refuse(which[~reached], Reason.UNREACHABLE)
            solved = np.where(reached[:, None], solved, taken(q, inner))
            verdict.refuse(which[~self.problem.within(solved)], Reason.JOINT_LIMIT)
            verdict.refuse(which[~self.problem.regular(solved)], Reason.SINGULAR)
            q[inner] = solved
        piece = np.flatnonzero(row[1:] == row[:-1])
        if inner.any():
            for farthest in _farthest(q, piece):
                verdict.refuse(row[piece[~self.problem.within(farthest)]], Reason.JOINT_LIMIT)
                verdict.refuse(row[piece[~self.problem.regular(farthest)]], Reason.SINGULAR)
        leap = np.abs(taken(q, piece + 1) - taken(q, piece)).max(axis=1, initial=0.0)
        verdict.refuse(row[piece[leap > JUMP]], Reason.SINGULAR)
        return Track(row, share, q)

    def free_poses(self, q: FloatArray, external: FloatArray) -> BoolArray:
        """Return (m,) whether poses (m, 6) are free of any collision, contact included.

        The external axes stand at ``external`` (k,) or (m, k).
        """
        verdict = Verdict.clean(len(q))
        poses, contact = self._standing(q, external), np.zeros(len(q), dtype=np.bool_)
        self._hits(verdict, np.arange(len(q)), poses, contact)
        return verdict.good

    def hits_itself(self, q: FloatArray) -> BoolArray:
        """Return (m,) whether in poses (m, 6) the arm and what it carries hit each other."""
        return np.zeros(len(q), np.bool_) if self.scene is None else self.scene.hits_itself(q)

    def standing_in(self, q: FloatArray, external: FloatArray) -> str:
        """Return in words what a pose (6,) collides with, contact included; empty if it is free.

        The external axes stand at ``external`` (k,).
        """
        poses = self._standing(q[None], external)
        hits = None if self.scene is None else self.scene.check(poses)
        if self.scene is None or hits is None or not hits.hit[0]:
            return ""
        distance, nearest = self.scene.nearest(poses)
        one, two = hits.pairs[int(nearest[0] if distance[0] > 0.0 else hits.pair[0])]
        if distance[0] > 0.0:
            return f"{one} is {distance[0] / MM:.2f} mm from {two}, closer than allowed"
        point = self.scene.meeting_point(poses[0], int(hits.pair[0])) / MM
        place = ", ".join(f"{value:.1f}" for value in point)
        return f"{one} stands in {two}, about [{place}] mm from the robot root"

    def met(self, pair: int) -> str:
        """Return in words what hits what, and how near is as bad where solids keep a distance."""
        one, two = self.pairs[pair]
        near = 0.0 if self.scene is None else float(self.scene.distances_kept[pair])
        return f"{one} hits {two}" + (f" or comes nearer than {near / MM:.3g} mm" if near else "")

    def joint_moves(self, q_from: FloatArray, q_to: FloatArray, external: FloatArray) -> Verdict:
        """Check straight joint moves (m, 6) to (m, 6) for collision.

        The external axes stand at ``external`` (k,) or (m, k) all along.
        """
        verdict = Verdict.clean(len(q_from))
        if self.scene is not None and len(q_from):
            ends = self._standing(q_from, external), self._standing(q_to, external)
            hits = self.scene.check_paths(*ends, resolution=RESOLUTION)
            self.pairs = hits.pairs
            rows = np.nonzero(hits.hit)[0]
            verdict.collide(rows, hits.pair[rows])
        return verdict

    def _standing(self, q: FloatArray, external: FloatArray) -> FloatArray:
        """Return configurations (m, 6 + k) of the scene, whose external axes may move."""
        if not external.shape[-1]:
            return q
        return np.hstack([q, np.broadcast_to(external, (len(q), external.shape[-1]))])

    def _shares(self, lines: Lines) -> tuple[IndexArray, FloatArray]:
        """Return row and share of every sample, both ends of each motion included."""
        turn = rotation_angle(lines.T_from[:, :3, :3], lines.T_to[:, :3, :3])
        size = np.maximum(lines.length / STEP_LENGTH, turn / STEP_ANGLE)
        if lines.arcs is not None:
            size = np.maximum(size, lines.arcs.sweep / STEP_SWEEP)
        size -= ROUNDING
        pieces = np.ceil(np.maximum(size, np.where(size > SHORT, 2.0, 1.0))).astype(np.int64)
        row, step = numbered(pieces + 1)
        return row, step / pieces[row]

    def _hits(
        self,
        verdict: Verdict,
        rows: IndexArray,
        q: FloatArray,
        contact: BoolArray,
        likely: IndexArray | None = None,
    ) -> None:
        if self.scene is None or not len(q):
            return
        hits = self.scene.check(np.asarray(q, dtype=np.float64), contact, likely=likely)
        self.checked += len(q)
        self.pairs = hits.pairs
        verdict.collide(rows[hits.hit], hits.pair[hits.hit])

    def _sweep(
        self,
        verdict: Verdict,
        row: IndexArray,
        q: FloatArray,
        contact: BoolArray,
        together: IndexArray,
    ) -> None:
        """Check the motions between successive samples of the same row."""
        if self.scene is None or len(q) < 2:
            return
        start = np.nonzero(row[1:] == row[:-1])[0]
        motion = row[start]
        ends = taken(q, start), taken(q, start + 1)
        track = together[motion]
        hits = self.scene.check_paths(*ends, contact[motion], RESOLUTION, track=track)
        self.pairs = hits.pairs
        verdict.collide(motion[hits.hit], hits.pair[hits.hit])


def _farthest(q: FloatArray, piece: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest joints (p, 6) between samples (k, 6) and the next [rad].

    A parabola through three samples rises above both ends of a piece where its vertex lies between
    them: by (1 - 2 |b - a| / s)^2 s / 8, s being the second difference. Of the two parabolas
    through a piece the one that is bent more counts.
    """
    bent = np.zeros_like(q)
    inner = piece[1:][np.diff(piece) == 1]
    bent[inner] = np.abs(taken(q, inner - 1) - 2.0 * taken(q, inner) + taken(q, inner + 1))
    start, end = taken(q, piece), taken(q, piece + 1)
    bend, way = np.maximum(taken(bent, piece), taken(bent, piece + 1)), np.abs(end - start)
    rise = np.zeros_like(bend)
    turns = np.nonzero(2.0 * way < bend)
    rise[turns] = 0.125 * bend[turns] * (1.0 - 2.0 * way[turns] / bend[turns]) ** 2
    return np.minimum(start, end) - rise, np.maximum(start, end) + rise


def poses_between(lines: Lines, row: IndexArray, share: FloatArray) -> FloatArray:
    """Return T_base_tcp (k, 4, 4) at ``share`` (k,) of motions ``row`` (k,)."""
    T_a, T_b = taken(lines.T_from, row), taken(lines.T_to, row)
    poses, arcs = line_poses(T_a, T_b, share), lines.arcs
    if arcs is None:
        return poses
    round_ = np.nonzero(arcs.sweep[row] > 0.0)[0]
    if len(round_):
        which = row[round_]
        poses[round_] = arc_poses(
            T_a[round_],
            T_b[round_],
            arcs.centre[which],
            arcs.normal[which],
            arcs.sweep[which],
            share[round_],
            None if lines.tilts is None else (lines.tilts[0][which], lines.tilts[1][which]),
        )
    return poses
