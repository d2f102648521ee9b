"""What jobs call: a plan to the program of the cell's emitter, and the check before it lands.

The planner has proven the moves of the plan, so the text has to say these and no others: every
move in its order, in its posture, along its arc. Motions that the plan does not have are let pass
before the first and behind the last of them (a template that drives home), and where a joint motion
of no length begins a sub-program.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.emitters.base import EMITTERS, Against, Emitter, Program, ReadBack
from postproc.errors import EmitError, Finding, Severity, SourceRef
from postproc.geometry import rotation_angle
from postproc.kinematics import build
from postproc.model import MoveKind, Plan
from postproc.units import DEG, MM

POSITION = 0.01 * MM
"""Largest distance of the tool point from the plan's."""
ANGLE = 0.005 * DEG
"""Largest angle of the tool to the plan's; the same for external axes that turn."""
POSTURE = 1.0 * DEG
"""From here on a joint is in another posture, although the tool may be where it should."""
SPEED = 1e-3
"""Largest share by which a path speed may be off: what rounding does."""


def emitter_of(cell: Cell) -> Emitter:
    """Return the emitter of a cell, whose programs can be checked."""
    name = cell.krl.emitter
    if name not in EMITTERS:
        raise EmitError("EMT340", EMITTERS.unknown(name), SourceRef(cell.path))
    emitter = EMITTERS.get(name)
    if not is_checkable(emitter):
        raise _unchecked(cell)
    return emitter


def is_checkable(emitter: Emitter) -> bool:
    """Return whether an emitter offers to read its programs back."""
    return type(emitter).read_back is not Emitter.read_back


def emit(plan: Plan, cell: Cell) -> Program:
    """Return the program of a plan, by the cell's emitter; it is not checked yet."""
    with EMITTERS.blame(cell.krl.emitter):
        return emitter_of(cell).emit(plan, cell)


def read_back(program: Program, plan: Plan, cell: Cell, against: Against) -> ReadBack:
    """Read a program back from its text, and compare it with the plan: see its findings."""
    with EMITTERS.blame(cell.krl.emitter):
        read = emitter_of(cell).read_back(program, cell, against)
    if read is None:
        raise _unchecked(cell)
    return replace(read, findings=(*read.findings, *differences(plan, cell, read)))


def written(plan: Plan, cell: Cell) -> Program:
    """Return the program of a plan that serves no CAM file, checked."""
    program = emit(plan, cell)
    for finding in read_back(program, plan, cell, Against()).findings:
        if finding.severity is Severity.ERROR:
            text = f"the program fails its check: {finding.message}"
            raise EmitError("EMT343", text, finding.source, finding.hint)
    return program


def motions_of(plan: Plan, is_path: BoolArray, q: FloatArray) -> IntArray | None:
    """Return the executed motion (m,) of each move, None if there is none for one of them.

    ``is_path`` (n,): whether an executed motion is along a path, else the joints go straight; ``q``
    (n, 6): joint angles at their ends [rad].
    """
    paths = is_path.tolist()
    wanted = np.asarray(plan.kind) != MoveKind.PTP
    start = _start(plan, is_path, q)
    if len(paths) - start == len(plan) and np.array_equal(is_path[start:], wanted):
        return np.arange(start, len(paths), dtype=np.int32)
    found = np.zeros(len(plan), dtype=np.int32)
    standing = ~is_path & (np.abs(np.diff(q, axis=0, prepend=np.inf)).max(axis=1) < ANGLE)
    motion = start
    for move, is_cp in enumerate(wanted.tolist()):
        while motion < len(paths) and not paths[motion]:
            is_other = standing[motion] and np.abs(q[motion] - plan.q[move]).max() > POSTURE
            if not (is_cp or is_other):
                break
            motion += 1
        if motion >= len(paths) or paths[motion] != is_cp:
            return None
        found[move] = motion
        motion += 1
    return found


def _start(plan: Plan, is_path: BoolArray, q: FloatArray) -> int:
    """Return the motion of the first move: those before it are joint motions to elsewhere."""
    lead = len(is_path) if not is_path.any() else int(np.argmax(is_path))
    near = np.abs(q[:lead] - plan.q[0]).max(axis=1, initial=0.0) < POSTURE
    return int(np.argmax(near)) if near.any() else 0


