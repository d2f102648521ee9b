"""Collects executed motions row by row and gives them back in columns; the advance run.

The controller reads up to $ADVANCE motions ahead. What a statement does then happens so many
motions early, unless something before it makes the interpreter wait for the arm: a wait, a stop, an
output, an input, the position. ``CONTINUE`` in the line before takes that away again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import field
from itertools import chain
from typing import NamedTuple

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.controller.state import MotionState
from postproc.controller.trace import Blend, EventWord, Trace, TraceEvent
from postproc.errors import Finding, RunKind, Severity, SourceRef
from postproc.krl import Axes, Pose, table_of
from postproc.records import dataclass
from postproc.units import DEG, MM

Numbers = tuple[float, float, float, float, float, float]
_NOT_FOLLOWED = frozenset(
    {
        RunKind.UNJUDGED,
        RunKind.CONDITION,
        RunKind.ENDLESS,
        RunKind.TARGET,
        RunKind.TYPE,
        RunKind.STRUCTURE,
    }
)
"""Where one of these is found, the next motion may come from elsewhere."""
_WAITS = (EventWord.DWELL, EventWord.WAIT_FOR, EventWord.HALT)


class Motion(NamedTuple):
    """The whole numbers of a motion; status and turn -1 where they are not written."""

    motion_type: int
    blend: int
    setting: int
    is_axes: bool
    status: int
    turn: int
    file: int
    line: int
    block: int
    is_relative: bool


@dataclass(slots=True)
class Recorder:
    """Rows of the trace while the program runs; targets in mm and degrees as written."""

    motions: list[Motion] = field(default_factory=list)
    targets: list[Pose | Axes] = field(default_factory=list)
    external: dict[int, tuple[float, ...]] = field(default_factory=dict)
    auxiliary: dict[int, Numbers] = field(default_factory=dict)
    angles: dict[int, float] = field(default_factory=dict)
    events: list[TraceEvent] = field(default_factory=list)
    asides: list[TraceEvent] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    unsure: set[int] = field(default_factory=set)
    in_trigger: bool = False
    _hooks: int = 0

    def __len__(self) -> int:
        """Return the number of motions so far."""
        return len(self.motions)

    def file_row(self, path: str) -> int:
        """Return the row of a file, new or known."""
        if path not in self.names:
            self.names.append(path)
        return self.names.index(path)

    def motion(self, motion: Motion, target: Pose | Axes) -> int:
        """Add a motion to a complete target and return its index."""
        row = len(self.motions)
        self.motions.append(motion)
        self.targets.append(target)
        if target.external:
            self.external[row] = target.external
        return row

    def end_block(self, block: int, blend: Blend) -> None:
        """Give the last motion the approximation of its spline block, if it is in that block."""
        if self.motions and self.motions[-1].block == block:
            self.motions[-1] = self.motions[-1]._replace(blend=blend)

    def event(
        self,
        word: EventWord,
        name: str,
        place: tuple[int, int],
        value: float = math.nan,
        arguments: tuple[object, ...] = (),
        early: int = 0,
    ) -> None:
        """Add something that happens before the next motion, or so many motions early.

        A hook stands for its waits and stops; what it switches and calls are events as elsewhere.
        """
        if self._hooks and word in _WAITS:
            return
        event = TraceEvent(
            len(self.motions),
            word,
            name,
            value,
            arguments,
            *place[::-1],
            self.in_trigger,
            early,
            is_within=self._hooks > 0,
        )
        (self.asides if word is EventWord.ASIDE else self.events).append(event)

    @contextmanager
    def within_hook(self) -> Iterator[None]:
        """Take what follows as the lines of a hook."""
        self._hooks += 1
        yield
        self._hooks -= 1

    def finding(
        self,
        kind: RunKind,
        message: str,
        place: tuple[int, int],
        severity: Severity = Severity.ERROR,
        hint: str = "",
    ) -> None:
        """Add a finding; the same one is added once.

        A hook may wait for what is not known here: that is no warning.
        """
        if self._hooks and severity is not Severity.ERROR:
            return
        if severity is Severity.ERROR and kind in _NOT_FOLLOWED:
            self.unsure.add(len(self.motions))
        source = SourceRef(self.names[place[0]], place[1])
        found = Finding(severity, kind, message, source=source, hint=hint)
        if found not in self.findings[-50:]:
            self.findings.append(found)

    def trace(self, state: MotionState) -> Trace:
        """Return everything recorded, in SI units."""
        m, width = len(self.motions), len(Motion._fields)
        flat = np.fromiter(chain.from_iterable(self.motions), dtype=np.int32, count=m * width)
        table = np.ascontiguousarray(flat.reshape(m, width).T)
        column: dict[str, IntArray] = dict(zip(Motion._fields, table, strict=True))
        is_axes = column["is_axes"].astype(np.bool_)
        target = table_of(self.targets)
        target[:, :3] *= np.where(is_axes, DEG, MM)[:, None]
        target[:, 3:] *= DEG
        external = np.full((m, 6), np.nan)
        for row, values in self.external.items():
            external[row, : len(values)] = values
        return Trace(
            motion_type=column["motion_type"],
            blend=column["blend"],
            setting=column["setting"],
            is_axes=is_axes,
            target=target,
            status=column["status"],
            turn=column["turn"],
            external=external,
            file=column["file"],
            line=column["line"],
            block=column["block"],
            is_relative=column["is_relative"].astype(np.bool_),
            auxiliary={row: _si(values) for row, values in self.auxiliary.items()},
            angle={row: angle * DEG for row, angle in self.angles.items()},
            tools=state.tool_frames.stack(),
            bases=state.base_frames.stack(),
            settings=tuple(state.table),
            files=tuple(self.names),
            events=tuple(self.events),
            asides=tuple(self.asides),
            findings=tuple(self.findings),
            unsure=frozenset(self.unsure),
        )


def _si(values: Numbers) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array[:3] *= MM
    array[3:] *= DEG
    return array


STOPPING = ("$IN[", "$OUT[", "$ANIN[", "$ANOUT[", "$POS_ACT", "$AXIS_ACT")
"""System variables that stop the advance run where they are read or written."""


class AdvanceRun:
    """Where the interpreter has last waited for the arm."""

    def __init__(self, state: MotionState, recorder: Recorder) -> None:
        self._state, self._recorder = state, recorder
        self._met = 0
        self._earliest = 0
        self.is_continued = False
        """Whether ``CONTINUE`` stands in the line before."""

    @property
    def early(self) -> int:
        """Return by how many motions what is run now may happen early."""
        if self._recorder.in_trigger:
            return 0
        since = len(self._recorder) - self._met
        return min(self._state.values.advance, since)

    def stop(self) -> int:
        """Wait for the arm, unless CONTINUE forbids it; return by how many motions early."""
        if not (self.is_continued or self._recorder.in_trigger):
            self._met = len(self._recorder)
        return self.act()

    def act(self) -> int:
        """Note that something is done here; return by how many motions early."""
        early = self.early
        self._earliest = max(self._earliest, early)
        return early

    @contextmanager
    def body(self) -> Iterator[None]:
        """Note from here on by how many motions early the lines of a routine act."""
        outside, self._earliest = self._earliest, 0
        yield
        self._earliest = max(self._earliest, outside)

    @property
    def earliest(self) -> int:
        """Return by how many motions early the lines of the present body have acted at most."""
        return self._earliest
