"""The holes and points of two programs, and which one became which.

A hole is what a program does along one line of the tool at one CAM line; where no comment names
that line, at one place. Joint motions belong to the object that they lead to.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from postproc.arrays import FloatArray, IndexArray, longest_rising
from postproc.comparison.difference import DiffTolerance
from postproc.comparison.lines import Compared, Program
from postproc.geometry import rotation_angle, rotation_from_abc
from postproc.records import dataclass
from postproc.units import DEG, MM

NEAR_MM = 0.02
"""Points that are nearer are the same place: some digits of a program, far below any edit."""
FAR_MM = 120.0
"""Farther apart, one object less and one more are not one that was moved."""
_STROKE_MM = 0.1
"""A shorter way has no direction in the digits of a program."""
_TILT = 1e-4
"""Tilt [deg] that is in the last digits of A, B, C."""
_STRAIGHT = 1.0 - 1e-6


@dataclass(frozen=True, slots=True)
class Place:
    """A hole or point: its motions along a path, the joint motions to it, and its CAM line.

    ``points`` (k, 3) [mm] and ``R`` (k, 3, 3) of ``path`` (k,) rows of the trace.
    """

    path: IndexArray
    joints: IndexArray
    points: FloatArray
    R: FloatArray
    cam: int

    def deepest(self, axis: FloatArray) -> int:
        """Return which point lies farthest along the tool; ``axis`` (3,) in the TCP frame."""
        return int(np.argmax(self.points @ (self.R[0] @ axis)))

    def highest(self, axis: FloatArray) -> tuple[int, int]:
        """Return which point lies highest above the deepest one, and how many lie lower.

        Of those in line with it: the others, like joint motions, are a way to there.
        """
        k = self.deepest(axis)
        tool, way = self.R[k] @ axis, self.points[k] - self.points
        up = way @ tool
        in_line = np.linalg.norm(way - up[:, None] * tool, axis=1) < NEAR_MM
        top = int(np.argmax(np.where(in_line, np.round(up / NEAR_MM), -1.0)))
        return top, int((in_line & (up < up[top] - NEAR_MM)).sum())


def places_of(program: Program, *, has_home: bool) -> list[Place]:
    """Return the places of a program in order; none of one without motions along a path.

    ``has_home``: its first motion goes home, not to a place.
    """
    trace = program.trace
    path = np.flatnonzero(~trace.is_axes)
    points = np.nan_to_num(trace.target[path, :3]) / MM
    R = rotation_from_abc(np.nan_to_num(trace.target[path, 3:]))
    heads = _heads(points, np.nan_to_num(trace.target[path, 3:]), program.cam[path])
    stops = [*heads[1:], len(path)]
    axes = np.flatnonzero(trace.is_axes)
    axes = axes[1:] if has_home else axes
    # joint motions lead to the next place; those behind the last one lead away
    split = np.searchsorted(axes, path[heads]) if heads else np.zeros(0, dtype=np.int64)
    found = []
    for number, (a, b) in enumerate(zip(heads, stops, strict=False)):
        own = axes[split[number - 1] if number else 0 : split[number]]
        cam = int(program.cam[path[a]])
        found.append(Place(path[a:b], own, points[a:b], R[a:b], cam))
    return found


def _heads(points: FloatArray, abc: FloatArray, cam: IndexArray) -> list[int]:
    """Return where another place begins."""
    heads: list[int] = []
    for k in range(len(points)):
        if heads and cam[k] and cam[k] == cam[k - 1]:
            continue
        is_straight = heads and not cam[k] and not cam[k - 1] and np.array_equal(abc[k], abc[k - 1])
        if is_straight and (k - 1 == heads[-1] or _in_line(points, heads[-1], k)):
            continue
        heads.append(k)
    return heads


def _in_line(points: FloatArray, head: int, k: int) -> bool:
    first, last = points[head + 1] - points[head], points[k] - points[k - 1]
    size = float(np.linalg.norm(first) * np.linalg.norm(last))
    return size == 0.0 or abs(float(first @ last)) > _STRAIGHT * size


def tool_axis(old: list[Place], new: list[Place], compared: Compared) -> FloatArray:
    """Return the axis (3,) of the TCP frame along which tools work: +-x, +-y or +-z; 0 if unknown.

    The first stroke of a hole goes into the part. Without holes it is the axis about which the
    program turns the tool, or one program against the other; its sense is not known then.
    """
    votes = np.zeros((2, 3))
    for place in (*old, *new):
        if len(place.points) > 1 and np.array_equal(place.R[0], place.R[1]):
            stroke = place.R[0].T @ (place.points[1] - place.points[0])
            length = float(np.linalg.norm(stroke))
            k = int(np.argmax(np.abs(stroke)))
            if length > _STROKE_MM and abs(stroke[k]) > _STRAIGHT * length:
                votes[int(stroke[k] < 0.0), k] += 1
    if not votes.any():
        votes[0] = _turning(old, new, compared)
    sign, column = divmod(int(np.argmax(votes)), 3)
    axis = np.zeros(3)
    axis[column] = 0.0 if not votes.any() else -1.0 if sign else 1.0
    return axis


def _turning(old: list[Place], new: list[Place], compared: Compared) -> FloatArray:
    """Return how many turns (3,) of tools are about each axis of the TCP frame."""
    sides = [np.concatenate([p.R for p in side]) for side in (old, new) if side]
    turns = [(R[:-1], R[1:]) for R in sides]
    at = compared.distance < NEAR_MM * MM
    at &= ~compared.old.trace.is_axes[compared.old_motion]
    i, j = compared.old_motion[at], compared.new_motion[at]
    abc = compared.old.trace.target[i, 3:], compared.new.trace.target[j, 3:]
    turns.append(
        (rotation_from_abc(np.nan_to_num(abc[0])), rotation_from_abc(np.nan_to_num(abc[1])))
    )
    votes = np.zeros(3)
    for R_a, R_b in turns:
        M = np.swapaxes(R_a, 1, 2) @ R_b
        axes = np.stack(
            [M[:, 2, 1] - M[:, 1, 2], M[:, 0, 2] - M[:, 2, 0], M[:, 1, 0] - M[:, 0, 1]], 1
        )
        size = np.linalg.norm(axes, axis=1)
        is_one = np.abs(axes).max(axis=1) > (1.0 - 1e-4) * size
        turned = axes[is_one & (size > 1e-4)]
        votes += np.bincount(np.abs(turned).argmax(axis=1), minlength=3)
    return votes


@dataclass(frozen=True, slots=True)
class Shift:
    """How a place moved [mm]: its deepest point by ``xyz`` (3,), ``deeper`` along the tool.

    ``further``: along the tool the point that moved most unlike it; ``across``: any of them.
    """

    xyz: FloatArray
    deeper: float
    further: float
    across: float
    tilt_deg: float

    @classmethod
    def of(cls, a: Place, b: Place, axis: FloatArray) -> Shift:
        """Return the shift between two versions of a place; ``axis``: of the tool in the TCP."""
        k, n = a.deepest(axis), b.deepest(axis)
        tool, other = a.R[k] @ axis, b.R[n] @ axis
        tops = b.points[b.highest(axis)[0]] - a.points[a.highest(axis)[0]]
        steps = np.array([b.points[n] - a.points[k], tops])
        if len(a.points) == len(b.points):
            steps = np.vstack([steps, b.points - a.points])
        along = steps @ tool
        across = np.linalg.norm(steps - along[:, None] * tool, axis=1)
        tilt = float(np.arctan2(np.linalg.norm(np.cross(tool, other)), tool @ other)) / DEG
        if not axis.any():
            tilt = float(rotation_angle(a.R[k], b.R[n])) / DEG
        # the deepest point speaks for all, but for those of an arc or of a hand's edit
        worst = 0 if across[0] >= across.max() - NEAR_MM else int(np.argmax(across))
        further = along[int(np.argmax(np.abs(along - along[0])))]
        return cls(
            steps[worst],
            float(along[worst]),
            float(further),
            float(across.max()),
            tilt if tilt > _TILT else 0.0,
        )

    @property
    def size(self) -> float:
        """How far the deepest point moved [mm]."""
        return float(np.linalg.norm(self.xyz))

    def is_moved(self, limits: DiffTolerance) -> bool:
        """Whether the place is another one: it moved across, as a whole along, or is tilted."""
        is_whole = abs(self.deeper - self.further) <= limits.position_mm < abs(self.deeper)
        return is_whole or self.across > limits.position_mm or self.tilt_deg > limits.angle_deg


@dataclass(frozen=True, slots=True)
class Matched:
    """Pairs (old, new) that are one object, in order of the new program, and what is alone.

    ``swapped``: pairs that stand in another order.
    """

    pairs: list[tuple[int, int]]
    swapped: list[tuple[int, int]]
    removed: list[int]
    added: list[int]


def match(old: list[Place], new: list[Place], axis: FloatArray, compared: Compared) -> Matched:
    """Return which place of the new program is which one of the old one.

    Places where the tool does the same are the same, whatever their order; between these, what is
    left over on both sides was moved.
    """
    same = _same(old, new, axis)
    chain = longest_rising([j for _, j in same])
    anchors = [same[k] for k in chain]
    swapped = sorted(set(same) - set(anchors))
    moved = list(_moved(old, new, anchors, swapped, compared))
    pairs = [*same, *moved]
    gone = set(range(len(old))) - {i for i, _ in pairs}
    fresh = set(range(len(new))) - {j for _, j in pairs}
    return Matched(sorted(pairs, key=lambda p: p[1]), swapped, sorted(gone), sorted(fresh))


def _feature(places: list[Place], axis: FloatArray) -> FloatArray:
    """Return (n, 9): highest and deepest point [mm], tool axis scaled as mm at 100 mm."""
    ends = ((p, p.highest(axis)[0], p.deepest(axis)) for p in places)
    rows = [(*p.points[top], *p.points[k], *(100.0 * (p.R[k] @ axis))) for p, top, k in ends]
    return np.array(rows).reshape(-1, 9)


def _same(old: list[Place], new: list[Place], axis: FloatArray) -> list[tuple[int, int]]:
    if not old or not new:
        return []
    tree = cKDTree(_feature(new, axis))
    near: Any = tree.query_ball_point(_feature(old, axis), NEAR_MM)
    used: set[int] = set()
    found = []
    for i, candidates in enumerate(near):
        free = [j for j in candidates if j not in used]
        if free:
            j = min(free, key=lambda j: (abs(j - i), j))
            used.add(j)
            found.append((i, j))
    return found


def _moved(
    old: list[Place],
    new: list[Place],
    anchors: list[tuple[int, int]],
    swapped: list[tuple[int, int]],
    compared: Compared,
) -> Iterator[tuple[int, int]]:
    """Yield the pairs among what is left over between two neighbouring anchors."""
    taken_old, taken_new = {i for i, _ in swapped}, {j for _, j in swapped}
    partner = _partners(old, new, compared)
    bounds = [(-1, -1), *anchors, (len(old), len(new))]
    for (a, c), (b, d) in pairwise(bounds):
        left = [i for i in range(a + 1, b) if i not in taken_old]
        right = [j for j in range(c + 1, d) if j not in taken_new]
        if len(left) == len(right):
            yield from zip(left, right, strict=True)
            continue
        for i in left:
            j = partner.get(i, -1)
            if j in right and _distance(old[i], new[j]) < FAR_MM:
                right.remove(j)
                yield i, j


def _distance(a: Place, b: Place) -> float:
    return float(np.linalg.norm(a.points[0] - b.points[0]))


def _partners(old: list[Place], new: list[Place], compared: Compared) -> dict[int, int]:
    """Return the place of the new program that holds the line taken for the first of an old one."""
    owner = {int(row): j for j, place in enumerate(new) for row in place.path}
    line = dict(zip(compared.old_motion.tolist(), compared.new_motion.tolist(), strict=True))
    found = {}
    for i, place in enumerate(old):
        j = next((owner[line[r]] for r in place.path.tolist() if line.get(r) in owner), None)
        if j is not None:
            found[i] = j
    return found
