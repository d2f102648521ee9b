"""The measuring plan of space gridding: which tags, in which postures, in which order.

A box is cut into cells; each cell has nine tags, its corners and its centre, corners shared by
neighbours are measured once; at each tag the tool takes several postures by rotating about one of
its axes (Jiao et al. 2022, Section 2.2, Figure 1: the y axis by -10, 0, +10 degrees). Only
postures that the arm reaches within its limits, away from the straight wrist and free of
collision stay, and they are ordered for short travel.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.errors import StiffnessError
from postproc.geometry import inverse, rotation_about, transform
from postproc.kinematics import Kinematics, wrist_distance
from postproc.records import dataclass
from postproc.stiffness.field import Grid, kernel, lattice
from postproc.units import DEG, MM

IsFree = Callable[[FloatArray], BoolArray]
"""Joint angles (n, 6) [rad] to (n,) free of collision."""

MOST_TAGS = 20_000
REASONS = ("", "out of reach", "joint limit", "straight wrist", "collision")


@dataclass(frozen=True, slots=True)
class SamplingRules:
    """What a posture has to keep.

    ``axis`` (3,) tool axis of the rotations, TCP axes; ``angles`` (a,) [rad]; ``R_robroot_tcp``
    (3, 3) of the initial posture, None: the axis-parallel one that reaches most tags;
    ``joint_margin`` and ``singularity`` [rad].
    """

    axis: FloatArray
    angles: FloatArray
    R_robroot_tcp: FloatArray | None = None
    joint_margin: float = 2.0 * DEG
    singularity: float = 5.0 * DEG


@dataclass(frozen=True, slots=True)
class SamplingPlan:
    """Postures in the order of measuring.

    grid; points (t, 3) tags [m], robroot; cells: cell numbers of each tag; tag (n,) and angle
    (n,) [rad] of each posture; q (n, 6); R_robroot_tcp (3, 3) of the initial posture; dropped:
    (tag, angle index, reason) of postures left out.
    """

    grid: Grid
    points: FloatArray
    cells: tuple[tuple[int, ...], ...]
    tag: IntArray
    angle: FloatArray
    q: FloatArray
    R_robroot_tcp: FloatArray
    dropped: tuple[tuple[int, int, str], ...]

    def __len__(self) -> int:
        """Return the number of postures."""
        return len(self.q)

    def rows(self, index: IntArray) -> SamplingPlan:
        """Return some of the postures, in this order."""
        return replace(self, tag=self.tag[index], angle=self.angle[index], q=self.q[index])

    def name(self, index: int) -> str:
        """Return the name of a posture: tag and angle."""
        return f"T{int(self.tag[index]) + 1:04d}{round(self.angle[index] / DEG):+d}"


def box_grid(low: FloatArray, high: FloatArray, edge: float) -> Grid:
    """Return the grid that fills a box exactly with cells nearest to cubes of ``edge`` [m].

    Raises:
        StiffnessError: STF020 for a box without volume, STF021 for too many tags.
    """
    span = np.asarray(high, dtype=np.float64) - np.asarray(low, dtype=np.float64)
    if edge <= 0.0 or not bool(np.all(np.isfinite(span))) or bool(np.any(span <= 0.0)):
        raise StiffnessError(
            "STF020",
            f"the box spans {span[0] / MM:g} x {span[1] / MM:g} x {span[2] / MM:g} mm in cells of "
            f"{edge / MM:g} mm, expected the lowest corner first and a positive edge",
        )
    counts = np.maximum(np.rint(span / edge), 1.0)
    if float(np.prod(counts)) > MOST_TAGS:
        raise StiffnessError("STF021", f"{np.prod(counts):g} cells, at most {MOST_TAGS}")
    nx, ny, nz = (int(n) for n in counts)
    return Grid(np.asarray(low, dtype=np.float64), span / counts, (nx, ny, nz))


def grid_tags(grid: Grid) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """Return the tags (t, 3) [m] of all cells, each corner once, and the cells of each tag.

    Corners come first, with z fastest, then centres in the order of the cells.
    """
    counts = np.asarray(grid.counts)
    corners, centres = lattice((counts + 1).tolist()), lattice(grid.counts)
    points = grid.origin + np.concatenate([corners, centres + 0.5]) * grid.size
    cells: list[tuple[int, ...]] = []
    for corner in corners:
        near = [corner - shift for shift in itertools.product((1, 0), repeat=3)]
        inside = [cell for cell in near if np.all(cell >= 0) and np.all(cell < counts)]
        cells.append(tuple(int(grid.number(cell.astype(np.int32))) for cell in inside))
    cells += [(int(grid.number(cell.astype(np.int32))),) for cell in centres]
    return np.asarray(points), tuple(cells)


def plan_sampling(
    grid: Grid,
    kinematics: Kinematics,
    T_flange_tcp: FloatArray,
    rules: SamplingRules,
    is_free: IsFree | None = None,
) -> SamplingPlan:
    """Return all postures that the arm can take, ordered for short travel.

    Raises:
        StiffnessError: STF022 if no posture at all can be taken.
    """
    points, cells = grid_tags(grid)
    orientation = rules.R_robroot_tcp
    if orientation is None:
        orientation = best_orientation(points, kinematics, T_flange_tcp, rules)
    poses = tag_poses(points, orientation, rules)
    q, reason = reachable(poses.reshape(-1, 4, 4), kinematics, T_flange_tcp, rules)
    if is_free is not None:
        taken = np.flatnonzero(reason == 0)
        reason[taken[~is_free(q[taken])]] = 4
    count = len(rules.angles)
    good = np.flatnonzero(reason == 0)
    if len(good) == 0:
        worst = REASONS[int(np.bincount(reason[reason > 0]).argmax())]
        raise StiffnessError(
            "STF022",
            f"none of {len(reason)} postures can be taken, most often: {worst}",
            hint="move the box or give another --orientation",
        )
    tag, turn = np.divmod(good, count)
    order = travel_order(q[good], tag.astype(np.int32), kinematics)
    dropped = tuple(
        (int(i) // count, int(i) % count, REASONS[int(reason[i])])
        for i in np.flatnonzero(reason > 0)
    )
    return SamplingPlan(
        grid=grid,
        points=points,
        cells=cells,
        tag=tag[order].astype(np.int32),
        angle=np.asarray(rules.angles)[turn[order]],
        # what a program can say, so that the file to fill in holds what was commanded
        q=np.round(q[good][order] / DEG, 5) * DEG,
        R_robroot_tcp=orientation,
        dropped=dropped,
    )


def tag_poses(points: FloatArray, R_robroot_tcp: FloatArray, rules: SamplingRules) -> FloatArray:
    """Return the tool poses (t, a, 4, 4) of all tags and angles, robroot."""
    R = R_robroot_tcp @ rotation_about(np.asarray(rules.axis), np.asarray(rules.angles))
    return transform(R[None], points[:, None, :])


def best_orientation(
    points: FloatArray, kinematics: Kinematics, T_flange_tcp: FloatArray, rules: SamplingRules
) -> FloatArray:
    """Return the axis-parallel tool orientation (3, 3) that reaches most postures.

    Ties go to the one that turns the wrist least.
    """
    best: tuple[float, float] | None = None
    found = np.eye(3)
    step = max(len(points) // 200, 1)
    for R in axis_parallel():
        poses = tag_poses(points[::step], R, rules).reshape(-1, 4, 4)
        q, reason = reachable(poses, kinematics, T_flange_tcp, rules)
        good = reason == 0
        turned = float(np.abs(q[good][:, 3:]).mean()) if np.any(good) else np.inf
        rank = (-float(np.sum(good)), round(turned, 6))
        if best is None or rank < best:
            best, found = rank, R
    return found


def axis_parallel() -> list[FloatArray]:
    """Return the 24 rotations (3, 3) whose axes are parallel to those of the box."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            R = np.zeros((3, 3))
            R[range(3), order] = signs
            if np.linalg.det(R) > 0.0:
                found.append(R)
    return found