def differences(plan: Plan, cell: Cell, read: ReadBack) -> Iterator[Finding]:
    """Yield where a text is not its plan: the first place of each kind."""
    motion = motions_of(plan, read.kind != MoveKind.PTP, read.q)
    if motion is None:
        yield _error(f"it does not have all {len(plan)} moves of the plan in order")
        return
    yield from _unplanned(read, motion)
    for what, bad in _bad(plan, cell, read, motion):
        rows = np.flatnonzero(bad)
        if len(rows):
            more = f" ({len(rows)} times)" if len(rows) > 1 else ""
            yield _error(f"{what}{more}", _place(read, int(motion[rows[0]])))


def _unplanned(read: ReadBack, motion: IntArray) -> Iterator[Finding]:
    """Yield motions between the moves that the plan does not have."""
    other = np.setdiff1d(np.arange(motion[0], motion[-1] + 1), motion)
    length = np.abs(read.q[other] - read.q[np.maximum(other - 1, 0)]).max(axis=1, initial=0.0)
    for row in other[(read.kind[other] != MoveKind.PTP) | ~(length < ANGLE)][:1].tolist():
        yield _error("it has a motion that is not in the plan", _place(read, row))


def _bad(
    plan: Plan, cell: Cell, read: ReadBack, motion: IntArray
) -> Iterator[tuple[str, BoolArray]]:
    """Yield what may be wrong with moves, and where it is (m,). NaN is wrong everywhere."""
    q = read.q[motion]
    kind = np.where(_is_line(plan) & (read.kind[motion] == MoveKind.LIN), MoveKind.LIN, plan.kind)
    yield "a motion of another kind", read.kind[motion] != kind
    T_flange_tcp = cell.tcp_of(plan.tool_of_moves)
    T, T_plan = (build(cell.robot).fk(joints) @ T_flange_tcp for joints in (q, plan.q))
    off = np.linalg.norm(T[:, :3, 3] - T_plan[:, :3, 3], axis=1)
    turned = rotation_angle(T[:, :3, :3], T_plan[:, :3, :3])
    yield "the tool is not where the plan has it", ~(off < POSITION) | ~(turned < ANGLE)
    yield "another posture of the arm", ~(np.abs(q - plan.q).max(axis=1) < POSTURE)
    if plan.external.shape[1]:
        yield "an external axis is elsewhere", ~_external_is_met(plan, cell, read, motion)
    arcs = kind == MoveKind.CIRC
    aux = np.full((len(plan), 3), np.nan) if read.aux is None else read.aux[motion]
    yield "an arc goes another way", arcs & ~(np.linalg.norm(aux - plan.aux, axis=1) < POSITION)
    if read.speed is not None:
        share = np.abs(read.speed[motion] / plan.speed - 1.0)
        yield "another path speed", np.isfinite(read.speed[motion]) & (share > SPEED)


def _is_line(plan: Plan) -> BoolArray:
    """Return the arcs (m,) that are too flat to differ from the line to their end."""
    end = plan.T_base_tcp[:, :3, 3]
    start = np.concatenate([end[:1], end[:-1]])
    chord, to_aux = end - start, plan.aux - start
    length = np.maximum(np.linalg.norm(chord, axis=1), 1e-12)
    share = np.einsum("ij,ij->i", to_aux, chord) / length**2
    rise = np.linalg.norm(np.cross(to_aux, chord), axis=1) / length
    arcs = np.asarray(plan.kind) == MoveKind.CIRC
    return np.asarray(arcs & (rise < POSITION) & (share > 0.0) & (share < 1.0))


def _external_is_met(plan: Plan, cell: Cell, read: ReadBack, motion: IntArray) -> BoolArray:
    """Return where (m,) all external axes are as planned."""
    if read.external is None or read.external.shape[1] != plan.external.shape[1]:
        return np.zeros(len(plan), dtype=bool)
    most = np.array([POSITION if axis.kind == "rail" else ANGLE for axis in cell.external_axes])
    return np.asarray((np.abs(read.external[motion] - plan.external) < most).all(axis=1))


def _place(read: ReadBack, motion: int) -> SourceRef | None:
    if read.line is None:
        return None
    file = "" if read.file is None else read.files[int(read.file[motion])]
    return SourceRef(file, int(read.line[motion]))


def _error(what: str, source: SourceRef | None = None) -> Finding:
    text = f"the program text is not the plan: {what}"
    hint = "this is a fault of the emitter, not of the input; please report it"
    return Finding(Severity.ERROR, "EMT342", text, source=source, hint=hint)


def _unchecked(cell: Cell) -> EmitError:
    name = cell.krl.emitter
    text = f"the emitter {name!r} cannot read its programs back: no program is written unchecked"
    hint = "use another emitter, or a version of it that offers read_back"
    return EmitError("EMT341", text, SourceRef(cell.path), hint)
