"""Holes as drilling cells run them: numbered, with routines around each, perhaps fed by the unit.

Where the end effector feeds, the robot goes to where the feed would begin and stands there: the
stroke into the part is not driven. Depth, feed and speed are handed to the routines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arrays import TINY, BoolArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity, SourceRef, listed
from postproc.model import Cycle, CycleKind, Event, EventKind, MotionKind, ToolPath
from postproc.process.feeds import feeds_of
from postproc.process.spindle import turns_at
from postproc.process.strokes import peck_count

STAND_SPEED = 0.1
"""Speed [m/s] of the last way to where the robot stands while the unit drills."""
DRILL = "drill"
"""The step at which the tool goes into the part."""
NUMBER = "hole_number"
"""Column of a toolpath whose holes are numbered: 1, 2, ... in their order, 0 at other tags."""
_COLUMNS = ("hole_depth", "hole_feed")
_INTO = 0.98
"""A cut whose way is the tool axis by this share goes into the part."""
_ONLY_DRILLED = frozenset(
    {CycleKind.DRILL, CycleKind.DEEP, CycleKind.BRKCHP, CycleKind.FACE, CycleKind.CSINK}
)


def holes_served(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath with its holes numbered and as the robot has to serve them.

    Done twice it is as done once. A cell without steps of a hole changes nothing.
    """
    if not cell.process.hole or NUMBER in toolpath.extra:
        return toolpath
    is_hole = _is_hole(toolpath)
    depth = np.array([*(cycle.depth for cycle in toolpath.cycles), 0.0])[toolpath.cycle]
    columns = (depth, np.nan_to_num(feeds_of(toolpath, cell)))
    extra = dict(toolpath.extra) | {NUMBER: np.where(is_hole, np.cumsum(is_hole), 0)}
    extra |= {
        name: np.where(is_hole, values, 0.0) for name, values in zip(_COLUMNS, columns, strict=True)
    }
    toolpath = replace(toolpath, extra=extra)
    return _standing(toolpath, cell, is_hole) if cell.process.unit_feeds else toolpath


def _is_hole(toolpath: ToolPath) -> BoolArray:
    return np.asarray((toolpath.kind == MotionKind.HOLE) & (np.asarray(toolpath.cycle) >= 0))


def _standing(toolpath: ToolPath, cell: Cell, is_hole: BoolArray) -> ToolPath:
    """Return the toolpath with every hole at the height where its feed would begin."""
    clear = np.array([*(cycle.clearance for cycle in toolpath.cycles), 0.0])[toolpath.cycle]
    height = np.where(is_hole, clear, 0.0)
    points = toolpath.points + height[:, None] * toolpath.axes
    cycles = tuple(_stand(cycle, cell.motion.approach) for cycle in toolpath.cycles)
    return replace(toolpath, points=points, cycles=cycles)


def _stand(cycle: Cycle, approach: float) -> Cycle:
    """Return the stroke of a robot that stands at the clearance height of a cycle."""
    up = cycle.retract - cycle.clearance
    up = up if up > TINY else approach
    return Cycle(CycleKind.DRILL, 0.0, up, up, feed=STAND_SPEED, diameter=cycle.diameter)


def hole_steps(toolpath: ToolPath, cell: Cell) -> Iterator[tuple[int, list[Event], list[Event]]]:
    """Yield (tag, steps before the tool goes in, steps behind the way out) of numbered holes.

    Where the unit feeds, all come where the robot stands: those are the first ones.
    """
    if NUMBER not in toolpath.extra:
        return
    numbers = np.asarray(toolpath.extra[NUMBER])
    columns = (np.asarray(toolpath.extra[name]) for name in _COLUMNS)
    values = np.column_stack([*columns, np.nan_to_num(turns_at(toolpath))])
    names = cell.process.hole
    first = names.index(DRILL) + 1 if DRILL in names else max(len(names) - 1, 1)
    first = len(names) if cell.process.unit_feeds else first
    for tag in np.flatnonzero(numbers > 0).tolist():
        line, number = int(toolpath.line[tag]), float(numbers[tag])
        data = tuple(values[tag].tolist())
        made = [Event(tag, EventKind.HOLE, number, name, line, data) for name in names]
        yield tag, made[:first], made[first:]


def unit_findings(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return what a unit is not told, and feed moves into the part that it would make again.

    The file tells, as it is read; holes that are served already stand above their places.
    """
    if not cell.process.unit_feeds or NUMBER in toolpath.extra:
        return []
    return [*_untold(toolpath), *_made_twice(toolpath)]


def _untold(toolpath: ToolPath) -> list[Finding]:
    """Return a note for each kind of hole that depth, feed and speed do not describe."""
    found = []
    numbers = np.where(_is_hole(toolpath), toolpath.cycle, -1)
    for number in np.unique(numbers[numbers >= 0]).tolist():
        cycle = toolpath.cycles[number]
        more = [] if cycle.kind in _ONLY_DRILLED else [f"a {cycle.kind.replace('_', ' ')} cycle"]
        more += ["pecks"] * (peck_count(cycle) > 1) + ["a dwell"] * (cycle.dwell > 0.0)
        if more:
            tag = int(np.flatnonzero(numbers == number)[0])
            text = (
                f"the unit gets depth, feed and speed only; {' and '.join(more)}, from line "
                f"{int(toolpath.line[tag])} on, must be done by its own program for the tool"
            )
            source = toolpath.source(tag)
            found.append(Finding(Severity.NOTE, "PRC011", text, tag, source))
    return found


def _made_twice(toolpath: ToolPath) -> list[Finding]:
    """Return an error for feed moves along the tool axis into the part."""
    way = np.diff(toolpath.points, axis=0)
    along = -np.einsum("ij,ij->i", way, toolpath.axes[1:])
    into = along > _INTO * np.linalg.norm(way, axis=1)
    cut = np.asarray(toolpath.kind[1:]) == MotionKind.LINEAR
    same = np.diff(np.asarray(toolpath.tool)) == 0
    tags = np.flatnonzero(into & cut & same & (along > TINY)) + 1
    if not len(tags):
        return []
    text = (
        f"the unit feeds, but {len(tags)} feed moves go into the part along the tool axis: "
        f"lines {listed(toolpath.line[tags].tolist())}"
    )
    hint = 'post the holes as drill cycles, or set [process] feed_by = "robot"'
    return [
        Finding(
            Severity.ERROR, "PRC010", text, int(tags[0]), toolpath.source(int(tags[0])), hint=hint
        )
    ]


def restart_notes(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return a note where a program of numbered holes cannot begin at any of them."""
    if not (cell.process.hole and cell.external_axes and _is_hole(toolpath).any()):
        return []
    text = "with external axes the program begins at its first hole only: no PP_START_HOLE"
    return [Finding(Severity.NOTE, "PRC012", text, source=SourceRef(cell.path))]