def reachable(
    T_robroot_tcp: FloatArray,
    kinematics: Kinematics,
    T_flange_tcp: FloatArray,
    rules: SamplingRules,
) -> tuple[FloatArray, IntArray]:
    """Return joint angles (n, 6) and the reason (n,) why a pose cannot be taken (0: it can).

    All postures stay in the branch that serves most of them where it can; each joint takes the
    turn nearest to zero.
    """
    slots, valid = kinematics.ik(T_robroot_tcp @ inverse(T_flange_tcp))
    turned = kinematics.nearest(slots, np.zeros(6))
    inside = valid & kinematics.within_limits(turned, rules.joint_margin)
    regular = inside & (wrist_distance(kinematics, turned) >= rules.singularity)
    ranking = np.argsort(-regular.sum(axis=0), kind="stable")
    pick = ranking[np.argmax(regular[:, ranking], axis=1)]
    rows = np.arange(len(turned))
    reason = np.where(
        regular.any(axis=1), 0, np.where(inside.any(axis=1), 3, np.where(valid.any(axis=1), 2, 1))
    )
    return turned[rows, pick], reason.astype(np.int32)


def travel_order(q: FloatArray, tag: IntArray, kinematics: Kinematics) -> IntArray:
    """Return the order of postures (n,): tag by tag on a short tour, turns to and fro.

    The way between two tags counts by the largest joint motion relative to the joint's range,
    nearest neighbour first, then improved by reversing stretches (2-opt).
    """
    labels = np.unique(tag)
    span = np.asarray(kinematics.q_max) - np.asarray(kinematics.q_min)
    weight = 1.0 / np.where(np.isfinite(span) & (span > 0.0), span, 2.0 * np.pi)
    middle = np.array([q[tag == label].mean(axis=0) for label in labels]) * weight
    tour = _two_opt(_nearest_neighbour(middle), middle)
    order: list[int] = []
    forward = True
    for place in tour:
        members = np.flatnonzero(tag == labels[place])
        order += list(members if forward else members[::-1])
        forward = not forward
    return np.asarray(order, dtype=np.int32)


