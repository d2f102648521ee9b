"""Numbers of every tag that a program page shows: as columns of a list and as colours."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IndexArray, least_by
from postproc.cell import Cell
from postproc.geometry import angle_between
from postproc.model import MotionKind, MoveRole, Plan
from postproc.planning import PlanMaps
from postproc.records import dataclass
from postproc.report.parts.page import packed
from postproc.report.parts.texts import ProgramText
from postproc.units import DEG, MM, MM_PER_MIN, N_PER_MM

_WORKING = (MoveRole.CUT, MoveRole.PLUNGE)


@dataclass(frozen=True, slots=True)
class TagColumn:
    """One number per tag (n,) in the unit of files; ``worse`` is "low", "high" or empty."""

    key: str
    label: str
    unit: str
    values: FloatArray
    worse: str = ""

    def to_page(self) -> dict[str, Any]:
        """Return the column for the page's scripts."""
        return {
            "key": self.key,
            "label": self.label,
            "unit": self.unit,
            "worse": self.worse,
            "values": packed(self.values),
        }


def tag_columns(
    plan: Plan, cell: Cell, maps: PlanMaps, text: ProgramText | None
) -> list[TagColumn]:
    """Return the columns of a plan; those without a single number are left out."""
    moves = maps.moves
    columns = [
        *_frames(cell, maps),
        TagColumn("spin", "spin", "deg", _of_moves(plan.spin, moves) / DEG),
        TagColumn("tilt", "tilt", "deg", _tilt(plan, cell, moves) / DEG),
        TagColumn("stiffness", "stiffness", "N/mm", plan.stiffness / N_PER_MM, "low"),
        TagColumn("feed", "feed", "mm/min", _feed(plan, moves) / MM_PER_MIN),
        TagColumn("clearance", "clearance", "mm", maps.clearance / MM, "low"),
        TagColumn("margin", "margin", "deg", _margin(plan, cell) / DEG, "low"),
        TagColumn("deviation", "deviation", "mm", _deviation(plan, text) / MM, "high"),
    ]
    return [column for column in columns if np.isfinite(column.values).any()]


def _frames(cell: Cell, maps: PlanMaps) -> list[TagColumn]:
    """Return the numbers of tool and base where the cell has several."""
    found = []
    for key, entries, index in (("tool", cell.tools, maps.tool), ("base", cell.bases, maps.base)):
        if len(entries) > 1:
            numbers = np.array([*(float(entry.number) for entry in entries), np.nan])
            found.append(TagColumn(key, key, "no.", numbers[index]))
    return found


def _of_moves(values: FloatArray, moves: IndexArray) -> FloatArray:
    result = np.full(len(moves), np.nan)
    known = moves >= 0
    result[known] = values[moves[known]]
    return result


def _tilt(plan: Plan, cell: Cell, moves: IndexArray) -> FloatArray:
    """Return the angle [rad] of the tool axis to the CAM data's, NaN in cells without tilt."""
    result = np.full(len(moves), np.nan)
    if cell.optimize.tilt:
        known = np.flatnonzero(moves >= 0)
        R, axes = plan.T_base_tcp[moves[known], :3, :3], cell.axes_of(plan.tool_of_moves)
        axis = np.einsum("nij,nj->ni", R, axes[moves[known]])
        result[known] = angle_between(-axis, plan.toolpath.axes[known])
    return result


def _feed(plan: Plan, moves: IndexArray) -> FloatArray:
    """Return the programmed path speed [m/s] where the tool works, else the feed of the input."""
    planned = _of_moves(plan.speed, moves)
    is_rapid = plan.toolpath.kind == MotionKind.RAPID
    return np.where(is_rapid, np.nan, np.where(np.isfinite(planned), planned, plan.toolpath.feed))


def _margin(plan: Plan, cell: Cell) -> FloatArray:
    """Return the smallest way [rad] of any joint to its limit over the moves of each tag."""
    q = plan.q
    least = np.minimum(q - cell.robot.q_min, cell.robot.q_max - q).min(axis=1, initial=np.inf)
    served = plan.tag >= 0
    return least_by(least[served], plan.tag[served], len(plan.toolpath))


def _deviation(plan: Plan, text: ProgramText | None) -> FloatArray:
    """Return how far [m] the program's own text is from the CAM point (holes: from the axis)."""
    path = plan.toolpath
    result = np.full(len(path), np.nan)
    if text is None or len(text) != len(plan):
        return result
    rows = np.flatnonzero((plan.tag >= 0) & np.isin(plan.role, _WORKING))
    tags = plan.tag[rows]
    off = text.point[rows] - path.points[tags]
    along = np.einsum("ij,ij->i", off, path.axes[tags])[:, None] * path.axes[tags]
    off = np.where((path.kind[tags] == MotionKind.HOLE)[:, None], off - along, off)
    # several moves may work on the way to one tag; the last of them is the tag
    last = np.flatnonzero(np.diff(tags, append=-1) != 0)
    result[tags[last]] = np.linalg.norm(off[last], axis=1)
    return result
