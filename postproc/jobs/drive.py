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
from postproc.kinematics import Kinematics, build
from postproc.model import Event, EventKind, MotionKind, MoveKind, MoveRole, Plan, ToolPath
from postproc.records import dataclass
from postproc.stiffness.sample import SamplingPlan

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


AreFree = Callable[[FloatArray, FloatArray], BoolArray]
"""Joint angles (m, 6) from and to [rad]: is the straight PTP between them free (m,)."""
_NEIGHBOURS = 8


def with_free_ways(
    plan: SamplingPlan, are_free: AreFree | None
) -> tuple[SamplingPlan, tuple[str, ...], tuple[int, ...], tuple[int, ...]]:
    """Return the plan with ways that are free, the names left out, the way, and the way back.

    Where the straight motion to the next posture collides, the way goes through other postures of
    the plan. Postures without any free way to the largest connected group are left out. The way of
    one pass is in 1-based numbers of postures, negative to pass without reading.
    """
    if are_free is None:
        return plan, (), tuple(range(1, len(plan) + 1)), ()
    kept, _, way, back = free_ways(plan.q, are_free)
    lost = np.setdiff1d(np.arange(len(plan)), kept)
    part = plan.rows(kept) if len(lost) else plan
    return part, tuple(plan.name(int(i)) for i in lost), way, back


def free_ways(
    q: FloatArray, are_free: AreFree, via: FloatArray | None = None
) -> tuple[IntArray, FloatArray, tuple[int, ...], tuple[int, ...]]:
    """Return ways through postures (n, 6) [rad] in their order, each straight where that is free.

    The postures kept (k,), those of the largest connected group; all postures (j, 6) that ways lead
    through, those kept first, ``via`` (m, 6) may be among them; the way: numbers of the latter from
    1, negative to pass without stopping; and the numbers to pass on the way back to the first.
    """
    n = len(q)
    everything = np.arange(n, dtype=np.int32)
    straight = tuple(range(1, n + 1))
    if n < 2:
        return everything, q, straight, ()
    ring = np.column_stack([everything, np.roll(everything, -1)])
    if bool(np.all(are_free(q[ring[:, 0]], q[ring[:, 1]]))):
        return everything, q, straight, ()
    nodes = q if via is None else np.vstack([q, via])
    pairs = np.unique(np.sort(np.vstack([ring, _near(nodes)]), axis=1), axis=0)
    open_ = pairs[are_free(nodes[pairs[:, 0]], nodes[pairs[:, 1]])]
    group = _largest_group(open_, len(nodes), n)
    number = np.full(len(nodes), -1)
    number[group] = np.arange(len(group))
    inside = open_[np.isin(open_, group).all(axis=1)]
    kept = group[group < n]
    before = _predecessors(number[inside], nodes[group])
    way = [1]
    for i in range(1, len(kept)):
        way += [-(k + 1) for k in _between(before, i - 1, i)] + [i + 1]
    back = tuple(k + 1 for k in _between(before, len(kept) - 1, 0))
    return kept, nodes[group], tuple(way), back


def _near(q: FloatArray) -> IntArray:
    """Return pairs (m, 2) of each posture and its nearest ones by the largest joint motion."""
    from scipy.spatial import cKDTree

    count = min(_NEIGHBOURS + 1, len(q))
    _, near = cKDTree(q).query(q, k=count, p=np.inf)
    first = np.repeat(np.arange(len(q)), count - 1)
    return np.column_stack([first, np.asarray(near)[:, 1:].reshape(-1)]).astype(np.int32)


def _largest_group(pairs: IntArray, n: int, stops: int) -> IntArray:
    """Return the nodes of the group that holds most of the first ``stops``."""
    from scipy.sparse.csgraph import connected_components

    label = connected_components(_graph(pairs, np.ones(len(pairs)), n), directed=False)[1]
    return np.flatnonzero(label == np.bincount(label[:stops]).argmax()).astype(np.int32)


def _predecessors(pairs: IntArray, q: FloatArray) -> IntArray:
    """Return (n, n): the posture before j on the shortest way from i."""
    from scipy.sparse.csgraph import dijkstra

    length = np.max(np.abs(q[pairs[:, 0]] - q[pairs[:, 1]]), axis=1) + 1e-6
    before: IntArray = dijkstra(
        _graph(pairs, length, len(q)), directed=False, return_predecessors=True
    )[1]
    return before


def _graph(pairs: IntArray, length: FloatArray, n: int):  # type: ignore[no-untyped-def]  # noqa: ANN202
    from scipy.sparse import coo_array

    return coo_array((length, (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()


def _between(before: IntArray, start: int, end: int) -> list[int]:
    """Return the postures between start and end on the shortest way."""
    way: list[int] = []
    at = int(before[start, end])
    while at not in (start, -9999):
        way.append(at)
        at = int(before[start, at])
    return way[::-1]
