"""A program's text executed from outside: plain patterns, dense continuation, coal, all pairs.

Shares the kinematics, the solids as meshes and nothing else with the checks it judges: the text is
read by its own patterns, path motions are followed pose by pose no more than a millimetre apart,
and corners go along random polynomials within KUKA's rules. Solids are tested in ``solids``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import comb

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.geometry import (
    axis_angle,
    inverse,
    rotation_about,
    rotation_angle,
    rotation_from_abc,
    slerp,
    transform,
)
from postproc.kinematics import Kinematics
from postproc.units import DEG, MM

STEP = 1e-3
"""Longest way [m] of the tool point between two poses on a path."""
TURN = 0.3 * DEG
IN_TUBE = 0.06e-3
"""A cutter this near [m] to the way out of what it has cut touches nothing else."""
JOINT_STEP = 0.02 * DEG
"""Longest way of a joint [rad] between two configurations of a joint motion."""
LEAP = 5.0 * DEG
_WORD = re.compile(r"^ *S?(PTP|LIN|CIRC) (\{.*?\})(?:, ?(\{.*?\}))?((?: C_\w+)*)")
_SPEED = re.compile(r"WITH \$VEL\.CP=([\d.]+)")
_NUMBER = re.compile(r"(\w+) (-?[\d.]+)")
_HALF = 0.5


@dataclass(slots=True)
class Move:
    """A motion of a text: ``word``, where it goes, how it is approximated, its line (1-based).

    ``q`` (6,) [rad] of a joint motion, else ``T_base_tcp`` (4, 4) [m]; ``aux`` (3,) [m] of an arc;
    ``external`` (k,) [m]; ``cdis`` [m], 0 for an exact stop; ``speed`` [m/s].
    """

    word: str
    line: int
    external: FloatArray
    cdis: float
    speed: float
    q: FloatArray | None = None
    T_base_tcp: FloatArray | None = None
    aux: FloatArray | None = None


def moves_of(text: str, axes: int) -> list[Move]:
    """Return the motions of a text with so many external axes.

    Within a spline block corners are exact; behind the last motion of one it says how it ends.
    """
    found: list[Move] = []
    cdis, speed = 0.0, 0.0
    for number, line in enumerate(text.replace("\r", "").split("\n"), 1):
        if line.startswith("$APO.CDIS="):
            cdis = float(line.split("=")[1].split(";")[0]) * MM
        elif line.startswith("$VEL.CP="):
            speed = float(line.split("=")[1].split(";")[0])
        elif line.startswith("ENDSPLINE C_SPL"):
            found[-1].cdis = cdis
        elif match := _WORD.match(line):
            word, first, second, blend = match.groups()
            own = float(said[1]) if (said := _SPEED.search(line)) else speed
            target = {key: float(value) for key, value in _NUMBER.findall(second or first)}
            external = np.array([target[f"E{i + 1}"] * MM for i in range(axes)])
            move = Move(word, number, external, cdis if blend else 0.0, own)
            if "A1" in target:
                move.q = np.array([target[f"A{i}"] for i in range(1, 7)]) * DEG
            else:
                R = rotation_from_abc(np.array([target[key] for key in "ABC"]) * DEG)
                move.T_base_tcp = transform(R, np.array([target[key] for key in "XYZ"]) * MM)
            if second:
                aux = {key: float(value) for key, value in _NUMBER.findall(first)}
                move.aux = np.array([aux[key] for key in "XYZ"]) * MM
            found.append(move)
    return found


@dataclass(slots=True)
class Way:
    """Configurations q (n, 6 + k) of a motion or corner ``move``, with the tool point in BASE.

    ``touch`` (n,): the cutter may touch the workpiece; ``T`` (n, 4, 4) T_base_tcp [m].
    """

    move: int
    what: str
    q: FloatArray
    T: FloatArray
    at_feed: bool
    touch: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))


class Machine:
    """Cell and arm as the program runs in them: one tool, one base, rails only."""

    def __init__(self, cell: Cell, arm: Kinematics) -> None:
        self.cell, self.arm = cell, arm
        self.tool = np.asarray(cell.tool.T_flange_tcp)
        self._rails = np.array([axis.axis for axis in cell.external_axes]).reshape(-1, 3)
        self._T_world_robroot = np.asarray(cell.robot.T_world_robroot)
        self._T_world_base = self._T_world_robroot @ np.asarray(cell.T_robroot_base)

    def T_robroot_base(self, external: FloatArray) -> FloatArray:
        """Return where BASE is seen from the robot (n, 4, 4) with rails at (n, k)."""
        T = np.repeat(self._T_world_robroot[None], len(external), axis=0)
        T[:, :3, 3] += external @ self._rails
        return np.asarray(inverse(T) @ self._T_world_base)

    def tcp(self, q: FloatArray) -> FloatArray:
        """Return T_base_tcp (n, 4, 4) of configurations (n, 6 + k)."""
        return np.asarray(
            inverse(self.T_robroot_base(q[:, 6:])) @ self.arm.fk(q[:, :6]) @ self.tool
        )

    def followed(
        self, ways: Sequence[tuple[FloatArray, FloatArray, FloatArray]]
    ) -> list[FloatArray | None]:
        """Return q (n, 6 + k) along each way, None if the arm leaps.

        A way is poses (n, 4, 4) near to each other, external axes (n, k), and the joints (6,) that
        it comes from.
        """
        if not ways:
            return []
        sizes = [len(T) for T, _, _ in ways]
        external = np.concatenate([values for _, values, _ in ways])
        T = np.concatenate([poses for poses, _, _ in ways])
        slots = np.array([int(self.arm.slot(q)) for _, _, q in ways])
        flange = self.T_robroot_base(external) @ T @ inverse(self.tool)
        found, valid = self.arm.ik_in(flange, np.repeat(slots, sizes))
        parts = []
        for end, size, (_, values, q) in zip(np.cumsum(sizes), sizes, ways, strict=True):
            rows = slice(end - size, end)
            way = np.unwrap(np.vstack([q, found[rows]]), axis=0)
            leaps = np.abs(np.diff(way, axis=0)).max(initial=0.0) > LEAP
            lost = leaps or not valid[rows].all()
            parts.append(None if lost else np.hstack([way[1:], values]))
        return parts


class Course:
    """A motion as a curve over its share 0..1: joints of a joint motion, poses of a path motion."""

    def __init__(self, machine: Machine, move: Move, q: FloatArray) -> None:
        self._machine, self.move, self.start = machine, move, q
        self.is_path = move.word != "PTP"
        self._from = machine.tcp(q[None])[0]
        if move.q is not None:
            self._end = np.concatenate([move.q, move.external])
            self._to = machine.tcp(self._end[None])[0]
        else:
            self._to = np.asarray(move.T_base_tcp)
            self._end = np.concatenate([q[:6], move.external])
        axis, angle = axis_angle(self._from[None, :3, :3], self._to[None, :3, :3])
        self._axis, self._angle = axis[0], float(angle[0])
        self._circle = None if move.aux is None else _circle(self._from, move.aux, self._to)
        self.length = float(np.linalg.norm(self._to[:3, 3] - self._from[:3, 3]))
        if self._circle is not None:
            self.length = self._circle[2] * float(
                np.linalg.norm(self._from[:3, 3] - self._circle[0])
            )
        way = self._dense()
        self.is_lost = way is None
        self.way = np.zeros((0, len(q))) if way is None else way
        self.T = machine.tcp(self.way)

    def poses(self, share: FloatArray) -> FloatArray:
        """Return T_base_tcp (n, 4, 4) of a path motion."""
        R = self._from[:3, :3] @ rotation_about(self._axis, self._angle * share)
        a, b = self._from[:3, 3], self._to[:3, 3]
        if self._circle is None:
            return transform(R, a + share[:, None] * (b - a))
        centre, normal, sweep = self._circle
        turned = rotation_about(normal, sweep * share) @ (a - centre)
        return transform(R, centre + turned)

    def _dense(self) -> FloatArray | None:
        """Return dense configurations (n, 6 + k) from start to end, None if the arm leaps."""
        way = self._end - self.start
        if not self.is_path:
            count = 2 + int(np.abs(way).max() / JOINT_STEP)
            return np.asarray(self.start + np.linspace(0.0, 1.0, count)[:, None] * way)
        size = max(self.length / STEP, float(self._angle) / TURN, 1.0)
        size = max(size, float(np.abs(way[6:]).max(initial=0.0)) / STEP)
        share = np.linspace(0.0, 1.0, int(np.ceil(size)) + 1)
        external = self.start[6:] + share[:, None] * way[6:]
        return self._machine.followed([(self.poses(share), external, self.start[:6])])[0]

    def near_end(self, distance: float) -> int:
        """Return the row of the way from which on it may be approximated towards its end.

        There the tool is ``distance`` [m] off the end, and not before the middle.
        """
        if self.is_path:
            part = min(distance / max(self.length, 1e-9), _HALF)
            return int(np.ceil((1.0 - part) * (len(self.way) - 1)))
        p = self.T[:, :3, 3]
        off = np.flatnonzero(np.linalg.norm(p - p[-1], axis=1) > distance)
        return max(int(off[-1]) + 1 if len(off) else 0, int(np.ceil(_HALF * (len(self.way) - 1))))

    def near_start(self, distance: float) -> int:
        """Return the row up to which the way may be approximated from its start."""
        if self.is_path:
            return int(min(distance / max(self.length, 1e-9), _HALF) * (len(self.way) - 1))
        p = self.T[:, :3, 3]
        off = np.flatnonzero(np.linalg.norm(p - p[0], axis=1) > distance)
        most = int(_HALF * (len(self.way) - 1))
        return min(int(off[0]) - 1, most) if len(off) else most


def _circle(
    start: FloatArray, aux: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return centre, normal and sweep of the arc through three points."""
    a, b, c = start[:3, 3], aux, end[:3, 3]
    ab, ac = b - a, c - a
    normal = np.cross(ab, ac)
    square = float(normal @ normal)
    centre = a + (np.cross(normal, ab) * (ac @ ac) + np.cross(ac, normal) * (ab @ ab)) / (
        2.0 * square
    )
    normal = normal / np.sqrt(square)
    u, v = a - centre, c - centre
    angle = float(np.arctan2(normal @ np.cross(u, v), u @ v))
    return centre, normal, angle % (2.0 * np.pi)


