"""Where a workpiece can stand so that an arm reaches all of a CAM file, with margin to spare."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell, require_numbers
from postproc.errors import CellError, SourceRef
from postproc.geometry import across, inverse, kuka_from_transform, transform, transform_from_kuka
from postproc.kinematics import Kinematics, build, wrist_distance
from postproc.model import MotionKind, ToolPath
from postproc.planning import frames_across
from postproc.records import dataclass
from postproc.units import DEG, MM

SHIFT = 50.0 * MM
"""A proposed place stays good where the part is off by so much along any axis."""
_SPINS = 12
_SAMPLE = 16
"""Tags by which places are compared; all are proved of the one that is proposed."""
_TRIED = 12
"""Best places that are proved, at most."""
_OUT = (0.4, 0.5, 0.6, 0.7, 0.8)
_UP = (-0.1, 0.1, 0.25, 0.4, 0.55)
"""Where the middle of the tags is tried: shares of the reach away from A1, and above the floor."""
_GRID = 10.0
"""Numbers of a proposed place are multiples of this [mm]."""
_YAWS = (0.0, 90.0, 180.0, -90.0)
_CHUNK = 400


@dataclass(frozen=True, slots=True)
class WorkpiecePlace:
    """A proposed frame of a workpiece.

    ``xyz_mm``, ``abc_deg``: CAM coordinates in the robot root; ``margin`` [rad]: every tag can be
    reached at least so far from joint limits and the straight wrist, beyond what the cell asks;
    ``tags``: how many.
    """

    xyz_mm: tuple[float, float, float]
    abc_deg: tuple[float, float, float]
    margin: float
    tags: int


def workpiece_place(
    toolpath: ToolPath, cell: Cell, abc_deg: tuple[float, float, float] | None = None
) -> WorkpiecePlace:
    """Return where the workpiece of a CAM file can stand: the place with the largest margin found.

    Every tag is reached there by inverse kinematics with some spin in one posture, at its point,
    at the bottom of its stroke and above it, also where the part is off by ``SHIFT``. Solids are
    not asked: ``convert`` checks collisions.

    Args:
        toolpath: what was read.
        cell: robot, tool and limits.
        abc_deg: orientation of the CAM axes to keep; None: the tool stands upright, or points away
            from the robot where that leaves more margin.

    Raises:
        CellError: CEL016 if no place is found, or the arm has no closed-form inverse kinematics.
    """
    require_numbers(cell)
    kinematics = build(cell.robot)
    known = np.isfinite(toolpath.points).all(axis=1) & np.isfinite(toolpath.axes).all(axis=1)
    where = SourceRef(toolpath.path)
    if not kinematics.is_closed_form:
        text = "a place is proposed only for arms with closed-form inverse kinematics"
        raise CellError("CEL016", text, SourceRef(cell.path))
    if not known.any():
        raise CellError("CEL016", "no tag of this file has a place and a tool axis", where)
    job = _Job.of(toolpath, np.flatnonzero(known), cell, kinematics)
    places = list(_places(job, kinematics, abc_deg))
    some = job.rows(_spread(job))
    scores = np.array([some.margin(T) for T in places])
    for index in np.argsort(-scores, kind="stable")[:_TRIED].tolist():
        if scores[index] <= 0.0:
            break
        shifts = [transform(np.eye(3), step) for step in _shifts()]
        if min(some.margin(shift @ places[index]) for shift in shifts) <= 0.0:
            continue
        margin = min(job.margin(shift @ places[index]) for shift in shifts)
        if margin > 0.0:
            xyz, abc = kuka_from_transform(places[index])
            x, y, z = (float(v) + 0.0 for v in np.round(xyz, 6))
            a, b, c = (float(v) + 0.0 for v in np.round(abc, 6))
            return WorkpiecePlace((x, y, z), (a, b, c), job.margin(places[index]), len(job.points))
    size = np.ptp(job.points, axis=0) / MM
    raise CellError(
        "CEL016",
        f"no place was found where {cell.robot.name} reaches all {len(job.points)} tags of "
        f"{size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm",
        where,
        "take a larger arm, or another tool frame; several setups need a place each",
    )


def reached(toolpath: ToolPath, tags: IndexArray, cell: Cell) -> BoolArray:
    """Return (k,) whether the arm reaches the distinct ones of some tags where the part stands."""
    job = _Job.of(toolpath, tags, cell, build(cell.robot))
    each = (job.rows(np.array([row])) for row in range(len(job.points)))
    return np.array([one.margin(cell.workpiece.T_robroot_base) > 0.0 for one in each])


@dataclass(frozen=True, slots=True)
class _Job:
    """Tags to reach: points (n, 3) [m], axes (n, 3), heights (n, h) [m] along the axis."""

    points: FloatArray
    axes: FloatArray
    heights: FloatArray
    cell: Cell
    kinematics: Kinematics

    @classmethod
    def of(cls, path: ToolPath, tags: IndexArray, cell: Cell, kinematics: Kinematics) -> _Job:
        """Return the distinct tags of a toolpath, with the strokes of its holes."""
        cycle = np.asarray(path.cycle)[tags]
        holes = (np.asarray(path.kind)[tags] == MotionKind.HOLE) & (cycle >= 0)
        depth = np.array([*(c.depth for c in path.cycles), 0.0])[cycle] * holes
        top = np.array([*(max(c.clearance, c.retract) for c in path.cycles), 0.0])[cycle] * holes
        top = np.maximum(top, cell.motion.approach)
        heights = np.stack([-depth, np.zeros(len(tags)), top], axis=1)
        rows = np.hstack([path.points[tags] / MM, path.axes[tags], heights / MM])
        _, first = np.unique(np.round(rows, 3), axis=0, return_index=True)
        keep = np.sort(first)
        return cls(path.points[tags][keep], path.axes[tags][keep], heights[keep], cell, kinematics)

    def rows(self, index: IndexArray) -> _Job:
        """Return some of the tags."""
        return _Job(
            self.points[index], self.axes[index], self.heights[index], self.cell, self.kinematics
        )

    def margin(self, T_robroot_base: FloatArray) -> float:
        """Return the smallest margin [rad] of any tag, -inf where one is out of reach."""
        least = np.inf
        for low in range(0, len(self.points), _CHUNK):
            part = slice(low, low + _CHUNK)
            least = min(least, self._margin(T_robroot_base, part))
            if least <= 0.0:
                break
        return float(least)

    def _margin(self, T_robroot_base: FloatArray, part: slice) -> float:
        tool, spins = self.cell.tool, np.arange(_SPINS) * (2.0 * np.pi / _SPINS)
        points, axes, heights = self.points[part], self.axes[part], self.heights[part]
        n, h = heights.shape
        first, second = across(axes)
        turn = np.cos(spins)[:, None, None] * first + np.sin(spins)[:, None, None] * second
        direction = np.broadcast_to(-axes, turn.shape)
        R = frames_across(direction.reshape(-1, 3), turn.reshape(-1, 3), np.asarray(tool.axis))
        p = points[:, None] + heights[..., None] * axes[:, None]
        T = transform(
            np.repeat(R.reshape(_SPINS, n, 1, 3, 3), h, axis=2).reshape(-1, 3, 3),
            np.broadcast_to(p, (_SPINS, n, h, 3)).reshape(-1, 3),
        )
        q, valid = self.kinematics.ik(T_robroot_base @ T @ inverse(tool.T_flange_tcp))
        spare = np.where(valid, self._joint_margin(np.nan_to_num(q)), -np.inf)
        # one spin and one posture for the whole stroke of a tag
        stroke = spare.reshape(_SPINS, n, h, -1).min(axis=2)
        return float(stroke.max(axis=(0, 2)).min())

    def _joint_margin(self, q: FloatArray) -> FloatArray:
        """Return how far (m, 8) [rad] joints are from limits and the straight wrist."""
        robot, limits = self.cell.robot, self.cell.limits
        turned = q[..., None] + 2.0 * np.pi * np.arange(-1, 2)
        low, high = np.asarray(robot.q_min)[:, None], np.asarray(robot.q_max)[:, None]
        joint = np.minimum(turned - low, high - turned).max(axis=-1).min(axis=-1)
        wrist = wrist_distance(self.kinematics, q.reshape(-1, 6)).reshape(joint.shape)
        return np.asarray(np.minimum(joint - limits.joint_margin, wrist - limits.singularity))


def _shifts() -> Iterator[FloatArray]:
    yield np.zeros(3)
    for axis in np.eye(3):
        yield SHIFT * axis
        yield -SHIFT * axis


def _spread(job: _Job) -> IndexArray:
    """Return the tags at the ends of the part, and some between."""
    ways = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    ends = np.argmax(job.points @ ways.T, axis=0)
    between = np.linspace(0, len(job.points) - 1, _SAMPLE).round().astype(np.int64)
    return np.unique(np.concatenate([ends, between]))


def _places(
    job: _Job, kinematics: Kinematics, abc_deg: tuple[float, float, float] | None
) -> Iterator[FloatArray]:
    """Yield frames T_robroot_base (4, 4) worth a try, on the grid, before A1 at its middle."""
    low, high = np.asarray(job.cell.robot.q_min), np.asarray(job.cell.robot.q_max)
    rng = np.random.default_rng(0)
    flange = kinematics.fk(rng.uniform(low, high, (2000, 6)))[:, :3, 3]
    reach = float(np.linalg.norm(flange[:, :2], axis=1).max())
    ahead = kinematics.fk(np.array([0.5 * (low[0] + high[0]), -90 * DEG, 90 * DEG, 0, 0, 0]))
    side = ahead[:2, 3] / max(float(np.linalg.norm(ahead[:2, 3])), 1e-9)
    middle = 0.5 * (job.points.min(axis=0) + job.points.max(axis=0))
    for R in _orientations(job, side, abc_deg):
        for out in _OUT:
            for up in _UP:
                target = np.append(out * reach * side, up * reach)
                origin = np.round((target - R @ middle) / MM / _GRID) * _GRID * MM
                yield transform(R, origin)


def _orientations(
    job: _Job, side: FloatArray, abc_deg: tuple[float, float, float] | None
) -> Iterator[FloatArray]:
    """Yield rotations (3, 3): the mean tool axis up, then back to the robot, in steps of 90 deg."""
    if abc_deg is not None:
        yield transform_from_kuka([0.0, 0.0, 0.0], list(abc_deg))[:3, :3]
        return
    mean = job.axes.mean(axis=0)
    main = int(np.argmax(np.abs(mean)))
    sign = 1.0 if mean[main] >= 0 else -1.0
    seen: list[FloatArray] = []
    wanted = (np.array([0.0, 0.0, 1.0]), -np.append(side, 0.0))
    for a in _YAWS:
        for b in _YAWS:
            for c in _YAWS:
                R = transform_from_kuka([0.0, 0.0, 0.0], [a, b, c])[:3, :3]
                turned = sign * R[:, main]
                good = any(float(turned @ way) > 0.8 for way in wanted)
                if good and not any(np.allclose(R, other) for other in seen):
                    seen.append(R)
                    yield R
