"""The motions of one file: statements in order, with what is modal written only when it changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from postproc.emitters.krl_columns import Columns, is_flying
from postproc.emitters.krl_events import EventWriter
from postproc.emitters.krl_style import KrlStyle
from postproc.krl.comments import comment_text
from postproc.krl.program import (
    Assign,
    Axes,
    Call,
    Comment,
    Enum,
    FoldBegin,
    FoldEnd,
    Move,
    MoveWord,
    Pose,
    Statement,
    Value,
)
from postproc.krl.split import Part
from postproc.model.plan import MoveKind, Plan
from postproc.model.toolpath import Event, EventKind

ANCHOR_PERCENT = 10.0
"""Axis speed of the PTP of no length that begins a sub-program in the middle of a CP chain [%]."""
SPLINE_SEGMENTS = 500
"""Longest spline block; a longer chain is cut into blocks that blend into each other."""
_WORDS = {
    False: (MoveWord.PTP, MoveWord.LIN, MoveWord.CIRC),
    True: (MoveWord.SPTP, MoveWord.SLIN, MoveWord.SCIRC),
}


@dataclass(slots=True)
class Modal:
    """What the controller has set since the head of this file; None = not known."""

    speed_m_s: float | None = None
    blend_mm: float | None = None
    percent: float | None = None

    def forget(self) -> None:
        """Know nothing any more."""
        self.speed_m_s = self.blend_mm = self.percent = None


@dataclass(slots=True)
class PartWriter:
    """Writes the moves of one file.

    Args:
        plan: the whole plan; table: its columns; part: the moves of this file.
        style: the cell's choices; events: what events become.
        by_index: events by the move they come before.
        point: puts a target into the data list and returns its name; None writes it in place.
    """

    plan: Plan
    table: Columns
    part: Part
    style: KrlStyle
    events: EventWriter
    by_index: Mapping[int, Sequence[Event]]
    point: Callable[[int, Pose | Axes], Value] | None = None
    out: list[Statement] = field(default_factory=list)
    modal: Modal = field(default_factory=Modal)
    _operation: int = -1

    def statements(self) -> list[Statement]:
        """Return all statements of the moves, events and waits of this file."""
        first = self.part.first
        if self.table.kind[first] != MoveKind.PTP:
            self._anchor(first - 1)
        self.moves(range(first, self.part.stop))
        self._close_operation()
        if self.part.stop == len(self.plan):
            self._events_before(self.part.stop)
        return self.out

    def moves(self, indices: Iterable[int]) -> None:
        """Write motions one by one."""
        for index in indices:
            self._before(index)
            self._motion(index)
            self._after(index)

    # ------------------------------------------------------------------ around the motions

    def _before(self, index: int) -> None:
        operation = self.table.operation[index]
        if operation != self._operation:
            self._close_operation()
            self._open_operation(operation)
        if index in self.by_index:
            self._events_before(index)

    def _after(self, index: int) -> None:
        dwell = self.table.dwell_s[index]
        if dwell > 0.0:
            self.out += self.events.dwell(dwell, self.table.line[index])

    def _events_before(self, index: int) -> None:
        for event in self.by_index.get(index, ()):
            quiet = event.kind in (EventKind.MESSAGE, EventKind.UNKNOWN)
            flying = not quiet and is_flying(self.plan, index, event.kind)
            self.out += self.events.statements(event, flying=flying)

    def _open_operation(self, operation: int) -> None:
        self._operation = operation
        if operation >= 0:
            named = self.plan.toolpath.operations[operation]
            name = comment_text(named.name)
            text = f"OPERATION {operation + 1}: {name} (CAM line {named.line})"
            self.out.append(FoldBegin(f"{text};%{{PE}}"))

    def _close_operation(self) -> None:
        if self._operation >= 0:
            self.out.append(FoldEnd(f"(OPERATION {self._operation + 1})"))
        self._operation = -1

    def _anchor(self, index: int) -> None:
        """Go to where the file before has ended: no length, but status, turn and place are sure."""
        self._percent(ANCHOR_PERCENT)
        self.out.append(Comment(" re-entry: where the file before ends"))
        self.out.append(Move(self._words[MoveKind.PTP], self._axes(index)))

    # ------------------------------------------------------------------------- the motions

    @property
    def _words(self) -> tuple[MoveWord, MoveWord, MoveWord]:
        return _WORDS[self.style.motion in ("spline", "spline_block")]

    def _motion(self, index: int) -> None:
        table = self.table
        kind = table.kind[index]
        blend = self._blend(index, kind)
        target: Value = self._axes(index) if kind == MoveKind.PTP else self._pose(index)
        auxiliary: Value | None = None
        if kind == MoveKind.PTP:
            self._percent(table.percent[index])
        else:
            self._speed(table.speed_m_s[index])
            aux = table.auxiliary[index]
            if aux is not None:
                auxiliary = self._target(index, _pose(aux, table.external[index]))
        target = self._target(index, target)
        self.out.append(
            Move(
                self._words[kind],
                target,
                auxiliary,
                blend=blend,
                comment=self.cam_line(index),
            )
        )

    def cam_line(self, index: int) -> str:
        """Return the comment that names the CAM line of a move."""
        line = self.table.line[index]
        return f" CAM line {line}" if line and self.style.cam_lines else ""

    def _target(self, index: int, target: Value) -> Value:
        if self.point is None or not isinstance(target, Pose | Axes):
            return target
        return self.point(index, target)

    def _axes(self, index: int) -> Axes:
        a1, a2, a3, a4, a5, a6 = self.table.axes[index]
        return Axes(a1, a2, a3, a4, a5, a6, self.table.external[index])

    def _pose(self, index: int) -> Pose:
        return _pose(self.table.pose[index], self.table.external[index])

    # ------------------------------------------------------------------------ what is modal

    def _percent(self, percent: float) -> None:
        if percent != self.modal.percent:
            self.modal.percent = percent
            value = int(percent) if percent == int(percent) else percent
            self.out.append(Call("BAS", (Enum("VEL_PTP"), value)))

    def _speed(self, speed_m_s: float) -> None:
        if speed_m_s != self.modal.speed_m_s:
            self.modal.speed_m_s = speed_m_s
            self.out.append(Assign("$VEL.CP", speed_m_s))

    def _blend(self, index: int, kind: int) -> tuple[str, ...]:
        """Return the approximation words of a move, after setting its distance."""
        blend = self.table.blend_mm[index]
        if blend <= 0.0:
            return ()
        following = index + 1
        is_ptp_next = following < len(self.table) and self.table.kind[following] == MoveKind.PTP
        is_spline = self.style.motion != "dense" and self.style.motion != "forms"
        if kind == MoveKind.PTP and is_ptp_next:
            return ("C_SPL",) if is_spline else ("C_PTP",)
        self._distance(index, blend)
        if is_spline:
            return ("C_SPL",)
        return ("C_PTP", "C_DIS") if kind == MoveKind.PTP else ("C_DIS",)

    def _distance(self, index: int, blend: float) -> None:
        """Set $APO.CDIS; a value already set is kept where short segments ask for less."""
        known = self.modal.blend_mm
        is_cut_short = blend < self.table.wanted_mm[index]
        if known is not None and is_cut_short and 0.5 * blend <= known <= blend:
            return
        if known != blend:
            self.modal.blend_mm = blend
            self.out.append(Assign("$APO.CDIS", blend))


def _pose(values: Sequence[float], external: tuple[float, ...]) -> Pose:
    x, y, z, a, b, c = values
    return Pose(x, y, z, a, b, c, external=external)
