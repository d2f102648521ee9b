"""What a CAM file asks of spindle and feed that a robot cannot give: named before it moves."""

from __future__ import annotations

import math

import numpy as np

from postproc.cell import Cell
from postproc.errors import Finding, Severity, SourceRef
from postproc.model import Cycle, CycleKind, MotionKind, ToolPath
from postproc.process.spindle import direction_findings, turns_at
from postproc.process.strokes import TAPS
from postproc.units import MM

_LEFT_TAPS = frozenset({CycleKind.TAP_LEFT, CycleKind.RIGID_TAP_LEFT})
_RIGID = frozenset({CycleKind.RIGID_TAP, CycleKind.RIGID_TAP_LEFT})
_NO_PITCH = 1e-3
"""Feed and pitch times speed agree within this share."""
_NAME = {kind: "CYCLE/RIGID" if kind in _RIGID else "CYCLE/TAP" for kind in TAPS}


def machining_findings(toolpath: ToolPath, cell: Cell) -> tuple[Finding, ...]:
    """Return the errors that forbid a program: PRC001 direction, PRC002 tapping."""
    return (*direction_findings(toolpath, cell), *_tap_findings(toolpath, cell))


def _tap_findings(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return one error for each reason why tapped holes cannot be made."""
    taps = [i for i, cycle in enumerate(toolpath.cycles) if cycle.kind in TAPS]
    holes = np.asarray(toolpath.kind) == MotionKind.HOLE
    rows = np.flatnonzero(holes & np.isin(toolpath.cycle, taps))
    if not len(rows):
        return []
    turns = turns_at(toolpath)
    found: dict[str, Finding] = {}
    for row in rows.tolist():
        cycle = toolpath.cycles[int(toolpath.cycle[row])]
        why, hint = _why_not(cycle, float(turns[row]), float(toolpath.feed[row]), cell)
        if why and why not in found:
            source = SourceRef(toolpath.path, int(toolpath.line[row]))
            text = f"{_NAME[cycle.kind]}: {why}"
            found[why] = Finding(Severity.ERROR, "PRC002", text, row, source, hint=hint)
    return list(found.values())


def _why_not(cycle: Cycle, turns: float, feed: float, cell: Cell) -> tuple[str, str]:
    """Return why a hole cannot be tapped, and what would help; empty if it can."""
    correct = "correct feed, speed or pitch in the CAM system"
    if cell.process.unit_feeds:
        return _disagreement(cycle, turns, feed) if abs(turns) > 0.0 else "", correct
    if cycle.kind in _RIGID:
        return (
            "rigid tapping needs a feed that is coupled to the spindle; that of a robot is not",
            "use a floating tap holder: CYCLE/TAP, and krl.hooks.tap_reverse",
        )
    if "tap_reverse" not in cell.krl.hooks:
        return (
            "tapping needs a spindle that reverses at the bottom, and the cell names no routine "
            "for that",
            "name it in the cell: [krl.hooks] tap_reverse, if the tap is in a floating holder",
        )
    return _disagreement(cycle, turns, feed), correct


def _disagreement(cycle: Cycle, turns: float, feed: float) -> str:
    """Return what in a tapping cycle contradicts the spindle, empty if nothing does."""
    if cycle.dwell > 0.0:
        return "a dwell at the bottom: the tap would keep cutting"
    if not abs(turns) > 0.0:
        return "tapping needs a spindle that turns at a known speed"
    if (cycle.kind in _LEFT_TAPS) != (turns < 0.0):
        way = "counterclockwise" if turns < 0.0 else "clockwise"
        hand = "left" if cycle.kind in _LEFT_TAPS else "right"
        return f"a {hand}-hand tap, but the spindle turns {way}"
    if not math.isfinite(feed):
        return "neither a feed nor a pitch is given"
    lead = feed / abs(turns)
    if math.isfinite(cycle.pitch) and abs(lead / cycle.pitch - 1.0) > _NO_PITCH:
        return f"the feed gives {lead / MM:g} mm a turn, the pitch is {cycle.pitch / MM:g} mm"
    return ""
