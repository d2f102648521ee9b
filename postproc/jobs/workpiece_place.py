"""Where a workpiece can stand so that an arm reaches all of a CAM file, with margin to spare."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, frame_document, require_numbers
from postproc.errors import CellError, SourceRef
from postproc.geometry import transform, transform_from_kuka
from postproc.kinematics import Kinematics, build
from postproc.model import ToolPath
from postproc.planning import Reach
from postproc.units import DEG, MM

SHIFT = 50.0 * MM
"""A proposed place stays good where the part is off by so much along any axis."""
_TRIED = 12
"""Best places that are proved, at most."""
_OUT = (0.4, 0.5, 0.6, 0.7, 0.8)
_UP = (-0.1, 0.1, 0.25, 0.4, 0.55)
"""Where the middle of the tags is tried: shares of the reach away from A1, and above the floor."""
_GRID = 10.0
"""Numbers of a proposed place are multiples of this [mm]."""
_YAWS = (0.0, 90.0, 180.0, -90.0)


def workpiece_place(
    toolpath: ToolPath, cell: Cell, abc_deg: tuple[float, float, float] | None = None
) -> dict[str, Any]:
    """Return where the workpiece of a CAM file can stand: the place with the largest margin found.

    Every tag is in reach there, its stroke and the way out of it too, also where the part is off by
    ``SHIFT``. Solids are not asked: ``convert`` checks collisions. ``xyz_mm``, ``abc_deg``: CAM
    coordinates in the robot root; ``margin_deg``: how far every tag can be reached from joint
    limits and the straight wrist, beyond what the cell asks; ``tags``: how many. ``abc_deg`` to
    keep; None: the tool stands upright, or points away from the robot where that leaves more
    margin. CEL016 if no place is found, or the arm has no closed-form inverse kinematics.
    """
    require_numbers(cell)
    kinematics, where = build(cell.robot), SourceRef(toolpath.path)
    known = np.isfinite(toolpath.points).all(axis=1) & np.isfinite(toolpath.axes).all(axis=1)
    if not kinematics.is_closed_form:
        text = "a place is proposed only for arms with closed-form inverse kinematics"
        raise CellError("CEL016", text, SourceRef(cell.path))
    if not known.any():
        raise CellError("CEL016", "no tag of this file has a place and a tool axis", where)
    reach, points = Reach.of_one(toolpath, cell), toolpath.points[known]

    def margin(T: FloatArray, *, whole: bool) -> float:
        return float(reach.margins(cell.rebased(lambda _: T), whole=whole).min())

    places = list(_places(points, toolpath.axes[known], cell, kinematics, abc_deg))
    scores = np.array([margin(T, whole=False) for T in places])
    shifts = [transform(np.eye(3), step) for step in _shifts()]
    for index in np.argsort(-scores, kind="stable")[:_TRIED].tolist():
        there = [shift @ places[index] for shift in shifts] if scores[index] > 0.0 else []
        if there and all(margin(T, whole=whole) > 0.0 for whole in (False, True) for T in there):
            least = round(margin(places[index], whole=True) / DEG, 3)
            return {**frame_document(places[index]), "margin_deg": least, "tags": len(points)}
    size = np.ptp(points, axis=0) / MM
    text = (
        f"no place was found where {cell.robot.name} reaches all {len(points)} tags of "
        f"{size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm"
    )
    hint = "take a larger arm, or another tool frame; several setups need a place each"
    raise CellError("CEL016", text, where, hint)


def _shifts() -> Iterator[FloatArray]:
    yield np.zeros(3)
    for axis in np.eye(3):
        yield SHIFT * axis
        yield -SHIFT * axis


def _places(
    points: FloatArray,
    axes: FloatArray,
    cell: Cell,
    kinematics: Kinematics,
    abc_deg: tuple[float, float, float] | None,
) -> Iterator[FloatArray]:
    """Yield frames T_robroot_base (4, 4) worth a try, on the grid, before A1 at its middle."""
    low, high = np.asarray(cell.robot.q_min), np.asarray(cell.robot.q_max)
    rng = np.random.default_rng(0)
    flange = kinematics.fk(rng.uniform(low, high, (2000, 6)))[:, :3, 3]
    reach = float(np.linalg.norm(flange[:, :2], axis=1).max())
    ahead = kinematics.fk(np.array([0.5 * (low[0] + high[0]), -90 * DEG, 90 * DEG, 0, 0, 0]))
    side = ahead[:2, 3] / max(float(np.linalg.norm(ahead[:2, 3])), 1e-9)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    for R in _orientations(axes, side, abc_deg):
        for out in _OUT:
            for up in _UP:
                target = np.append(out * reach * side, up * reach)
                origin = np.round((target - R @ middle) / MM / _GRID) * _GRID * MM
                yield transform(R, origin)


def _orientations(
    axes: FloatArray, side: FloatArray, abc_deg: tuple[float, float, float] | None
) -> Iterator[FloatArray]:
    """Yield rotations (3, 3): the mean tool axis up, then back to the robot, in steps of 90 deg."""
    if abc_deg is not None:
        yield transform_from_kuka([0.0, 0.0, 0.0], list(abc_deg))[:3, :3]
        return
    mean = axes.mean(axis=0)
    main = int(np.argmax(np.abs(mean)))
    sign = 1.0 if mean[main] >= 0 else -1.0
    seen: list[FloatArray] = []
    wanted = (np.array([0.0, 0.0, 1.0]), -np.append(side, 0.0))
    for angles in product(_YAWS, repeat=3):
        R = transform_from_kuka([0.0, 0.0, 0.0], list(angles))[:3, :3]
        turned = sign * R[:, main]
        good = any(float(turned @ way) > 0.8 for way in wanted)
        if good and not any(np.allclose(R, other) for other in seen):
            seen.append(R)
            yield R
