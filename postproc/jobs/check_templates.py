"""The cell's own templates, tested without a part: every event at home, written and read back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.cell import Cell
from postproc.emitters import Against, emit, read_back
from postproc.errors import Finding, PostprocError, Severity, SourceRef
from postproc.files import shown_from
from postproc.jobs.drive import Drive, motion_plan
from postproc.model import Event, EventKind, Plan
from postproc.planning import free_posture
from postproc.units import RPM

_RPM = 1234.0
_OF_HOOKS = (
    EventKind.SPINDLE_ON, EventKind.COOLANT_ON, EventKind.OPTIONAL_STOP, EventKind.STOP,
    EventKind.COOLANT_OFF, EventKind.SPINDLE_OFF, EventKind.TOOL_CHANGE,
)  # fmt: skip
"""Events that a routine of the integrator stands for, in an order that a program may have."""


def template_findings(cell: Cell) -> tuple[Finding, ...]:
    """Return what is wrong with the cell's own templates; none where it has none."""
    folder = Path(cell.path).parent / cell.krl.template
    if not folder.is_dir():
        text = f"the cell has no templates of its own: [krl] template = {cell.krl.template!r}"
        return (Finding(Severity.NOTE, "CEL148", text, source=SourceRef(cell.path)),)
    try:
        plan = _plan(cell)
        program = emit(plan, cell)
        read = read_back(program, plan, cell, Against())
    except PostprocError as problem:
        return (
            Finding(
                Severity.ERROR,
                problem.code,
                problem.message,
                source=problem.source,
                hint=problem.hint,
            ),
        )
    errors = [finding for finding in read.findings if finding.is_error]
    text = b"\n".join(program.files.values()).decode("ascii", "replace").upper()
    return (*errors, *_silent(cell, folder, text))


def _silent(cell: Cell, folder: Path, text: str) -> Iterator[Finding]:
    """Yield templates of events that do not call the routine that stands for it."""
    for kind in _OF_HOOKS:
        routine = cell.krl.hooks.get(str(kind))
        file = folder / f"{kind}.j2"
        if routine and file.is_file() and f"{routine.upper()}(" not in text:
            yield Finding(
                Severity.ERROR,
                "EMT336",
                f"the template of {kind} does not call {routine}, the routine of this event",
                source=SourceRef(shown_from(cell.path, file)),
                hint=f"name the routine that it calls: [krl.hooks] {kind} = ...",
            )


def _plan(cell: Cell) -> Plan:
    home = cell.motion.home
    q = free_posture(cell) if home is None else np.asarray(home)
    stand = np.zeros(6) if q is None else q
    plan = motion_plan(
        Drive(
            name="templates", cell=cell, q=np.stack([stand, stand]), reads=np.array([True, True]),
            names=("1", "2"), line=np.array([1, 2], dtype=np.int32), notes=(), speed=0.1, wait=1.0,
            halt=False, command="check",
        )
    )  # fmt: skip
    values = {EventKind.SPINDLE_ON: _RPM * RPM, EventKind.TOOL_CHANGE: float(cell.tool.number)}
    made = [Event(1, kind, values.get(kind, 0.0), line=1) for kind in _OF_HOOKS]
    made += [
        Event(1, EventKind.HOLE, 1.0, step, 1, (0.01, 0.002, _RPM * RPM))
        for step in cell.process.hole
    ]
    made += [Event(1, EventKind.MESSAGE, text="check of the templates", line=1)]
    return replace(plan, events=tuple((1, event) for event in made))