def ways_of(
    machine: Machine, moves: Sequence[Move], rng: np.random.Generator, feed: float, variants: int
) -> list[Way]:
    """Return the ways of all motions, exact and along random corners, in order.

    ``feed``: path motions up to this speed [m/s] cut. A motion that cannot be followed has no way:
    its ``what`` says so, and nothing comes behind it.
    """
    q = np.concatenate([np.asarray(moves[0].q), moves[0].external])
    courses: list[Course] = []
    for move in moves[1:]:
        courses.append(Course(machine, move, q))
        if courses[-1].is_lost:
            break
        q = courses[-1].way[-1]
    found = [
        (number, Way(number, "lost" if course.is_lost else "motion", course.way, course.T, cuts))
        for number, course in enumerate(courses, 1)
        for cuts in [is_cut(course.move, feed)]
    ]
    blended = [
        number
        for number, (course, behind) in enumerate(pairwise(courses), 1)
        if course.move.cdis > 0.0 and not behind.is_lost
    ]
    corners = _corners(machine, courses, np.repeat(blended, variants).tolist(), rng)
    for number, (q_way, T) in corners:
        both = is_cut(moves[number], feed) and is_cut(moves[number + 1], feed)
        found.append((number, Way(number, "corner", q_way, T, both)))
    # corners stand behind the motion to them; the sort is stable
    return [way for _, way in sorted(found, key=lambda one: one[0])]