def _nearest_neighbour(places: FloatArray) -> list[int]:
    start = int(np.argmin(np.round(places @ np.ones(places.shape[1]), 9)))
    tour, left = [start], np.ones(len(places), dtype=bool)
    left[start] = False
    while np.any(left):
        rest = np.flatnonzero(left)
        step = np.max(np.abs(places[rest] - places[tour[-1]]), axis=1)
        following = int(rest[int(np.argmin(np.round(step, 12)))])
        tour.append(following)
        left[following] = False
    return tour


def _two_opt(tour: list[int], places: FloatArray) -> list[int]:
    """Reverse stretches while that shortens the tour; long tours stay as they are."""
    n = len(tour)
    if not 4 <= n <= 1500:
        return tour
    order = np.asarray(tour)
    D = np.max(np.abs(places[:, None, :] - places[None]), axis=2)
    for _ in range(4 * n):
        a, b = order[:-1], order[1:]
        # gain of joining a_i with a_j and b_i with b_j for i < j
        change = D[np.ix_(a, a)] + D[np.ix_(b, b)]
        change -= D[a, b][:, None] + D[a, b][None, :]
        change[np.tril_indices(n - 1)] = 0.0
        i, j = np.unravel_index(int(np.argmin(change)), change.shape)
        if change[i, j] > -1e-9:
            break
        order[i + 1 : j + 1] = order[i + 1 : j + 1][::-1].copy()
    return [int(i) for i in order]


LENGTH = 60.0 * DEG
"""Kernel length [rad] that is expected of joint stiffness before anything was measured."""
AMPLITUDE = 0.5
"""Expected sd of the logarithm of a compliance over the workspace."""
_CENTRES = 80


def features(model: str, q: FloatArray, points: FloatArray, grid: Grid | None = None) -> FloatArray:
    """Return features (n, f) whose weights are unknowns of sd 1 for each joint.

    Args:
        model: ``constant``, ``grid`` or ``continuous``.
        q: (n, 6) candidate postures [rad].
        points: (n, 3) their tool points [m].
        grid: for ``grid``.

    Raises:
        StiffnessError: STF023 for another model.
    """
    ones = np.ones((len(q), 1))
    if model == "constant":
        return ones
    if model == "grid" and grid is not None:
        cells, counts = grid.touching(points)
        own = np.zeros((len(q), len(grid)))
        share = counts / counts.sum(axis=1, keepdims=True)
        np.add.at(own, (np.arange(len(q))[:, None], cells), share)
        return np.hstack([ones, AMPLITUDE * own])
    if model == "continuous":
        step = max(len(q) // _CENTRES, 1)
        centres = q[::step][:_CENTRES]
        lengths = np.full(6, LENGTH)
        K = kernel(centres, centres, lengths) + 1e-6 * np.eye(len(centres))
        smooth = np.linalg.solve(np.linalg.cholesky(K), kernel(q, centres, lengths).T).T
        return np.hstack([ones, AMPLITUDE * smooth])
    raise StiffnessError("STF023", f"no measuring plan for the model {model!r}")


def choose(A: FloatArray, P: FloatArray, c_ref: FloatArray, sigma: float, count: int) -> IntArray:
    """Return the postures (count,) that tell most, the most telling first.

    Args:
        A: (n, m, 6) regressors of the m readings of each posture (3 for each load).
        P: (n, f) features.
        c_ref: (6,) expected compliances.
        sigma: sd of a reading [m].
        count: how many.
    """
    scaled = A * (c_ref / sigma)
    n, _, joints = scaled.shape
    S = np.eye(joints * P.shape[1])

    def rows(i: int) -> FloatArray:
        wide = scaled[i][:, :, None] * P[i]
        return np.asarray(wide.reshape(scaled.shape[1], -1))

    def gain(i: int) -> float:
        X = rows(i)
        return float(np.linalg.slogdet(np.eye(len(X)) + X @ S @ X.T)[1])

    # (minus gain, index, step at which it was computed)
    queue = [(-gain(i), i, 0) for i in range(n)]
    heapq.heapify(queue)
    chosen: list[int] = []
    while queue and len(chosen) < count:
        _, i, when = heapq.heappop(queue)
        if when < len(chosen):
            heapq.heappush(queue, (-gain(i), i, len(chosen)))
            continue
        chosen.append(i)
        X = rows(i)
        SX = S @ X.T
        S = S - SX @ np.linalg.solve(np.eye(len(X)) + X @ SX, SX.T)
    return np.asarray(chosen, dtype=np.int32)
