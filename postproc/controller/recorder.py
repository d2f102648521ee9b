"""Collects executed motions row by row and gives them back in columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import FloatArray
from postproc.controller.state import MotionState
from postproc.controller.trace import (
    Blend,
    EventWord,
    MotionType,
    Trace,
    TraceEvent,
)
from postproc.errors import Finding, RunKind, Severity, SourceRef
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


@dataclass(slots=True)
class Recorder:
    """Rows of the trace while the program runs; targets in mm and degrees as written."""

    motion_types: list[int] = field(default_factory=list)
    blends: list[int] = field(default_factory=list)
    settings: list[int] = field(default_factory=list)
    axes: list[bool] = field(default_factory=list)
    targets: list[Numbers] = field(default_factory=list)
    status: list[int] = field(default_factory=list)
    turn: list[int] = field(default_factory=list)
    external: dict[int, tuple[float, ...]] = field(default_factory=dict)
    files: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    blocks: list[int] = field(default_factory=list)
    relative: list[bool] = field(default_factory=list)
    auxiliary: dict[int, Numbers] = field(default_factory=dict)
    angles: dict[int, float] = field(default_factory=dict)
    events: list[TraceEvent] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    unsure: set[int] = field(default_factory=set)
    in_trigger: bool = False
    _hooks: int = 0

    def __len__(self) -> int:
        """Return the number of motions so far."""
        return len(self.motion_types)

    def file_row(self, path: str) -> int:
        """Return the row of a file, new or known."""
        if path not in self.names:
            self.names.append(path)
        return self.names.index(path)

    def motion(
        self,
        motion_type: MotionType,
        target: Numbers,
        is_axes: bool,
        setting: int,
        place: tuple[int, int],
        block: int,
    ) -> int:
        """Add a motion with an exact stop and return its index."""
        self.motion_types.append(motion_type)
        self.blends.append(Blend.EXACT)
        self.settings.append(setting)
        self.axes.append(is_axes)
        self.targets.append(target)
        self.status.append(-1)
        self.turn.append(-1)
        self.files.append(place[0])
        self.lines.append(place[1])
        self.blocks.append(block)
        self.relative.append(False)
        return len(self.motion_types) - 1

    def event(
        self,
        word: EventWord,
        name: str,
        place: tuple[int, int],
        value: float = math.nan,
        arguments: tuple[object, ...] = (),
    ) -> None:
        """Add something that happens before the next motion.

        A hook stands for its waits and stops; what it switches and calls are events as elsewhere.
        """
        if self._hooks and word in _WAITS:
            return
        self.events.append(
            TraceEvent(
                len(self.motion_types), word, name, value, arguments, *place[::-1], self.in_trigger
            )
        )

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
            self.unsure.add(len(self.motion_types))
        source = SourceRef(self.names[place[0]], place[1])
        found = Finding(severity, kind, message, source=source, hint=hint)
        if found not in self.findings[-50:]:
            self.findings.append(found)

    def trace(self, state: MotionState) -> Trace:
        """Return everything recorded, in SI units."""
        m = len(self.motion_types)
        is_axes = np.array(self.axes, dtype=np.bool_)
        target = np.array(self.targets, dtype=np.float64).reshape(m, 6)
        target[:, :3] *= np.where(is_axes, DEG, MM)[:, None]
        target[:, 3:] *= DEG
        external = np.full((m, 6), np.nan)
        for row, values in self.external.items():
            external[row, : len(values)] = values
        return Trace(
            motion_type=np.array(self.motion_types, dtype=np.int32),
            blend=np.array(self.blends, dtype=np.int32),
            setting=np.array(self.settings, dtype=np.int32),
            is_axes=is_axes,
            target=target,
            status=np.array(self.status, dtype=np.int32),
            turn=np.array(self.turn, dtype=np.int32),
            external=external,
            file=np.array(self.files, dtype=np.int32),
            line=np.array(self.lines, dtype=np.int32),
            block=np.array(self.blocks, dtype=np.int32),
            is_relative=np.array(self.relative, dtype=np.bool_),
            auxiliary={row: _si(values) for row, values in self.auxiliary.items()},
            angle={row: angle * DEG for row, angle in self.angles.items()},
            tools=state.tool_frames.stack(),
            bases=state.base_frames.stack(),
            settings=state.table,
            files=tuple(self.names),
            events=tuple(self.events),
            findings=tuple(self.findings),
            unsure=frozenset(self.unsure),
        )


def _si(values: Numbers) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array[:3] *= MM
    array[3:] *= DEG
    return array
