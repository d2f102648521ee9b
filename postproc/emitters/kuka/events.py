"""Events between motions as calls of the integrator's routines; none is dropped."""

from __future__ import annotations

import math
from dataclasses import replace

from postproc.cell import KrlOptions
from postproc.emitters.kuka.template import TemplateSet
from postproc.errors import EmitError, KrlError, SourceRef
from postproc.krl import Comment, FoldBegin, FoldEnd, Statement, Trigger, numbers
from postproc.model import Event, EventKind
from postproc.process import coolant_mode
from postproc.records import dataclass
from postproc.units import DEG, MM, MM_PER_MIN, RPM


@dataclass(frozen=True, slots=True)
class EventWriter:
    """Statements of events: direct, or on the way by a trigger. ``path``: the CAM file's."""

    templates: TemplateSet
    style: KrlOptions
    path: str

    def statements(self, event: Event, *, flying: bool) -> list[Statement]:
        """Return what an event becomes; ``flying``: in a blended cut, which must not stop."""
        if event.kind is EventKind.DWELL:
            self._check_dwell(event.value, event.line)
        elif not math.isfinite(event.value):
            source = SourceRef(self.path, event.line)
            raise EmitError("EMT315", f"{event.kind} with the number {event.value}", source)
        made = self.templates.statements(
            str(event.kind),
            {
                "hooks": self.style.hooks,
                "routine": self.style.hooks.get(event.text, event.text),
                "mapped": self._mapped(event),
                **_values(event),
            },
            {"event": self._words(event)},
        )
        return [self._trigger(statement) for statement in made] if flying else made

    def waits(self, event: Event) -> bool:
        """Return whether the advance run has to be stopped before the routine of an event.

        Only where the cell says which routines do that themselves; outputs, waits and stops do.
        """
        own = self.style.stops_advance
        key = event.text if event.kind is EventKind.HOLE else str(event.kind)
        return own is not None and key in self.style.hooks and key not in own

    def dwell(self, seconds: float, line: int) -> list[Statement]:
        """Return a wait after a motion."""
        self._check_dwell(seconds, line)
        text = f"CAM line {line}" if line and self.style.cam_lines else ""
        return self.templates.statements(
            "dwell", {"hooks": self.style.hooks, "seconds": seconds}, {"event": text}
        )

    def _words(self, event: Event) -> str:
        text = event.text.strip()
        if event.kind is EventKind.UNKNOWN:
            text = f"not converted: {text}"
        elif event.kind is EventKind.MESSAGE:
            text = f"message: {text}"
        elif event.kind is EventKind.HOLE:
            text = f"hole {event.value:g}"
        if not self.style.cam_lines:
            return text
        # the line comes first: a long text is cut at its end
        return f"CAM line {event.line}: {text}" if text else f"CAM line {event.line}"

    def _mapped(self, event: Event) -> int:
        """Return the number of the input or output that the cell gives a signal, 0 without one."""
        if event.kind is EventKind.SIGNAL:
            return self.style.outputs.get(event.text, 0)
        return self.style.inputs.get(event.text, 0) if event.kind is EventKind.WAIT_SIGNAL else 0

    def _check_dwell(self, seconds: float, line: int) -> None:
        try:
            numbers.nonzero(seconds, numbers.SECOND_DIGITS, "a dwell [s] of")
        except KrlError as problem:
            source = SourceRef(self.path, max(line, 1))
            raise EmitError("EMT315", problem.message, source) from None

    def _trigger(self, statement: Statement) -> Statement:
        """Return what is run where the next motion begins, without an advance-run stop."""
        if isinstance(statement, Comment | FoldBegin | FoldEnd):
            return statement
        return Trigger(
            "PATH" if self.style.is_spline else "DISTANCE",
            0,
            0,
            replace(statement, comment=""),
            priority=-1,
            on_start=self.style.is_spline,
            comment=statement.comment,
        )


def _values(event: Event) -> dict[str, object]:
    """Return the numbers of an event as the templates know them."""
    if event.kind in (EventKind.SPINDLE_ON, EventKind.TAP_REVERSE):
        rpm = round(event.value / RPM, 3)
        return {"rpm": int(rpm) if rpm == int(rpm) else rpm}
    if event.kind in (EventKind.COOLANT_ON, EventKind.COOLANT_OFF):
        return {"mode": coolant_mode(event.text)}
    if event.kind is EventKind.TOOL_CHANGE:
        return {"number": int(event.value)}
    if event.kind in (EventKind.SIGNAL, EventKind.WAIT_SIGNAL):
        name = "".join(
            c if c.isascii() and c.isprintable() and c != '"' else "_" for c in event.text
        )
        port = int(event.arguments[0]) if event.arguments else 0
        return {"name": name, "port": port, "value": "TRUE" if event.value else "FALSE"}
    if event.kind is EventKind.HOLE:
        depth, feed, speed = event.arguments or (0.0, 0.0, 0.0)
        return {
            "number": int(event.value),
            "depth": round(depth / MM, 4),
            "feed": round(feed / MM_PER_MIN, 4),
            "speed": round(speed / RPM, 3),
        }
    plain = {EventKind.DWELL: ("seconds", 1.0), EventKind.SPINDLE_ORIENT: ("angle", DEG)}
    name, unit = plain.get(event.kind, ("", 1.0))
    return {name: round(event.value / unit, 6)} if name else {}
