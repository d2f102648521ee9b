"""What every emitter must keep: the same bytes every time, and a read-back that cannot be fooled.

The checks write plans of a made-up part, and plans that were changed behind the emitter's back:
what it reads from a text must be what stands there, not what the plan said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path, PurePath

import numpy as np

from postproc.cell import Cell
from postproc.emitters import Against, Emitter, Program, differences
from postproc.errors import EmitError, Finding, PostprocError
from postproc.model import Event, EventKind, MoveKind, Plan
from postproc.records import dataclass
from postproc.testing.contract import require
from postproc.testing.made import made_cell, made_plan
from postproc.units import DEG, MM


@dataclass(frozen=True, slots=True)
class Case:
    """A plan with its cell."""

    plan: Plan
    cell: Cell


Check = Callable[[Emitter, Case], None]


def check_program(emitter: Emitter, case: Case) -> None:
    """It gives files of plain names with something in them, and nothing of this machine."""
    program = emitter.emit(case.plan, case.cell)
    _require(isinstance(program, Program), emitter, "emit gives no Program")
    _require(bool(program.files) and bool(program.name), emitter, "a program without name or files")
    for name, content in program.files.items():
        plain = PurePath(name).name == name and "\\" not in name
        _require(plain, emitter, f"the file name {name!r} has a folder in it")
        _require(isinstance(content, bytes) and bool(content), emitter, f"{name} is no bytes")
        for path in (case.cell.path, str(Path(case.cell.path).parent), str(Path.cwd())):
            _require(path.encode() not in content, emitter, f"{name} holds a path of this machine")


def check_again(emitter: Emitter, case: Case) -> None:
    """The same plan gives the same bytes, whatever was written before; the plan stays as it is."""
    before = {name: np.array(getattr(case.plan, name)) for name in ("q", "T_base_tcp", "speed")}
    first = emitter.emit(case.plan, case.cell)
    emitter.emit(_moved(case.plan, 0), case.cell)
    second = emitter.emit(case.plan, case.cell)
    same = list(first.files.items()) == list(second.files.items()) and first.name == second.name
    _require(same, emitter, "the second program of a plan is another one")
    kept = all(
        np.array_equal(getattr(case.plan, name), values, equal_nan=True)
        for name, values in before.items()
    )
    _require(kept, emitter, "it changes the plan")


def check_name(emitter: Emitter, case: Case) -> None:
    """A name that the controller cannot have becomes another one, and this is told."""
    wanted = "ä b/c: 1" + 80 * "x"
    program = emitter.emit(replace(case.plan, name=wanted), case.cell)
    check_program(emitter, Case(replace(case.plan, name=wanted), case.cell))
    told = dict(program.renamed).get(wanted, wanted)
    _require(told == program.name, emitter, "it renames the program without telling it")


def check_nothing_lost(emitter: Emitter, case: Case) -> None:
    """Events, waits and path speeds change the text, or are refused by name."""
    plain = emitter.emit(case.plan, case.cell).files
    for what, plan in _additions(case.plan):
        try:
            files = emitter.emit(plan, case.cell).files
        except EmitError:
            continue
        _require(files != plain, emitter, f"{what} is left out of the program without a word")


def check_read_back(emitter: Emitter, case: Case) -> None:
    """What it wrote it reads back: the moves of the plan and no others."""
    program = emitter.emit(case.plan, case.cell)
    for finding in _findings(emitter, case, program):
        _require(not finding.is_error, emitter, f"its own program fails: {finding.message}")


def check_honesty(emitter: Emitter, case: Case) -> None:
    """It reads the text and not the plan: the text of another plan is found out."""
    for what, plan in _others(case.plan):
        try:
            program = emitter.emit(plan, case.cell)
        except PostprocError:
            continue
        emitter.emit(case.plan, case.cell)  # the last one that it wrote
        found = any(finding.is_error for finding in _findings(emitter, case, program))
        _require(found, emitter, f"its read-back does not see {what}")


def check_damage(emitter: Emitter, case: Case) -> None:
    """A text that is cut off is found out, or refused with an expected error."""
    program = emitter.emit(case.plan, case.cell)
    name = max(program.files, key=lambda file: len(program.files[file]))
    for share in (0.0, 0.3, 0.6):
        content = program.files[name][: int(share * len(program.files[name]))]
        broken = replace(program, files={**program.files, name: content})
        try:
            found = any(finding.is_error for finding in _findings(emitter, case, broken))
        except PostprocError:
            continue
        except Exception as problem:  # noqa: BLE001 - whatever a foreign emitter may raise
            _require(False, emitter, f"reading {share:.0%} of {name} fails with {problem!r}")
        _require(found, emitter, f"its read-back does not see that {name} is cut off")


CHECKS: tuple[Check, ...] = (
    check_program,
    check_again,
    check_name,
    check_nothing_lost,
    check_read_back,
    check_honesty,
    check_damage,
)
"""All that is asked of an emitter."""


def check_emitter(emitter: Emitter, plan: Plan | None = None, cell: Cell | None = None) -> None:
    """Hold an emitter to its contract.

    Args:
        emitter: the part that the entry point names.
        plan: a plan that it can write; default: a made-up part with holes, cuts and an arc.
        cell: the cell of the plan.

    Raises:
        PluginError: PLG004 with what it breaks.
    """
    require(isinstance(emitter, Emitter), "the emitter", "it is no Emitter")
    case = Case(plan or _plan_for(emitter), cell or made_cell())
    for check in CHECKS:
        check(emitter, case)


def _plan_for(emitter: Emitter) -> Plan:
    """Return the made-up part, without its arc for a controller that has no arcs."""
    try:
        emitter.emit(made_plan(), made_cell())
    except EmitError:
        return made_plan(arcs=False)
    return made_plan()


def _findings(emitter: Emitter, case: Case, program: Program) -> tuple[Finding, ...]:
    """Return what is wrong with a program as that of a case's plan."""
    read = emitter.read_back(program, case.cell, Against())
    _require(read is not None, emitter, "it offers no read-back of its programs")
    return () if read is None else (*read.findings, *differences(case.plan, case.cell, read))