def is_cut(move: Move, feed: float) -> bool:
    """Return whether a motion is a path motion at feed."""
    return move.word != "PTP" and move.speed <= feed


def _corners(
    machine: Machine, courses: Sequence[Course], numbers: Sequence[int], rng: np.random.Generator
) -> list[tuple[int, tuple[FloatArray, FloatArray]]]:
    """Return configurations (n, 6 + k) and tool poses along a random polynomial round corners.

    ``numbers``: motions, counted from 1, at whose ends they are; none if the arm cannot follow.
    """
    ways: list[FloatArray | None] = []
    todo: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for number in numbers:
        corner = _corner(machine, courses[number - 1], courses[number], rng)
        is_joint = not isinstance(corner, tuple)
        ways.append(corner if is_joint else None)
        todo += [] if is_joint else [corner]
    followed = iter(machine.followed(todo))
    nothing = np.zeros((0, len(courses[0].start)))
    rows = [next(followed) if way is None else way for way in ways]
    q = [nothing if way is None else way for way in rows]
    T = machine.tcp(np.concatenate([nothing, *q]))
    parts = np.split(T, np.cumsum([len(way) for way in q])[:-1]) if q else []
    return list(zip(numbers, zip(q, parts, strict=True), strict=True))


def _corner(
    machine: Machine, before: Course, behind: Course, rng: np.random.Generator
) -> FloatArray | tuple[FloatArray, FloatArray, FloatArray]:
    """Return a random corner between two motions: configurations, or what is to be followed."""
    distance = before.move.cdis
    low, high = before.near_end(distance), behind.near_start(distance)
    low += int(rng.uniform() ** 4 * (len(before.way) - 1 - low))
    high -= int(rng.uniform() ** 4 * high)
    a, q, b = before.way[low], before.way[-1], behind.way[high]
    paths = before.is_path + behind.is_path
    if not paths or (paths == 1 and rng.uniform() < _HALF):
        u, v, w = weights(rng, 3 + int(max(np.abs(a - q).max(), np.abs(b - q).max()) / JOINT_STEP))
        return np.asarray(u[:, None] * a + v[:, None] * q + w[:, None] * b)
    T = np.stack([before.T[low], before.T[-1], behind.T[high]])
    size = float(sum(np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))) / STEP
    size = max(size, float(np.abs(np.diff([a[6:], q[6:], b[6:]], axis=0)).sum()) / STEP)
    turn = sum(float(rotation_angle(T[i, :3, :3], T[1, :3, :3])) for i in (0, 2)) / TURN
    u, v, w = weights(rng, int(max(size, turn)) + 3)
    p = u[:, None] * T[0, :3, 3] + v[:, None] * T[1, :3, 3] + w[:, None] * T[2, :3, 3]
    u2, v2, w2 = weights(rng, len(u)) if rng.uniform() < _HALF else (u, v, w)
    turned = mixed_rotations(T, u2, v2, w2)
    external = u[:, None] * a[6:] + v[:, None] * q[6:] + w[:, None] * b[6:]
    return transform(turned, p), external, a[:6]


