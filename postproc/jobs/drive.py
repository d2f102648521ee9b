"""A program that drives through postures and takes readings at some of them.

Shared by the measuring plan of ``sample`` and the next measurements of ``diagnose``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.emitters import written
from postproc.geometry import inverse
from postproc.jobs.ways import AreFree
from postproc.kinematics import Kinematics, build
from postproc.model import Event, EventKind, MotionKind, MoveKind, MoveRole, Plan, ToolPath
from postproc.records import dataclass

IsFree = Callable[[FloatArray], BoolArray]
"""Joint angles (n, 6) [rad] to (n,) free of collision."""


@dataclass(frozen=True, slots=True)
class Note:
    """Words shown before a move (number from 0), and whether the program stops there."""

    move: int
    line: int
    text: str
    stop: bool


@dataclass(frozen=True, slots=True)
class Drive:
    """Postures in the order of driving.

    Args:
        name: of the program and of the CSV that is filled in.
        cell: robot, tool, workpiece frame.
        q: (m, 6) [rad]; reads: (m,) where a reading is taken.
        names: of the readings (r,); line: (r,) their lines in the CSV.
        notes: words and stops before moves.
        speed: 0..1 of PTP; wait: [s] at a reading; halt: wait for the operator instead.
        command: that made it.
    """

    name: str
    cell: Cell
    q: FloatArray
    reads: BoolArray
    names: tuple[str, ...]
    line: IntArray
    notes: tuple[Note, ...]
    speed: float
    wait: float
    halt: bool
    command: str


@dataclass(frozen=True, slots=True)
class Checks:
    """Collision checks of postures and of the straight PTP ways between them."""

    is_free: IsFree
    are_free: AreFree

    @classmethod
    def of(cls, cell: Cell, kinematics: Kinematics) -> Checks:
        """Return the checks of a cell, the arm against itself included."""
        scene = Scene.build(cell, kinematics)

        def is_free(q: FloatArray) -> BoolArray:
            return ~np.asarray(scene.check(q).hit, dtype=bool)

        def are_free(q_from: FloatArray, q_to: FloatArray) -> BoolArray:
            return ~np.asarray(scene.check_paths(q_from, q_to).hit, dtype=bool)

        return cls(is_free, are_free)


def program_files(drive: Drive) -> Mapping[str, bytes]:
    """Return the files of the program, checked.

    A stop waits for the operator by itself: the program must run on a controller without the
    routines that a machining cell defines.

    Raises:
        EmitError: as ``emitters.written``.
    """
    return written(motion_plan(drive), drive.cell).files


def motion_plan(drive: Drive) -> Plan:
    """Return the motions: one exact PTP a posture."""
    cell, q, reads = drive.cell, drive.q, drive.reads
    kinematics = build(cell.robot)
    m, tags = len(q), len(drive.names)
    T_base_tcp = inverse(cell.workpiece.T_robroot_base) @ kinematics.fk(q) @ cell.tool.T_flange_tcp
    speed = np.asarray(cell.robot.qd_max) * drive.speed
    duration = np.max(np.abs(np.diff(q, axis=0, prepend=q[:1])) / speed, axis=1)
    dwell = np.where(reads & (not drive.halt), drive.wait, 0.0)
    return Plan(
        name=drive.name,
        toolpath=_toolpath(drive, q[reads], T_base_tcp[reads]),
        kind=np.full(m, MoveKind.PTP),
        role=np.where(np.arange(m) == 0, MoveRole.ENTRY, MoveRole.RAPID),
        tag=np.maximum(np.cumsum(reads) - 1, 0).astype(np.int32),
        T_base_tcp=T_base_tcp,
        aux=np.full((m, 3), np.nan),
        q=q,
        spin=np.zeros(m),
        branch=kinematics.slot(q),
        speed=np.full(m, np.nan),
        ptp_fraction=np.full(m, drive.speed),
        blend=np.zeros(m),
        dwell=dwell,
        duration=duration,
        external=np.zeros((m, len(cell.external_axes))),
        stiffness=np.full(tags, np.nan),
        stiffness_initial=np.full(tags, np.nan),
        clearance=np.full(tags, np.nan),
        events=_events(drive),
        tool=np.full(m, cell.tool_index),
        base=np.full(m, cell.base_index),
        settings={"command": drive.command},
    )


def _events(drive: Drive) -> tuple[tuple[int, Event], ...]:
    """Return messages and stops: those of the notes, and at each reading when asked for."""
    events: list[tuple[int, Event]] = []
    if drive.halt:
        for move, line in zip(np.flatnonzero(drive.reads), drive.line, strict=True):
            after = int(move) + 1
            stop = Event(after, EventKind.HALT, text="take the reading", line=int(line))
            events.append((after, stop))
    # behind the halts: the last reading is taken before the load is changed
    for note in drive.notes:
        message = Event(note.move, EventKind.MESSAGE, text=note.text, line=note.line)
        events.append((note.move, message))
        if note.stop:
            stop = Event(note.move, EventKind.HALT, text=note.text, line=note.line)
            events.append((note.move, stop))
    return tuple(sorted(events, key=lambda pair: pair[0]))


def _toolpath(drive: Drive, q: FloatArray, T_base_tcp: FloatArray) -> ToolPath:
    m = len(q)
    none = np.full(m, -1)
    return ToolPath(
        path=f"{drive.name}.csv",
        name=drive.name,
        format="csv",
        dialect="",
        units="mm",
        points=T_base_tcp[:, :3, 3],
        axes=-(T_base_tcp[:, :3, :3] @ np.asarray(drive.cell.tool.axis)),
        kind=np.full(m, MotionKind.JOINT),
        feed=np.full(m, np.nan),
        line=drive.line.astype(np.int32),
        operation=none,
        tool=none,
        arc=none,
        cycle=none,
        joints=q,
        names=drive.names,
    )