def _moved(plan: Plan, move: int) -> Plan:
    """Return the plan with the joints of one move, and its tool, somewhere else."""
    q, T = np.array(plan.q), np.array(plan.T_base_tcp)
    q[move, 0] += 0.5 * DEG
    T[move, :3, 3] += 3.0 * MM
    return replace(plan, q=q, T_base_tcp=T)


def _additions(plan: Plan) -> Iterator[tuple[str, Plan]]:
    """Yield what a plan has more, and this plan."""
    cuts = np.flatnonzero(np.asarray(plan.kind) != MoveKind.PTP)
    middle = int(cuts[len(cuts) // 2])
    for kind in EventKind:
        event = Event(int(plan.tag[middle]), kind, 1.0, "text", 1)
        events = sorted([*plan.events, (middle, event)], key=lambda pair: pair[0])
        yield f"the event {kind}", replace(plan, events=tuple(events))
    dwell, speed = np.array(plan.dwell), np.array(plan.speed)
    dwell[middle] += 1.5
    yield "a wait", replace(plan, dwell=dwell)
    speed[middle] *= 0.5
    yield "a path speed", replace(plan, speed=speed)


def _others(plan: Plan) -> Iterator[tuple[str, Plan]]:
    """Yield what is different in another plan, and this plan."""
    middle = len(plan) // 2
    yield "a move that goes elsewhere", _moved(plan, middle)
    yield "the last move that goes elsewhere", _moved(plan, len(plan) - 1)
    joints = np.flatnonzero(np.asarray(plan.kind) == MoveKind.PTP)
    turned = np.array(plan.q)
    turned[joints[-1], 5] += 2.0 * np.pi * (-1.0 if turned[joints[-1], 5] > 0.0 else 1.0)
    yield "a turn of the last axis", replace(plan, q=turned)
    arcs = np.flatnonzero(np.asarray(plan.kind) == MoveKind.CIRC)
    if len(arcs):
        aux, kind = np.array(plan.aux), np.array(plan.kind)
        aux[arcs[0], 2] += 3.0 * MM
        yield "an arc that goes another way", replace(plan, aux=aux)
        aux[arcs[0]], kind[arcs[0]] = np.nan, MoveKind.LIN
        yield "a line in place of an arc", replace(plan, aux=aux, kind=kind)


def _require(good: bool, emitter: Emitter, reason: str) -> None:
    require(good, f"the emitter {type(emitter).__name__}", reason)