def mixed_rotations(T: FloatArray, u: FloatArray, v: FloatArray, w: FloatArray) -> FloatArray:
    """Return mixtures (n, 3, 3) of the rotations of three poses (3, 4, 4) by weights (n,)."""
    pull = np.where(v + w > 0.0, w / np.maximum(v + w, 1e-12), 0.0)
    R = [np.broadcast_to(one[:3, :3], (len(u), 3, 3)) for one in T]
    return np.asarray(slerp(R[0], slerp(R[1], R[2], pull), 1.0 - u))


def weights(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the weights (n,) of start, corner and end along a random Bezier curve."""
    before = np.sort(rng.uniform(0.0, 1.0, rng.integers(1, 3)))
    behind = np.sort(rng.uniform(0.0, 1.0, rng.integers(1, 3)))[::-1]
    start = np.array([1.0, *(1.0 - before), *(0.0 * behind), 0.0])
    end = np.array([0.0, *(0.0 * before), *(1.0 - behind), 1.0])
    s, n = np.linspace(0.0, 1.0, count), len(start) - 1
    basis = np.array([comb(n, i) * s**i * (1.0 - s) ** (n - i) for i in range(n + 1)])
    u, w = start @ basis, end @ basis
    return u, np.clip(1.0 - u - w, 0.0, 1.0), w


def allowed(ways: Sequence[Way], axis_tcp: FloatArray) -> None:
    """Set where the cutter may touch the workpiece: at feed, and on the way out of what it has cut.

    Out of what it has cut: its tip is on the line from where it has been at feed, backwards along
    the tool axis. What it takes up there it, or its holder, has taken up before.
    """
    tips: list[FloatArray] = []
    axes: list[FloatArray] = []
    for way in ways:
        if way.at_feed:
            way.touch = np.ones(len(way.q), dtype=np.bool_)
            if not len(way.q):
                continue
            tips.append(way.T[:, :3, 3])
            axes.append(way.T[:, :3, :3] @ axis_tcp)
            continue
        way.touch = np.zeros(len(way.q), dtype=np.bool_)
        if not tips:
            continue
        way.touch = _in_tubes(way.T, axis_tcp, np.concatenate(tips[-60:]), axes[-60:])


def _in_tubes(
    T: FloatArray, axis_tcp: FloatArray, tips: FloatArray, axes: list[FloatArray]
) -> np.ndarray:
    """Return which tools (n,) are on the way out of where tips (m, 3) have been, along axes."""
    axis, at = T[:, :3, :3] @ axis_tcp, T[:, :3, 3] - tips[0]
    tips = tips - tips[0]
    along = axis @ tips.T - np.einsum("ni,ni->n", axis, at)[:, None]
    square = (at**2).sum(axis=1)[:, None] - 2.0 * at @ tips.T + (tips**2).sum(axis=1)
    near = (square - along**2 < IN_TUBE**2) & (along > -IN_TUBE)
    return np.asarray((near & (axis @ np.concatenate(axes).T > np.cos(0.3 * DEG))).any(axis=1))
