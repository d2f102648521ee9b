"""Whether cell and file agree that lengths without a unit are mm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import ReadError
from postproc.kinematics import build
from postproc.model import ToolPath
from postproc.planning import Reach
from postproc.process import assign
from postproc.units import SINGLE

_OTHERS = ("m", "inch")
_SAMPLE = 16
"""Tags that are tried, evenly taken."""
_ELSEWHERE = 20.0 * SINGLE["mm"].factor
"""Farther off the workpiece [m] no tag of a job on it lies."""
_ON_IT = 2.0 * SINGLE["mm"].factor
"""Up to this distance [m] tags lie on the workpiece."""


def check_units(toolpath: ToolPath, cell: Cell) -> None:
    """Ask for the unit of length (CNV013) where mm is assumed, and only another one fits the cell.

    That is where no tag is within reach, or all lie off the solid of the workpiece, and in metres
    or inches all are within reach, or on it.
    """
    assumed = "lengths in mm" in {text.partition(", as ")[0] for text in toolpath.assumed} and not (
        any("feeds" in text for text in toolpath.assumed if "lengths" in text)  # MMPM proves mm
    )
    known = np.isfinite(toolpath.points).all(axis=1) & np.isfinite(toolpath.axes).all(axis=1)
    if not assumed or not known.any() or cell.external_axes:
        return
    assigned = assign(toolpath, cell)
    tags = np.flatnonzero(known & (assigned.tool >= 0) & (assigned.base >= 0))
    tags = tags[(assigned.tool[tags] == assigned.tool[tags[0]])] if len(tags) else tags
    tags = tags[(assigned.base[tags] == assigned.base[tags[0]])] if len(tags) else tags
    if not len(tags):
        return
    tags = np.unique(tags[np.linspace(0, len(tags) - 1, _SAMPLE).astype(np.int64)])
    here = cell.with_tool(int(assigned.tool[tags[0]]), int(assigned.base[tags[0]]))
    for fits, what in ((_reached, "within reach"), (_lie_on_the_part, "on the workpiece")):
        if fits(assigned.toolpath, tags, here, 1.0) is not False:
            continue
        for unit in _OTHERS:
            scale = SINGLE[unit].factor / SINGLE["mm"].factor
            if fits(assigned.toolpath, tags, here, scale):
                text = (
                    f"the file gives no unit of length; in mm no tag is {what}, in {unit} all are"
                )
                hint = f"--units {unit}, or --units mm if mm is right"
                raise ReadError("CNV013", text, toolpath.source(int(tags[0])), hint=hint)


def _reached(toolpath: ToolPath, tags: IndexArray, cell: Cell, scale: float) -> bool | None:
    """Return whether the arm reaches all tags; None for some, or where it is not known."""
    if not build(cell.robot).is_closed_form:
        return None
    larger = replace(toolpath, points=toolpath.points * scale, cycles=())
    larger = replace(larger, cycle=np.full(len(larger), -1, dtype=np.int32))
    found = np.isfinite(Reach.of_one(larger.rows(tags), cell).margins(cell))
    return True if found.all() else False if not found.any() else None


def _lie_on_the_part(toolpath: ToolPath, tags: IndexArray, cell: Cell, scale: float) -> bool | None:
    return on_the_part(toolpath.points[tags] * scale, cell)


def on_the_part(points: FloatArray, cell: Cell) -> bool | None:
    """Return whether all points (n, 3) lie on the workpiece; None for some, or without a solid."""
    if not cell.workpiece.meshes:
        return None
    from postproc.collision import Scene

    scene = Scene.shared(cell, build(cell.robot))
    distance = scene.nearest_surface(points).distance
    return True if (distance < _ON_IT).all() else False if (distance > _ELSEWHERE).all() else None
