"""All pairs of solids of a cell on dense ways, by coal: nothing of the checks it judges is used.

A stretch of the way is skipped only where everything is farther apart than any point can move on
it, by the lengths of the arm alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import coal  # noqa: F401 - registers the types of the geometry requests
import numpy as np
import pinocchio as pin

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.collision.bodies import WORLD, Body
from postproc.kinematics import Kinematics
from tools.bench.collision import coal_mesh

LEVELS = 1e-3 * 2.0 ** np.arange(11)
"""Margins [m] by which a stretch may be told free as a whole, 1 mm to 1 m."""
BY_STOPS = {(3, 5), (4, 6)}
"""Links of a wrist that its mechanical stops keep apart, whatever hulls say."""
OUTLINES_BY_STOPS = {(0, 2), (2, 4)}
"""Links whose outlines meet, thicker than they are, where stops of A2 and A3 keep them apart."""


class Judge:
    """All pairs of solids of a cell, by coal."""

    def __init__(self, cell: Cell, arm: Kinematics, clearance: float) -> None:
        scene = Scene.build(cell, arm)
        self._bodies = list(scene.bodies)
        self._rails = len(cell.external_axes)
        self._model = pin.Model()
        place, joint = pin.SE3(np.asarray(cell.robot.T_world_robroot)), 0
        for axis in cell.external_axes:
            slide = pin.JointModelPrismaticUnaligned(np.asarray(axis.axis))
            joint = self._model.addJoint(joint, slide, pin.SE3.Identity(), axis.name)
        foot = joint
        joints = []
        for number, (T, axis) in enumerate(
            zip(arm.chain.placements[:6], arm.chain.axes, strict=True)
        ):
            step = pin.SE3(T) if number else place * pin.SE3(T)
            joint = self._model.addJoint(
                joint, pin.JointModelRevoluteUnaligned(axis), step, f"a{number}"
            )
            joints.append(joint)
        self._geometry = pin.GeometryModel()
        for body in self._bodies:
            carrier = 0 if body.link == WORLD else foot if body.link == 0 else joints[body.link - 1]
            at = place if body.link == 0 else pin.SE3.Identity()
            thing = pin.GeometryObject(body.name, carrier, at, coal_mesh(body.mesh))
            self._geometry.addGeometryObject(thing)
        self._data = self._model.createData()
        self._reach = np.r_[np.ones(self._rails), _reaches(self._bodies, arm)]
        self._pairs(cell, arm, clearance)

    def _pairs(self, cell: Cell, arm: Kinematics, clearance: float) -> None:
        bodies = self._bodies
        pairs = [
            (a, b)
            for a in range(len(bodies))
            for b in range(a + 1, len(bodies))
            if _can_meet(bodies[a], bodies[b])
        ]
        drop = self._always_touching(pairs, cell)
        pairs = [pair for pair in pairs if pair not in drop]
        self.names = [(bodies[a].name, bodies[b].name) for a, b in pairs]
        margin = np.array([_margin(bodies[a], bodies[b], clearance) for a, b in pairs])
        self._cuts = [
            bodies[a].kind == "cutting" and bodies[b].kind == "workpiece" for a, b in pairs
        ]
        self._geometry.removeAllCollisionPairs()
        for a, b in pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(a, b))
        self._sets = {
            (level, touch): self._set(margin + more, touch)
            for level, more in enumerate((0.0, *LEVELS))
            for touch in (False, True)
        }

    def _set(self, margin: FloatArray, touch: bool) -> pin.GeometryData:
        data = self._geometry.createData()
        for number, value in enumerate(margin.tolist()):
            data.collisionRequests[number].security_margin = value
            if touch and self._cuts[number]:
                data.deactivateCollisionPair(number)
        return data

    def _always_touching(self, pairs: list[tuple[int, int]], cell: Cell) -> set[tuple[int, int]]:
        """Return the pairs of the arm and its tool that touch in most poses: by construction."""
        own = [(a, b) for a, b in pairs if bodies_move(self._bodies[a], self._bodies[b])]
        for a, b in own:
            self._geometry.addCollisionPair(pin.CollisionPair(a, b))
        data = self._geometry.createData()
        rng = np.random.default_rng(0)
        low, high = np.asarray(cell.robot.q_min), np.asarray(cell.robot.q_max)
        counts = np.zeros(len(own))
        for q in rng.uniform(low, high, (60, 6)):
            row = np.r_[np.zeros(self._rails), q]
            pin.computeCollisions(self._model, self._data, self._geometry, data, row, False)
            counts += [result.isCollision() for result in data.collisionResults]
        return {pair for pair, count in zip(own, counts, strict=True) if count > 30}

    def met(self, q: FloatArray, touch: np.ndarray) -> str:
        """Return a pair that comes nearer than allowed on a dense way q (n, 6 + k), or nothing.

        No way at all is one that the arm cannot follow.
        """
        if not len(q):
            return "the arm leaves its posture"
        rows = np.hstack([q[:, 6:], q[:, :6]])
        step = np.abs(np.diff(rows, axis=0)) @ self._reach
        place = np.concatenate([[0.0], np.cumsum(step)])
        parts = np.flatnonzero(np.diff(touch)) + 1
        for low, high in pairwise([0, *parts.tolist(), len(rows)]):
            hit = self._search(rows, place, low, high - 1, bool(touch[low]))
            if hit:
                return hit
        return ""

    def _search(self, rows: FloatArray, place: FloatArray, low: int, high: int, touch: bool) -> str:
        stack = [(low, high)]
        while stack:
            low, high = stack.pop()
            half = 0.5 * (place[low] + place[high])
            middle = int(np.clip(np.searchsorted(place, half), low, high))
            way = max(place[middle] - place[low], place[high] - place[middle])
            level = int(np.searchsorted(LEVELS, way)) + 1
            if (
                high > low
                and level <= len(LEVELS)
                and not self._collide(rows[middle], level, touch)
            ):
                continue
            if self._collide(rows[middle], 0, touch):
                return self._name(touch)
            stack += [
                part for part in ((low, middle - 1), (middle + 1, high)) if part[0] <= part[1]
            ]
        return ""

    def _collide(self, row: FloatArray, level: int, touch: bool) -> bool:
        data = self._sets[level, touch]
        return bool(pin.computeCollisions(self._model, self._data, self._geometry, data, row, True))

    def _name(self, touch: bool) -> str:
        data = self._sets[0, touch]
        for name, result in zip(self.names, data.collisionResults, strict=True):
            if result.isCollision():
                return " and ".join(name)
        return "?"


def bodies_move(one: Body, two: Body) -> bool:
    """Return whether both solids are of the arm or its tool."""
    return one.link != WORLD and two.link != WORLD


def _can_meet(one: Body, two: Body) -> bool:
    """Return whether two solids are no neighbours by construction."""
    if one.link == two.link:
        return False
    if WORLD in (one.link, two.link):
        return not (0 in (one.link, two.link) and "obstacle" in (one.kind, two.kind))
    if "link" == one.kind == two.kind:
        apart = BY_STOPS | (OUTLINES_BY_STOPS if one.is_outline and two.is_outline else set())
        return (two.link - one.link > 1) and (one.link, two.link) not in apart
    return True


def _margin(one: Body, two: Body, clearance: float) -> float:
    """Return the distance that two solids must keep [m]."""
    if one.kind == "cutting" and two.kind == "workpiece":
        return 0.0
    if bodies_move(one, two) and (
        one.kind == two.kind == "link"
        or (max(one.link, two.link) == 6 and min(one.link, two.link) == 5)
    ):
        return 0.0
    return clearance


def _reaches(bodies: Sequence[Body], arm: Kinematics) -> FloatArray:
    """Return how far (6,) [m] any point of the arm or its tool can be from each joint's axis."""
    own = np.zeros(7)
    for body in bodies:
        if body.link > 0:
            size = float(np.linalg.norm(body.vertices, axis=1).max())
            own[body.link] = max(own[body.link], size)
    steps = [float(np.linalg.norm(T[:3, 3])) for T in arm.chain.placements]
    reach = np.zeros(6)
    for joint in range(6):
        way, most = 0.0, 0.0
        for link in range(joint + 1, 7):
            most = max(most, way + own[link])
            if link < 6:
                way += steps[link]
        reach[joint] = most
    return reach
