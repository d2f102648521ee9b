"""The spindle as the text of a program drives it: it turns, the right way, before anything cuts.

Read from the calls of the integrator's routines and the motions between them alone. A program that
never calls them leaves the spindle to others: the cell says whether it may.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell, SpindleStart
from postproc.controller import EventWord, TraceEvent
from postproc.errors import RunKind, Severity
from postproc.geometry import angle_between
from postproc.process import START_HINT, machining_speeds, rapid_speeds
from postproc.units import RPM
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Run

_BACK = np.deg2rad(179.0)
"""A motion that turns by more goes back the way that the one before has come."""
_STOPS = ("spindle_off", "spindle_orient")
_ROUTINES = ("spindle_on", "tap_reverse", *_STOPS)
_UNNAMED = np.inf
"""Speed before the spindle is named at all."""


def check_spindle(run: Run) -> Iterator[Said]:
    """Check that the spindle turns as the tool cuts, at every cut and at no time after the last.

    Without a CAM file it is path motions of machining speed that cut; what of faster ones is not
    known is said.
    """
    cell = run.cell
    hooks = {key: name.upper() for key, name in cell.krl.hooks.items()}
    words = {hooks[key]: key for key in _ROUTINES if key in hooks}
    calls = [
        event
        for event in run.paths.trace.events
        if event.word is EventWord.HOOK and event.name in words
    ]
    cuts, unknown = (run.is_cut, None) if run.has_file else _guessed(run, calls)
    if not calls:
        if run.needs_start and not run.may_stand:
            yield from _never_started(cell, cuts)
        return
    turns = _turns(calls, words, len(run.paths))
    ways = np.array([1.0 if tool.cuts_clockwise else -1.0 for tool in cell.tools])
    way = ways[run.paths.station.tool]
    if not run.may_stand:
        yield from _tell(cuts & (turns == 0.0), "a cut while the spindle stands")
        yield from _tell(cuts & (turns == _UNNAMED), "a cut before the spindle is started")
        if unknown is not None:
            yield from _not_known(run, unknown & ((turns == 0.0) | (turns == _UNNAMED)))
    with np.errstate(invalid="ignore"):
        against = cuts & np.isfinite(turns) & (turns * way < 0.0)
    yield from _tell(against, "a cut while the spindle turns against the tool")
    for event in calls:
        if event.on_the_way:
            text = f"{event.name} is called on the way: nobody waits for the spindle"
            yield Remark(RunKind.SPINDLE, run.paths.trace.place_of(event), text)
    if words[calls[-1].name] not in _STOPS:
        text = "the program ends while the spindle turns"
        yield Remark(RunKind.SPINDLE, run.paths.trace.place_of(calls[-1]), text)


def _never_started(cell: Cell, cuts: BoolArray) -> Iterator[Said]:
    """Tell of cuts (m,) without a routine that starts the spindle, as the cell takes them."""
    who = cell.process.spindle
    if not cuts.any() or who in (SpindleStart.UNIT, SpindleStart.HAND):
        return
    text = f"the program does not start the spindle, {int(cuts.sum())} motions cut"
    severity = Severity.ERROR if who is SpindleStart.PROGRAM else Severity.WARNING
    first = int(np.argmax(cuts))
    yield Remark(RunKind.SPINDLE, first, text, severity, START_HINT, headline=True)


def _guessed(run: Run, calls: list[TraceEvent]) -> tuple[BoolArray, BoolArray]:
    """Return path motions (m,) that cut for all their speed says, and those that may cut."""
    trace = run.paths.trace
    speed = trace.column("speed")
    may = trace.is_cp & ~_ways_back(run, calls) & ~rapid_speeds(speed, run.cell)
    cuts = may & machining_speeds(speed, run.cell)
    return cuts, may & ~cuts


def _not_known(run: Run, rows: BoolArray) -> Iterator[Said]:
    """Warn of motions (m,) at a standstill of the spindle of which the text does not tell all."""
    if rows.any():
        first, count = int(np.argmax(rows)), int(rows.sum())
        speed = run.paths.trace.column("speed")[first]
        text = (
            f"the spindle stands on {count} path motions, the first at {speed:g} m/s: whether they "
            "cut is not known without the CAM file"
        )
        yield Remark(RunKind.SPINDLE, first, text, Severity.WARNING)


def _turns(calls: list[TraceEvent], words: Mapping[str, str], count: int) -> FloatArray:
    """Return the speed (m,) at each motion: 0 standing, NaN where the text does not tell it."""
    turns = np.full(count, _UNNAMED)
    for event in calls:
        turns[event.motion :] = 0.0 if words[event.name] in _STOPS else event.value * RPM
    return turns


def _ways_back(run: Run, calls: list[TraceEvent]) -> BoolArray:
    """Return (m,) path motions right behind a call that go back the way of the one before."""
    points = run.paths.end_point
    step = np.diff(points, axis=0, prepend=points[:1])
    known = np.isfinite(step).all(axis=1) & (np.linalg.norm(step, axis=1) > 0.0)
    back = np.zeros(len(points), dtype=np.bool_)
    called = np.zeros(len(points) + 1, dtype=np.bool_)
    called[[event.motion for event in calls]] = True
    rows = np.flatnonzero(known[1:] & known[:-1] & called[1:-1]) + 1
    back[rows] = angle_between(step[rows], step[rows - 1]) > _BACK
    return np.asarray(back & run.paths.trace.is_cp)


def _tell(bad: BoolArray, text: str) -> Iterator[Said]:
    """Report the first motion of each stretch."""
    for motion in list(_starts(bad))[:AT_MOST]:
        yield Remark(RunKind.SPINDLE, motion, text)


def _starts(bad: BoolArray) -> Iterator[int]:
    rows = np.flatnonzero(bad)
    yield from rows[np.diff(rows, prepend=-2) > 1].tolist()
