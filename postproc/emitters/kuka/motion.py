"""The motions of one file: statements in order, with what is modal written only when it changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field

from postproc import krl
from postproc.cell import HomeStyle, KrlOptions, MotionStyle, PointPlace
from postproc.emitters.kuka.columns import Columns, is_flying
from postproc.emitters.kuka.events import EventWriter
from postproc.emitters.kuka.forms import FormWriter
from postproc.emitters.kuka.points import PointStore
from postproc.emitters.kuka.restart import STATES, HoleGuards, Key, Stage
from postproc.model import Event, EventKind, MoveKind, MoveRole, Plan
from postproc.records import dataclass
from postproc.units import DEG

ANCHOR_PERCENT = 10.0
"""Largest axis speed of the PTP of no length that begins a sub-program in the middle of a CP chain
[%]; less where the cell moves slower."""
SPLINE_SEGMENTS = 500
"""Longest spline block; a longer chain is cut into blocks that blend into each other."""
FORM_ROLES = (MoveRole.ENTRY, MoveRole.APPROACH)
"""Moves that become inline forms when a cell asks for them."""
_PTP = int(MoveKind.PTP)
_QUIET = (EventKind.MESSAGE, EventKind.UNKNOWN)
_WORDS = {
    False: (krl.MoveWord.PTP, krl.MoveWord.LIN, krl.MoveWord.CIRC),
    True: (krl.MoveWord.SPTP, krl.MoveWord.SLIN, krl.MoveWord.SCIRC),
}


@dataclass(slots=True)
class Modal:
    """What the controller has set since the head of this file; None = not known."""

    speed_m_s: float | None = None
    orientation_deg_s: float | None = None
    """None: that of the cell, which the head of the file has set."""
    blend_mm: float | None = None
    percent: float | None = None
    is_disturbed: bool = False
    """A form has set speeds and approximations of its own."""

    def disturb(self) -> None:
        """Know nothing any more."""
        self.speed_m_s = self.blend_mm = self.percent = self.orientation_deg_s = None
        self.is_disturbed = True


@dataclass(slots=True)
class PartWriter:
    """Writes the moves of one file.

    Args:
        plan: the whole plan; table: its columns; part: the moves of this file.
        style: the cell's choices; events: what events become.
        by_index: events by the move they come before; values: what the frame templates get at a
            move. points: the data list of this file; forms: writer of inline forms; homes: moves
            that end where ``[motion] home_deg`` is; anchor_percent: axis speed of a PTP that only
            makes sure of where the arm stands.
    """

    plan: Plan
    table: Columns
    part: krl.Part
    style: KrlOptions
    events: EventWriter
    by_index: Mapping[int, Sequence[Event]]
    values: Callable[[int], Mapping[str, object]]
    points: PointStore
    forms: FormWriter
    homes: frozenset[int]
    anchor_percent: float
    guards: HoleGuards | None = None
    out: list[krl.Statement] = field(default_factory=list)
    modal: Modal = field(default_factory=Modal)
    _operation: int = -1
    _pending: list[krl.Statement] = field(default_factory=list)
    """Triggers that wait for their motion."""
    _key: Key = (Stage.ALWAYS, 0)
    _done: tuple[int, int] = (-1, 0)
    """Move whose first events, so many, have been written."""
    _words: tuple[krl.MoveWord, krl.MoveWord, krl.MoveWord] = field(init=False)
    _orientation_deg_s: float = field(init=False)
    """Of the cell."""
    _blended: tuple[str, ...] = field(init=False)
    """How a motion is approximated by a distance."""
    _in_data: bool = field(init=False)
    """Whether targets stand in the data list."""

    def __post_init__(self) -> None:
        """Ask the cell once what every motion needs."""
        self._words = _WORDS[self.style.is_spline]
        self._blended = ("C_SPL",) if self.style.is_spline else ("C_DIS",)
        self._in_data = self.style.points is PointPlace.DAT
        self._orientation_deg_s = self.style.orientation_speed / DEG

    def statements(self) -> list[krl.Statement]:
        """Return all statements of the moves, events and waits of this file."""
        first = self.part.first
        if self.table.kind[first] != MoveKind.PTP and self.guards is None:
            self._anchor(first - 1)
        self._moves(first, self.part.stop)
        if self.part.stop == len(self.plan):
            self._finish()
        if self.guards is not None:
            self.out += self.guards.leave(self._key)
        self._close_operation()
        return self.out

    def _finish(self) -> None:
        """Write what comes behind the last move: first what belongs to its hole."""
        stop, guards = self.part.stop, self.guards
        events = self.by_index.get(stop, ())
        if guards is not None:
            own = [event for event in events if event.kind is EventKind.HOLE]
            self._write(own, stop)
            self.out += guards.leave(self._key)
            self._key = (Stage.ALWAYS, 0)
            events = [event for event in events if event.kind is not EventKind.HOLE]
        self._close_operation()
        self._write(events, stop)

    def _moves(self, first: int, stop: int) -> None:
        in_blocks = self.style.motion is MotionStyle.SPLINE_BLOCK
        in_forms = self.style.motion is MotionStyle.FORMS
        index = first
        while index < stop:
            self._guard(index)
            end = self._block_end(index, stop) if in_blocks else index + 1
            if end - index > 1:
                self._block(index, end)
            else:
                self._before(index)
                if index in self.homes and self.style.home is not HomeStyle.AXES:
                    self._home(index)
                elif in_forms and self.table.role[index] in FORM_ROLES:
                    self._form(index)
                else:
                    self._motion(index)
            dwell = self.table.dwell_s[end - 1]
            if dwell > 0.0:
                self.out += self.events.dwell(dwell, self.table.line[end - 1])
            index = end

    # ------------------------------------------------------------------ around the motions

    def _before(self, index: int) -> None:
        self._operation_of(index)
        if self._frames_change(index):
            self._frames(index)
        events = self.by_index.get(index)
        if not events:
            return
        if self._done[0] == index:
            events = events[self._done[1] :]
        self._write(events, index)

    def _operation_of(self, index: int) -> None:
        operation = self.table.operation[index]
        if operation != self._operation:
            self._close_operation()
            self._open_operation(operation)

    def _guard(self, index: int) -> None:
        """Close what is run for one hole only, and open the next."""
        guards = self.guards
        if guards is None or (guards.key(index) == self._key and index > self.part.first):
            return
        key = guards.key(index)
        events = list(self.by_index.get(index, ()))
        earlier = [event for event in events if guards.is_earlier(event, index)]
        later = [event for event in events if not guards.is_earlier(event, index)]
        if index > self.part.first:
            self._write(earlier, index)
            self.out += guards.leave(self._key)
        else:
            self._only(int(guards.hole[index - 1]) if index else 0, earlier, index)
        self._operation_of(index)
        states = [] if key[0] is Stage.OPEN else [e for e in later if e.kind in STATES]
        self._only(int(guards.last[index]), states, index)
        rest = [event for event in later if event not in states]
        self._done = (index, len(events))
        self.modal, self._key = Modal(), key
        way = None
        if guards.has_entry(key):
            self._percent(self.table.percent[index] or self.anchor_percent)
            way = krl.Move(self._words[MoveKind.PTP], self._axes(int(guards.entry[key[1]])))
        self.out += guards.enter(key, index, way)
        if index == self.part.first and self.table.kind[index] != MoveKind.PTP:
            self._anchor(index - 1)
        self._write(rest, index)

    def _only(self, number: int, events: Sequence[Event], index: int) -> None:
        """Write events that are run only if a hole is due."""
        if self.guards is None or not events:
            return
        before, self.out = self.out, []
        self._write(events, index)
        self.out = before + self.guards.only(number, self.out)

    def _write(self, events: Sequence[Event], index: int) -> None:
        is_waited = index == 0
        for event in events:
            flying = event.kind not in _QUIET and is_flying(self.plan, index, event.kind)
            if not (is_waited or flying) and self.events.waits(event):
                self.out.append(krl.WaitSec(0, comment="the advance run stops"))
                is_waited = True
            made = self.events.statements(event, flying=flying)
            (self._pending if flying else self.out).extend(made)
            if event.kind is EventKind.TOOL_CHANGE and index < len(self.plan):
                self._frames(index)

    def _frames(self, index: int) -> None:
        """Select the tool and the base of a move."""
        self.out += self.events.templates.statements("frames", self.values(index))

    def _frames_change(self, index: int) -> bool:
        """Return whether tool or base change before a move, and no routine changes the tool."""
        if index == self.part.first or not self.table.is_reframed[index]:
            return False
        events = self.by_index.get(index, ())
        return all(event.kind is not EventKind.TOOL_CHANGE for event in events)

    def _open_operation(self, operation: int) -> None:
        self._operation = operation
        if operation >= 0:
            named = self.plan.toolpath.operations[operation]
            name = krl.comment_text(named.name)
            line = f" (CAM line {named.line})" if self.style.cam_lines else ""
            text = f"OPERATION {operation + 1}: {name}{line}"
            self.out.append(krl.FoldBegin(f"{text};%{{PE}}"))

    def _close_operation(self) -> None:
        if self._operation >= 0:
            self.out.append(krl.FoldEnd(f"(OPERATION {self._operation + 1})"))
        self._operation = -1

    def _anchor(self, index: int) -> None:
        """Go to where the file before has ended: no length, but status, turn and place are sure."""
        self._percent(self.anchor_percent)
        self.out.append(krl.Comment(" re-entry: where the file before ends"))
        self.out.append(krl.Move(self._words[MoveKind.PTP], self._axes(index)))

    # ------------------------------------------------------------------------- the motions

    def _motion(self, index: int) -> None:
        """Write one motion, after what it needs set."""
        if self.modal.is_disturbed:
            self._restore()
        if self.table.kind[index] == _PTP:
            self._percent(self.table.percent[index])
        else:
            self._speed(self.table.speed_m_s[index])
            self._orientation(self.table.orientation_deg_s[index])
        self._move(index, self._blend(index))

    def _move(
        self, index: int, blend: tuple[str, ...] = (), settings: tuple[krl.Assign, ...] = ()
    ) -> None:
        """Write the motion itself, behind the triggers that belong to it."""
        table = self.table
        kind, aux = table.kind[index], table.auxiliary[index]
        auxiliary = None if aux is None else self._target(index, _pose(aux, table.external[index]))
        target = self._axes(index) if kind == _PTP else self._pose(index)
        word, goal, comment = self._words[kind], self._target(index, target), self._cam_line(index)
        self.out += self._pending
        self._pending.clear()
        self.out.append(krl.Move(word, goal, auxiliary, None, blend, settings, comment=comment))

    def _home(self, index: int) -> None:
        """Write a motion to the controller's home, which ends exactly."""
        self.out += self._pending
        self._pending.clear()
        percent, comment = self.table.percent[index], self._cam_line(index)
        if self.style.home is HomeStyle.FORM:
            if comment:  # outside, as with every form
                self.out.append(krl.Comment(comment))
            self.out += self.forms.home(percent, is_spline=self.style.is_spline)
            if not self.style.is_spline:
                self.modal.disturb()
                if index + 1 < self.part.stop:
                    self._frames(index + 1)
                    self._restore()
            return
        if self.modal.is_disturbed:
            self._restore()
        self._percent(percent)
        self.out.append(krl.Move(self._words[MoveKind.PTP], krl.Expr("XHOME"), comment=comment))

    def _form(self, index: int) -> None:
        """Write a motion as an inline form; a CIRC stays as it is."""
        table, pose = self.table, self._pose(index)
        if table.kind[index] == MoveKind.CIRC:
            self._motion(index)
            return
        if comment := self._cam_line(index):  # outside: the pad rewrites what is inside
            self.out.append(krl.Comment(comment))
        if table.kind[index] == MoveKind.PTP:
            self.out += self.forms.ptp(index, pose, table.percent[index])
        else:
            self.out += self.forms.lin(index, pose, table.speed_m_s[index], table.blend_mm[index])
        self.modal.disturb()

    def _cam_line(self, index: int) -> str:
        """Return the comment that names the CAM line of a move, and the tag where it has an id."""
        line, names = self.table.line[index], self.plan.toolpath.names
        if not line or not self.style.cam_lines:
            return ""
        name = "" if names is None else krl.comment_text(names[self.plan.tag[index]])
        return f" CAM line {line}: {name}" if name else f" CAM line {line}"

    def _target(self, index: int, target: krl.Pose | krl.Axes) -> krl.Value:
        return self.points.add(index, target) if self._in_data else target

    # ------------------------------------------------------------------------ spline blocks

    def _block_end(self, first: int, stop: int) -> int:
        """Return the move behind the spline block that begins with move ``first``."""
        table = self.table
        if table.kind[first] == MoveKind.PTP:
            return first + 1
        last = first
        while (
            last + 1 < min(stop, first + SPLINE_SEGMENTS)
            and table.blend_mm[last] > 0.0
            and table.kind[last + 1] != MoveKind.PTP
            and table.operation[last + 1] == table.operation[first]
            and not self._frames_change(last + 1)
            and (self.guards is None or self.guards.key(last + 1) == self.guards.key(first))
        ):
            last += 1
        return last + 1

    def _block(self, first: int, end: int) -> None:
        """Write moves as one spline block: it passes through every point and stops behind it."""
        self._before(first)
        speed = self.table.speed_m_s[first]
        self._speed(speed)
        self._orientation(min(self.table.orientation_deg_s[first:end]))
        blend = self._blend(end - 1)
        self.out.append(krl.SplineBegin())
        for index in range(first, end):
            if index > first:
                self._before(index)
            own = self.table.speed_m_s[index]
            settings = () if own == speed else (krl.Assign("$VEL.CP", own),)
            self._move(index, settings=settings)
        self.out.append(krl.SplineEnd(blend=blend))

    def _axes(self, index: int) -> krl.Axes:
        a1, a2, a3, a4, a5, a6 = self.table.axes[index]
        return krl.Axes(a1, a2, a3, a4, a5, a6, self.table.external[index])

    def _pose(self, index: int) -> krl.Pose:
        return _pose(self.table.pose[index], self.table.external[index])

    # ------------------------------------------------------------------------ what is modal

    def _restore(self) -> None:
        """Set again what BAS(#CP_PARAMS) and BAS(#PTP_PARAMS) of a form have changed."""
        self.modal.is_disturbed = False
        self.out += self.events.templates.statements("motion_speeds", self.values(self.part.first))

    def _percent(self, percent: float) -> None:
        if percent != self.modal.percent:
            self.modal.percent = percent
            value = int(percent) if percent == int(percent) else percent
            self.out.append(krl.Call("BAS", (krl.Enum("VEL_PTP"), value)))

    def _speed(self, speed_m_s: float) -> None:
        if speed_m_s != self.modal.speed_m_s:
            self.modal.speed_m_s = speed_m_s
            self.out.append(krl.Assign("$VEL.CP", speed_m_s))

    def _orientation(self, deg_s: float) -> None:
        """Set the speed of the orientation where it is not that of the cell."""
        if deg_s != (self.modal.orientation_deg_s or self._orientation_deg_s):
            self.modal.orientation_deg_s = deg_s
            self.out += [krl.Assign("$VEL.ORI1", deg_s), krl.Assign("$VEL.ORI2", deg_s)]

    def _blend(self, index: int) -> tuple[str, ...]:
        """Return the words that approximate a move by distance; C_PTP counts in percent."""
        blend = self.table.blend_mm[index]
        if blend <= 0.0:
            return ()
        if self.modal.blend_mm != blend:
            self.modal.blend_mm = blend
            self.out.append(krl.Assign("$APO.CDIS", blend))
        return self._blended


def _pose(values: Sequence[float], external: tuple[float, ...]) -> krl.Pose:
    x, y, z, a, b, c = values
    return krl.Pose(x, y, z, a, b, c, None, None, external)
