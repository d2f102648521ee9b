"""The scene of a cell: its solids, and every question about collisions."""

from __future__ import annotations

import copy
from functools import lru_cache
from operator import is_
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell, ExternalAxis
from postproc.collision import clearance, motion
from postproc.collision.arm import Arm
from postproc.collision.bodies import (
    THINNER,
    WORLD,
    Body,
    above_foot,
    bodies_of,
    pulled_back,
    thinner,
)
from postproc.collision.check import NO_PAIR, Hits, Tally, check
from postproc.collision.engine import Engine
from postproc.collision.external import JOINTS, ExternalAxes
from postproc.collision.hulls import COARSE, HullCheck
from postproc.collision.mesh import joined
from postproc.collision.motion import RESOLUTION, MotionHits
from postproc.collision.pairs import TOOL, Pair, outlines_that_meet
from postproc.collision.surface import Surface, SurfacePoints
from postproc.errors import CellError, DataError, Finding, Severity
from postproc.geometry import inverse
from postproc.kinematics import Bound
from postproc.units import MM


class Scene:
    """The solids of a cell and the checks between them.

    What may touch: where ``contact`` is true, a solid of the tool marked ``cutting`` may lie in the
    workpiece, as deep as ``limits.contact_depth``. The depth is counted along the tool axis: the
    solid, pulled back out of the part by the depth, must be free of the workpiece. So a drill may
    go in by its depth; a cutter that works with its flank needs the depth infinite (the default).
    All other solids of the tool may never touch anything, nor may cutting solids an obstacle.

    ``limits.clearance`` > 0: solids that near count as colliding; not two links of the robot, and
    not cutting solids and the workpiece: how near they come is what the CAM file asks for.

    Configurations q are (n, 6) joint angles [rad]. In a cell with external axes their positions
    E1..Ek [m or rad] may follow as columns 7 and up; without, they stand at 0.

    Attributes:
        bodies: the solids in fixed order: links, tool, workpiece, obstacles.
    """

    def __init__(
        self, cell: Cell, arm: Arm, bodies: tuple[Body, ...], findings: tuple[Finding, ...]
    ) -> None:
        self.bodies = bodies
        self._issues = findings
        self._cell = cell
        self._arm = arm
        self._engine_: Engine | None = None
        self._thin: dict[Pair, float] = {}
        self._pair_bodies: tuple[tuple[Body, Body], ...] = ()

    @classmethod
    def build(cls, cell: Cell, kinematics: Arm) -> Scene:
        """Return the scene of a cell.

        Args:
            cell: the cell; its mesh files are read now.
            kinematics: the arm of the cell.

        Raises:
            CellError: COL001 a mesh file is missing, cut off or of unknown format, COL002 without
                triangles, COL003 with coordinates that are no numbers, COL004 larger than 10 km,
                COL005 a solid without shape, COL006 numbers in the URDF's collision geometry.
        """
        bodies, findings = bodies_of(cell, kinematics)
        return cls(cell, kinematics, bodies, findings)

    @classmethod
    def shared(cls, cell: Cell, kinematics: Arm) -> Scene:
        """Return the scene of a cell; the same object for the same solids, robot and limits.

        Mesh files are read at the first call only: for cells that are dropped when a file changes.

        Raises:
            CellError: as ``build``.
        """
        return _shared(_ByParts(cell, kinematics))

    def kept(self, more: float) -> Scene:
        """Return the same scene with every clearance larger by ``more`` [m], but within the arm.

        What is planned by it is found good by the scene itself, whatever digits and other places
        of sampling make of the motions.
        """
        engine = self._engine.with_clearance(more)  # first: making it fills in what is copied
        other = copy.copy(self)
        other._engine_ = engine
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Pickle without what can be made again: exact tests belong to one process."""
        return {**self.__dict__, "_engine_": None}

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the tested pairs, in the order in which they are named."""
        return self._engine.names

    @property
    def distances_kept(self) -> FloatArray:
        """(p,) distance [m] below which a pair counts as colliding, 0 where only contact does."""
        return np.where(self._engine.keeps, self._engine.table.margin, 0.0)

    @property
    def external_axes(self) -> tuple[ExternalAxis, ...]:
        """The external axes, whose positions follow the joints."""
        return self._cell.external_axes

    @property
    def pair_bodies(self) -> tuple[tuple[Body, Body], ...]:
        """The solids of the tested pairs: some stand in for those of their names."""
        return self._pair_bodies if self._engine else ()

    @property
    def excluded(self) -> tuple[tuple[str, str], ...]:
        """Pairs of links that touch by construction and are not tested."""
        return self._engine.excluded

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the user should know: no tool solids, stand-ins, open meshes, pairs left out."""
        open_ = [
            Finding(
                Severity.WARNING,
                "COL103",
                f"{body.name} is not closed: a solid wholly inside it would be missed",
                hint="repair the mesh, or leave it if it is a sheet",
            )
            for body, is_closed in zip(self.bodies, self._engine.is_closed, strict=False)
            if not is_closed
        ]
        left_out = [
            Finding(Severity.NOTE, "COL104", f"{one} and {two} touch by construction: not tested")
            for one, two in self.excluded
        ]
        return (*self._issues, *open_, *left_out, *self._thinned())

    def _thinned(self) -> list[Finding]:
        """Return what stands in for pairs that overlap in every pose or by construction."""
        found, first = [], outlines_that_meet(self.bodies)
        for (a, b), share in self._thin.items():
            one, two = self.bodies[a].name, self.bodies[b].name
            if self.bodies[b].kind in TOOL:
                text = f"{one} and {two} overlap in every pose: tested with {one} at {share:.0%}"
                hint = "check the flange frame of the tool's meshes, or give [robot] link_meshes"
                found.append(Finding(Severity.WARNING, "COL105", f"{text} of it", hint=hint))
            elif share < first.get((a, b), 1.0):
                text = f"the outlines of {one} and {two} touch by construction"
                hint = "give [robot] link_meshes or a URDF with collision meshes"
                text += f": tested at {share:.0%} of them"
                found.append(Finding(Severity.NOTE, "COL108", text, hint=hint))
        return found

    def check(
        self,
        q: ArrayLike,
        contact: ArrayLike | None = None,
        tally: Tally | None = None,
        likely: IndexArray | None = None,
    ) -> Hits:
        """Return for each configuration whether it collides, and the first pair that does.

        Args:
            q: (n, 6) [rad].
            contact: (n,) or bool, where cutting solids may touch the workpiece; None: nowhere.
            tally: counts the work done.
            likely: (n,) index into ``pairs`` of one to look at before all others, which is told
                where it collides; -1: none.
        """
        joints = self._rows(q)
        touch = _contact(contact, len(joints))
        return check(self._engine, joints, touch, tally, likely=likely)

    def hits_itself(self, q: ArrayLike) -> BoolArray:
        """Return (n,) whether links and what they carry collide with each other.

        Args:
            q: (n, 6) [rad].
        """
        carried = [WORLD not in (one.link, two.link) for one, two in self.pair_bodies]
        return check(self._engine, self._rows(q), None, only=np.array(carried, dtype=np.bool_)).hit

    def clearance(
        self, q: ArrayLike, contact: ArrayLike | None = None, most: float = np.inf
    ) -> FloatArray:
        """Return the smallest distance (n,) [m] at each configuration, 0 in collision.

        Over all pairs but those of two links of the robot, and of cutting solids and the workpiece,
        which count only when they collide.

        Args:
            q: (n, 6) [rad].
            contact: (n,) or bool, where cutting solids may touch the workpiece.
            most: larger distances [m] are given as this; the smaller, the faster.
        """
        return self.nearest(q, contact, most)[0]

    def nearest(
        self, q: ArrayLike, contact: ArrayLike | None = None, most: float = np.inf
    ) -> tuple[FloatArray, IndexArray]:
        """Return ``clearance``, and which of ``pairs`` (n,) holds it, -1 where none is near."""
        joints = self._rows(q)
        return clearance.clearance(self._engine, joints, _contact(contact, len(joints)), most)

    def meeting_point(self, q: ArrayLike, pair: int) -> FloatArray:
        """Return where one of ``pairs`` meets, or comes nearest, in robroot.

        Args:
            q: (6,) [rad].
            pair: its index.

        Returns:
            (3,) [m].
        """
        return self._engine.meeting_point(self._rows(np.asarray(q)[None])[0], pair)

    def check_paths(
        self,
        q_from: ArrayLike,
        q_to: ArrayLike,
        contact: ArrayLike | None = None,
        resolution: float = RESOLUTION,
        track: ArrayLike | None = None,
    ) -> MotionHits:
        """Return for each straight joint motion whether anything collides on the way.

        Args:
            q_from: (m, 6) [rad].
            q_to: (m, 6) [rad].
            contact: (m,) or bool, motions on which cutting solids may touch the workpiece.
            track: (m,) numbers; motions that stand together with the same number, such as those
                between the samples of a curve, are looked at as one first, which is faster where
                most are free.
            resolution: [m]; contact that is grazed on a shorter way than this may pass.
        """
        start, end = self._rows(q_from), self._rows(q_to)
        touch = _contact(contact, len(start))
        if touch is None:
            touch = np.zeros(len(start), dtype=np.bool_)
        together = None if track is None else np.asarray(track, dtype=np.int64)
        return motion.MotionCheck(self._engine, resolution).run(start, end, touch, together)

    def check_corners(
        self,
        bound: Bound,
        contact: ArrayLike | None = None,
        resolution: float = RESOLUTION,
        coarse: float = COARSE,
    ) -> Hits:
        """Return for each approximated corner (c,) whether anything collides where it may go.

        Args:
            bound: where the arm may go; what is lost is not looked at.
            contact: (c,) or bool, corners at which cutting solids may touch the workpiece.
            resolution: [m]; contact that is grazed on a shorter way than this may pass where point
                and orientation are in step.
            coarse: [m]; what is not proven on ways of this length collides where they are not.
        """
        count = len(bound.lost)
        touch = _contact(contact, count)
        if touch is None:
            touch = np.zeros(count, dtype=np.bool_)
        pair = np.full(count, NO_PAIR, dtype=np.int64)
        hulls = HullCheck(self._engine, resolution, coarse)
        for pieces in bound.pieces:
            rows = np.flatnonzero(pair[pieces.corner] == NO_PAIR)
            corner, q = pieces.corner[rows], pieces.q[rows]
            flat = self._rows(q.reshape(-1, q.shape[-1]))
            met = hulls.pairs_met(
                flat.reshape(*q.shape[:3], flat.shape[1]),
                pieces.slack[rows],
                touch[corner],
                corner,
                count,
            )
            pair = np.where(pair == NO_PAIR, met, pair)
        return Hits(pair != NO_PAIR, pair, self._engine.names)

    def nearest_surface(self, points: ArrayLike) -> SurfacePoints:
        """Return the nearest places on the workpiece: point, outward normal, distance.

        Args:
            points: (n, 3) [m] in BASE, the CAM coordinates.

        Raises:
            CellError: COL007 if the workpiece has no solid.
        """
        return self._surface.nearest(np.asarray(points, dtype=np.float64).reshape(-1, 3))

    def surface_normals(self, points: ArrayLike, farthest: float = np.inf) -> FloatArray:
        """Return outward unit normals (n, 3) of the workpiece where it is nearest to points.

        Args:
            points: (n, 3) [m] in BASE.
            farthest: how far [m] a point may lie off the surface.

        Raises:
            CellError: COL007 if the workpiece has no solid.
            DataError: COL008 naming the first point that lies farther off.
        """
        found = self.nearest_surface(points)
        far = np.flatnonzero(found.distance > farthest)
        if len(far):
            row = int(far[0])
            raise DataError(
                "COL008",
                f"point {row + 1} lies {found.distance[row] / MM:.3g} mm off the workpiece, "
                f"expected at most {farthest / MM:.3g} mm ({len(far)} of {len(found.distance)} "
                "points do)",
                hint="check the units of the points and the workpiece frame",
            )
        return found.normal

    def _rows(self, q: ArrayLike) -> FloatArray:
        """Return configurations (n, 6 + k), external axes at 0 where they are not given."""
        joints = np.atleast_2d(np.asarray(q, dtype=np.float64))
        missing = JOINTS + len(self._cell.external_axes) - joints.shape[-1]
        if joints.ndim != 2 or missing not in (0, len(self._cell.external_axes)):
            raise ValueError(f"configurations of shape {joints.shape}, expected (n, 6 + external)")
        if not np.isfinite(joints).all():
            raise ValueError("configurations must be finite numbers")
        return np.ascontiguousarray(np.pad(joints, ((0, 0), (0, missing))))

    @property
    def _engine(self) -> Engine:
        if self._engine_ is None:
            self._engine_ = self._build_engine()
        return self._engine_

    def _build_engine(self) -> Engine:
        cell, arm = self._cell, self._arm
        behind: list[Body] = []
        if np.isfinite(cell.limits.contact_depth):
            behind = [pulled_back(b, cell, arm) for b in self.bodies if b.kind == "cutting"]
        external = ExternalAxes(cell.external_axes, np.asarray(cell.robot.T_world_robroot))
        limits = (np.asarray(cell.robot.q_min), np.asarray(cell.robot.q_max))
        first = outlines_that_meet(self.bodies)
        rounds = dict.fromkeys(first, 0)
        while True:
            self._thin = {pair: THINNER[n - 1] if n else first[pair] for pair, n in rounds.items()}
            stand_ins, thin = self._thinner(len(self.bodies) + len(behind))
            feet, beside = self._on_rails(len(self.bodies) + len(behind) + len(stand_ins))
            stand_ins, thin = [*stand_ins, *feet], {**thin, **beside}
            bodies = (*self.bodies, *behind, *stand_ins)
            more = len(behind) + len(stand_ins)
            engine = Engine(arm, bodies, more, external, cell.limits.clearance, limits, thin)
            again = [pair for pair in engine.stuck if rounds.get(pair, 0) < len(THINNER)]
            if not again:
                break
            rounds |= {pair: rounds.get(pair, 0) + 1 for pair in again}
        self._pair_bodies = tuple((bodies[a], bodies[b]) for a, b in engine.both)
        return engine

    def _thinner(self, first: int) -> tuple[list[Body], dict[Pair, Pair]]:
        """Return the thinner solids, numbered from ``first`` on, and the pairs they make up."""
        wanted = [
            (number, share)
            for pair, share in self._thin.items()
            for number in pair
            if self.bodies[number].kind == "link"
        ]
        place = {one: first + n for n, one in enumerate(sorted(set(wanted)))}
        thin = {
            (a, b): (place[a, share], place.get((b, share), b))
            for (a, b), share in self._thin.items()
        }
        return [thinner(self.bodies[number], share) for number, share in place], thin

    def _on_rails(self, first: int) -> tuple[list[Body], dict[Pair, Pair]]:
        """Return link 0 above its foot on a rail, as ``_thinner``: for what stands in the room."""
        links = [(n, body) for n, body in enumerate(self.bodies) if body.link == 0]
        if not links or all(axis.kind != "rail" for axis in self._cell.external_axes):
            return [], {}
        # what is generated reaches below the plane that the arm stands on, to have some to spare
        floors = [0.0 if b.is_outline else float(b.vertices[:, 2].min()) for _, b in links]
        feet = [above_foot(body, min(floors)) for _, body in links]
        beside = {
            (number, other): (first + place, other)
            for place, (number, _) in enumerate(links)
            for other, body in enumerate(self.bodies)
            if body.kind == "obstacle"
        }
        return feet, beside

    @property
    def _surface(self) -> Surface:
        meshes = [body.mesh for body in self.bodies if body.kind == "workpiece"]
        if not meshes:
            raise CellError("COL007", "the workpiece has no solid to take normals from")
        T_world_base = self._cell.robot.T_world_robroot @ self._cell.T_robroot_base
        return Surface.of(joined(meshes).moved(inverse(T_world_base)))


def _contact(contact: ArrayLike | None, count: int) -> BoolArray | None:
    if contact is None:
        return None
    return np.broadcast_to(np.asarray(contact, dtype=np.bool_), (count,))


class _ByParts:
    """A cell as a cache key: the objects in it that a scene is made from."""

    def __init__(self, cell: Cell, kinematics: Arm) -> None:
        self.cell, self.kinematics = cell, kinematics
        solids = (cell.robot, cell.tool, *cell.tools, cell.workpiece, *cell.bases, cell.obstacles)
        self._parts = (kinematics, *solids, cell.limits, cell.external_axes)

    def __hash__(self) -> int:
        return hash(tuple(map(id, self._parts)))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, _ByParts)
            and len(self._parts) == len(other._parts)
            and all(map(is_, self._parts, other._parts))
        )


@lru_cache(maxsize=32)
def _shared(key: _ByParts) -> Scene:
    return Scene.build(key.cell, key.kinematics)
