"""Everything the checks share: bodies prepared for culling, the pairs, the exact tests."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, taken
from postproc.collision.arm import Arm
from postproc.collision.bodies import WORLD, Body
from postproc.collision.cull import Culler, Frames, Near, Placed
from postproc.collision.distance import Distances
from postproc.collision.external import JOINTS, PART_LINK, WORLD_LINK, ExternalAxes
from postproc.collision.mesh import Mesh
from postproc.collision.pairs import (
    TOOL,
    Pair,
    PairTable,
    candidate_pairs,
    neutral_poses,
    spread_poses,
)
from postproc.collision.shape import Shape
from postproc.collision.sweep import SweepBound
from postproc.geometry import inverse
from postproc.records import dataclass

CHUNK = 1000
"""Configurations handled at once, so that intermediate arrays stay in the cache."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs that need an exact test, in order of row, then pair.

    ``R``, ``p``: (k, 3, 3), (k, 3) [m] frame of the second body in the first's.
    """

    near: Near
    R: FloatArray
    p: FloatArray

    def __len__(self) -> int:
        """Return the number of entries."""
        return len(self.near)


class Engine:
    """Bodies, pairs and tests of one scene.

    Args:
        arm: the kinematics.
        bodies: the bodies, those that stand for others last.
        stand_ins: how many of them stand for others.
        external: the external axes, and where the robot stands.
        clearance: smallest allowed distance [m].
        limits: q_min (6,) and q_max (6,) [rad], to find links that touch by construction.
        thin: as ``candidate_pairs``.

    Attributes:
        stuck: pairs that touch by construction because their solids are too thick: a tool and the
            wrist, two outlines of links.
    """

    def __init__(
        self,
        arm: Arm,
        bodies: tuple[Body, ...],
        stand_ins: int,
        external: ExternalAxes,
        clearance: float,
        limits: tuple[FloatArray, FloatArray],
        thin: Mapping[Pair, Pair] | None = None,
    ) -> None:
        self.arm = arm
        self.external = external
        self._shapes = [Shape.of(self._mesh(body)) for body in bodies]
        self._distances = Distances(self._shapes)
        self._links = np.array([self._link(body) for body in bodies])
        rides = [axis.kind == "rail" for axis in external.axes]
        moving = {"part_turns": not all(rides), "rides": any(rides)}
        table = candidate_pairs(bodies, stand_ins, clearance, thin or {}, **moving)
        self._use(table)
        by_construction = self._touching(*limits)
        stands_for = {new: pair for pair, new in (thin or {}).items()}
        touching = [stands_for.get(self.both[i], self.both[i]) for i in by_construction]
        self.stuck = tuple(
            (a, b)
            for a, b in touching
            if bodies[b].kind in TOOL or (bodies[a].is_outline and bodies[b].is_outline)
        )
        self.excluded = tuple(
            (bodies[self.table.first[i]].name, bodies[self.table.second[i]].name)
            for i in by_construction
        )
        self._use(self.table.rows(np.delete(np.arange(len(self.table)), by_construction)))
        self.names = tuple(
            (bodies[a].name, bodies[b].name)
            for a, b in zip(self.table.first, self.table.second, strict=True)
        )

    def _use(self, table: PairTable) -> None:
        """Set the pairs."""
        self.table = table
        parts = (self._shapes, self._links, table.first, table.second)
        self._culler = Culler(*parts)
        self.sweep = SweepBound(self.arm, *parts, self.external)

    def with_clearance(self, more: float) -> Engine:
        """Return the same engine with a clearance larger by ``more`` [m]."""
        other = copy.copy(self)
        margin = self.table.margin + np.where(self.keeps, more, 0.0)
        other.table = replace(self.table, margin=margin)
        return other

    def _link(self, body: Body) -> int:
        """Return the link that carries a body: what stands still in robroot is of link 0."""
        if body.link != WORLD:
            return body.link
        if not len(self.external):
            return 0
        return PART_LINK if body.kind == "workpiece" else WORLD_LINK

    def _mesh(self, body: Body) -> Mesh:
        """Return the mesh of a body in the frame of its link."""
        if body.link == WORLD and not len(self.external):
            return body.mesh.moved(inverse(self.external.T_world_robroot))
        return body.mesh

    def _touching(self, q_min: FloatArray, q_max: FloatArray) -> np.ndarray:
        """Return pairs of links that touch at a neutral pose or at all of the spread poses.

        A tool and a link of the wrist: that touch at all of the spread poses.
        """
        neutral, spread = neutral_poses(q_min, q_max), spread_poses(q_min, q_max)
        poses = np.vstack([neutral, spread])
        placed = self.place(np.pad(poses, ((0, 0), (0, len(self.external)))))
        table = self.table
        rides = (self._links[table.first] == 0) & (self._links[table.second] == WORLD_LINK)
        wanted = (table.is_self & ~rides | table.is_wrist)[:, None]
        found = self.candidates(placed, np.zeros((len(table), 1)), wanted)
        none = np.zeros(len(found))
        touching = self.distances(found, np.arange(len(found)), none, none) <= 0.0
        hit = np.zeros((len(self.table), len(placed)), dtype=bool)
        hit[found.near.pair[touching], found.near.row[touching]] = True
        n = len(neutral)
        neutral_hit = hit[:, :n].any(axis=1) & ~table.is_wrist
        return np.flatnonzero(neutral_hit | hit[:, n:].all(axis=1))

    @property
    def keeps(self) -> BoolArray:
        """(p,) pairs that keep a clearance: neither within the arm nor the cutter and the part."""
        table = self.table
        return np.asarray(~table.is_self & table.in_contact & table.out_of_contact)

    @property
    def both(self) -> list[tuple[int, int]]:
        """The bodies of each pair."""
        return list(zip(self.table.first.tolist(), self.table.second.tolist(), strict=True))

    @property
    def is_closed(self) -> list[bool]:
        """Whether each body is closed, so that what lies inside it is seen."""
        return [bool(shape.parts.closed.all()) for shape in self._shapes]

    def frames(self, q: FloatArray) -> Frames:
        """Return the links at configurations (n, 6 + k): joints [rad], external axes."""
        links = self.arm.links_of(q[:, :JOINTS])
        if len(self.external):
            others = np.moveaxis(self.external.frames(q[:, JOINTS:])[:, :, :3], 0, -1)
            links = np.concatenate([links, others])
        return Frames(q, links)

    def place(self, q: FloatArray) -> Placed:
        """Return the bodies at configurations (n, 6 + k): joints [rad], external axes."""
        return self._culler.place(self.frames(q))

    def bodies(self, near: Near) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and second body (k,) of entries."""
        return self.table.first[near.pair], self.table.second[near.pair]

    def wanted(self, contact: BoolArray | None) -> BoolArray:
        """Return (p, n) or (p, 1) which pairs are tested, by where contact is allowed (n,)."""
        if contact is None or not contact.any():
            return self.table.out_of_contact[:, None]
        return np.where(contact, self.table.in_contact[:, None], self.table.out_of_contact[:, None])

    def candidates(self, placed: Placed, threshold: FloatArray, wanted: BoolArray) -> Candidates:
        """Return the pairs that may be nearer than their threshold, or one in the other.

        Args:
            placed: the bodies.
            threshold: (p, n) or (p, 1) [m].
            wanted: (p, n) or (p, 1), the pairs to look at.
        """
        near = self._culler.bodies_near(placed, threshold, wanted)
        near = near.rows(np.lexsort((near.pair, near.row)))
        return Candidates(near, *self._culler.relative(placed, near))

    def candidates_among(
        self, frames: Frames, pair: np.ndarray, row: np.ndarray, threshold: FloatArray
    ) -> Candidates:
        """Return those of single pairs (k,) at configurations (k,) that may be nearer than (k,).

        As ``candidates``. Entries are in order of row, then pair.
        """
        near = Near(pair, row, np.zeros(len(pair)))
        R, p = self._culler.relative(frames, near)
        near = self._culler.entries_near(near, R, p, threshold)
        kept = np.flatnonzero(np.isfinite(near.bound))
        return Candidates(near.rows(kept), taken(R, kept), taken(p, kept))

    def met(self, q: FloatArray, pair: np.ndarray) -> BoolArray:
        """Return (n,) whether one pair each collides at configurations (n, 6 + k)."""
        near = Near(pair, np.arange(len(q)), np.zeros(len(q)))
        found = Candidates(near, *self._culler.relative(self.frames(q), near))
        margin = self.table.margin[pair]
        every = np.arange(len(q))
        return np.asarray(self.distances(found, every, margin, margin, margin) <= margin)

    def distances(
        self,
        found: Candidates,
        which: IndexArray,
        enough: FloatArray,
        low: FloatArray,
        stop: FloatArray | float = 0.0,
        group: IndexArray | None = None,
    ) -> FloatArray:
        """Return distances (k,) [m] of entries ``which`` (k,), as ``Distances.distance``."""
        first, second = self.bodies(found.near.rows(which))
        frames = taken(found.R, which), taken(found.p, which)
        return self._distances.distance(first, second, *frames, enough, low, stop, group)

    def meeting_point(self, q: FloatArray, pair: int) -> FloatArray:
        """Return where a pair meets or is nearest (3,) [m] in robroot at a row (6 + k,)."""
        frames = self.frames(q[None])
        first, second = int(self.table.first[pair]), int(self.table.second[pair])
        one = Near(np.array([pair]), np.array([0]), np.zeros(1))
        R, p = self._culler.relative(frames, one)
        T_robroot_first = frames.link[self._links[first], :, :, 0]
        point = self._distances.meeting_point(first, second, R[0], p[0])
        return np.asarray(T_robroot_first[:, :3] @ point + T_robroot_first[:, 3])

    def axis_aligned_bound(self, placed: Placed) -> FloatArray:
        """Return lower bounds (p, n) [m] of all distances of surfaces."""
        return self._culler.axis_aligned_bound(placed)
