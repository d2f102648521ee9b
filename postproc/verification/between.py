"""What stands between two motions of one cut, and what the advance run makes happen early.

A tool that stands, a spindle that stops, another acceleration or any other thing that changes in
the middle of a cut marks the part. So nothing may be run there but what the CAM file asks for, and
what sets the feed and the approximation of the next motion, which are judged as such.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray
from postproc.controller import EventWord, Settings, TraceEvent
from postproc.errors import RunKind, Severity
from postproc.paths import Paths
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Cuts, Run

_ON_THE_SPOT = 1e-5
"""On a shorter way [m] the tool turns where it is, and the orientation speed is its feed."""
_STANDS = (EventWord.DWELL, EventWord.WAIT_FOR, EventWord.HALT)
_JUDGED = ("$VEL.CP", "$APO.CDIS", "$APO.CPTP", "$VEL_AXIS")
"""What other checks hold against the CAM file and the cell, and what counts for joint motions."""
_TURNING = ("$VEL.ORI1", "$VEL.ORI2")
"""Of a tool that turns on the spot they are the feed."""
_FRAMES = ("tool", "base", "tool_number", "base_number", "load_number", "load_mass")


def check_between(run: Run) -> Iterator[Said]:
    """Yield what stands in the middle of a cut and is not in the CAM file.

    Without a file the speed alone tells what cuts, so it is no more than worth a warning.
    """
    paths, cuts = run.paths, run.cuts
    trace, found = paths.trace, 0
    severity = Severity.WARNING if cuts.asked is None else Severity.ERROR
    for event, text in (*_unasked(paths, cuts), *_asides(paths, cuts)):
        found += 1
        if found <= AT_MOST:
            kind = RunKind.DWELL if event.word in _STANDS else RunKind.EVENT
            yield Remark(kind, trace.place_of(event), f"{event.name} {text}", severity)
    at = np.flatnonzero(cuts.inside[1:-1]) + 1
    at = at[trace.setting[at] != trace.setting[at - 1]]
    spot = paths.curves.length <= _ON_THE_SPOT
    for motion in at.tolist():
        on_the_spot = bool(spot[motion] or spot[motion - 1])
        before, after = (trace.settings[trace.setting[k]] for k in (motion - 1, motion))
        names = list(_changed(before, after, _JUDGED + _TURNING * on_the_spot))
        found += bool(names)
        if names and found <= AT_MOST:
            text = (
                f"{', '.join(names)} changes in the middle of a cut, not asked for by the CAM file"
            )
            yield Remark(RunKind.EVENT, motion, text, severity)


def _changed(before: Settings, after: Settings, judged: tuple[str, ...]) -> Iterator[str]:
    """Yield what is in force at the second of two motions and was not at the first."""
    for name in _FRAMES:
        old, new = getattr(before, name), getattr(after, name)
        if old != new and (old == old or new == new):
            yield name.replace("_", " ")
    old, new = dict(before.system), dict(after.system)
    for name in sorted(old.keys() | new.keys()):
        if not name.startswith(judged) and old.get(name) != new.get(name):
            yield name


def _unasked(paths: Paths, cuts: Cuts) -> Iterator[tuple[TraceEvent, str]]:
    """Yield events of the process in cuts that the file does not ask for, and what they do."""
    if cuts.asked is None:
        return
    events, inside = paths.trace.events, cuts.inside
    served = {events[number].motion for number in cuts.asked}
    for number, event in enumerate(events):
        if number in cuts.asked or event.is_within or not _acts(event, cuts, inside):
            continue
        if event.word is EventWord.DWELL and event.value == 0.0 and event.motion in served:
            continue  # the arm is waited for, as what follows needs it
        yield event, _words(event, inside)


def _asides(paths: Paths, cuts: Cuts) -> Iterator[tuple[TraceEvent, str]]:
    """Yield what is run in cuts beside motions and process."""
    inside = cuts.inside
    for aside in paths.trace.asides:
        if not aside.is_within and _acts(aside, cuts, inside):
            yield aside, _words(aside, inside)


def _acts(event: TraceEvent, cuts: Cuts, inside: BoolArray) -> bool:
    """Return whether something happens in a cut: where it stands, on the way, or run ahead."""
    motion = event.motion
    if inside[motion]:
        return True
    if event.on_the_way:
        return bool((cuts.number[motion : motion + 1] >= 0).any())
    early = 0 if event.is_surmise else event.early
    return bool((cuts.number[motion - early : motion] >= 0).any())


def _words(event: TraceEvent, inside: BoolArray) -> str:
    where = "in the middle of a cut"
    if not inside[event.motion]:
        where = "in a cut, on the way" if event.on_the_way else "acts early, in the cut before"
    stands = event.word in _STANDS and not event.on_the_way
    what = "the tool is in the material" if stands else "the CAM file does not ask for it"
    return f"{where}: {what}"


def check_advance(run: Run) -> Iterator[Said]:
    """Yield what the advance run lets happen before the motions that stand in front of it."""
    cell, trace = run.cell, run.paths.trace
    hooks = {name.upper() for name in cell.krl.hooks.values()}
    outputs = {f"$OUT[{number}]" for number in cell.krl.outputs.values()}
    surmised, found = [], 0
    for event in trace.events:
        is_own = event.word in _STANDS or event.name in hooks | outputs
        if not (event.early and is_own):
            continue
        if event.is_surmise:
            surmised.append(event)
            continue
        found += 1
        if found <= AT_MOST:
            text = f"{event.name} acts up to {event.early} motions early: nothing stops the advance"
            yield Remark(RunKind.ADVANCE, trace.place_of(event), f"{text} run before it")
    if surmised:
        first = surmised[0]
        names = ", ".join(sorted({event.name for event in surmised}))
        text = (
            f"{names} may act up to {max(e.early for e in surmised)} motions early: not among "
            "these files; [krl.hooks] stops_advance names routines that stop the advance run"
        )
        yield Remark(RunKind.ADVANCE, trace.place_of(first), text, Severity.WARNING)
