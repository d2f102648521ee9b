"""A plan: the controller motions that run a toolpath, each with the joint angles it ends in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from postproc.arrays import (
    BoolArray,
    FloatArray,
    IndexArray,
    IntArray,
    Rows,
    column,
    columns_at,
    columns_joined,
    freeze_columns,
    runs,
)
from postproc.errors import Finding, Severity
from postproc.model.toolpath import Event, EventKind, ToolPath
from postproc.records import dataclass

LEAST_BLEND = 1e-6
"""A shorter approximation distance [m] is an exact stop: a text has no digits for it."""
BLEND_SHARE = 0.45
"""Largest share of a neighbouring move that blending may take: the controller cuts it at half."""


class MoveKind(IntEnum):
    """Controller motion."""

    PTP = 0
    LIN = 1
    CIRC = 2


class MoveRole(IntEnum):
    """What a move is for; decides speed and exact stop."""

    ENTRY = 0
    """First move of a stretch: PTP by axis values."""
    RAPID = 1
    CUT = 2
    APPROACH = 3
    """To the height where a drill's feed starts."""
    PLUNGE = 4
    """Drilling down; ends exactly."""
    LIFT = 5
    """Between pecks."""
    RETRACT = 6


@dataclass(frozen=True, slots=True)
class AlongPath:
    """How far the real tool is expected off the path of the cuts, of what a trace has shown.

    Args:
        effects: names that were taken off.
        plain_rms, plain_max: [m] by them without compensation; rms, max: with it.
        rest_rms: [m] off the path what no effect explains.
        low, high: [m] interval of the root mean square of all with compensation, NaN where nobody
            knows.
        slowed, least_share: how many cuts have less than their feed, and the least share of it.
    """

    effects: tuple[str, ...]
    plain_rms: float
    plain_max: float
    rms: float
    max: float
    rest_rms: float
    low: float
    high: float
    slowed: int
    least_share: float


@dataclass(frozen=True, slots=True)
class Plan:
    """Moves in columns of length m; the tags they serve are those of ``toolpath``.

    Args:
        name: program name as asked for.
        toolpath: what was read.
        kind: (m,) ``MoveKind``; role: (m,) ``MoveRole``; tag: (m,) index of the tag served.
        T_base_tcp: (m, 4, 4) commanded TCP pose at the move's end, in $BASE of the move [m].
        aux: (m, 3) point on the way of a CIRC [m], workpiece frame, NaN else.
        q: (m, 6) joint angles at the move's end [rad], turns included.
        spin: (m,) angle about the tool axis against the reference [rad]; branch: (m,) 0..7.
        speed: (m,) path speed [m/s] of LIN and CIRC; NaN for PTP.
        ptp_fraction: (m,) share of axis speed 0..1 of PTP; NaN else.
        orientation_speed: (m,) largest speed of the orientation [rad/s], NaN for the cell's; None:
            the cell's for all.
        blend: (m,) approximation distance [m] at the move's end, 0 = exact stop.
        dwell: (m,) wait after the move [s].
        duration: (m,) estimated time of the move [s].
        external: (m, k) external axes [m or rad], k = 0 without any.
        tool, base: (m,) indices into the tools and bases of the cell; None: the first for all. A
            pose is that of the tool of its row in the base of its row.
        stiffness: (n,) index along the objective's direction per tag [N/m], NaN without stiffness.
        stiffness_initial: (n,) the same at spin 0 before optimisation.
        stiffness_best: (n,) the best that a tag has within reach [N/m], NaN where unknown; None:
            nowhere.
        clearance: (n,) smallest distance per tag [m], NaN where not asked for.
        restart: (n,) 1 where the way from home straight above a hole is free, 0 where it is not,
            NaN where nobody asks; None: nowhere.
        off_chord: (n,) distance [m] of a tag that has no move from the line that passes it, NaN for
            tags that have one; off_axis: (n,) [rad] by which the tool is turned there; None: none.
        events: (move index before which it happens, event).
        compensation: (m, 3) shift applied to the commanded position [m], workpiece frame, or None.
        compensation_u95: (m,) radius [m] that holds the real point with 95 %;
            compensation_inside: (m,) 1 where the model's campaign reached; None: nobody knows.
        shift_along: (m, 3) share of it for effects along the path [m], robroot, or None.
        along_path: what effects along the path do to the cuts; None: nobody knows.
        findings: findings; any error among them forbids a program.
        settings: options as used, for the record; timing: seconds per stage.
    """

    name: str
    toolpath: ToolPath
    kind: IntArray = field(metadata=column("move", dtype=np.int32))
    role: IntArray = field(metadata=column("move", dtype=np.int32))
    tag: IntArray = field(metadata=column("move", dtype=np.int32))
    T_base_tcp: FloatArray = field(metadata=column("move", 4, 4))
    aux: FloatArray = field(metadata=column("move", 3))
    q: FloatArray = field(metadata=column("move", 6))
    spin: FloatArray = field(metadata=column("move"))
    branch: IntArray = field(metadata=column("move", dtype=np.int32))
    speed: FloatArray = field(metadata=column("move"))
    ptp_fraction: FloatArray = field(metadata=column("move"))
    blend: FloatArray = field(metadata=column("move"))
    dwell: FloatArray = field(metadata=column("move"))
    duration: FloatArray = field(metadata=column("move"))
    external: FloatArray = field(metadata=column("move", None))
    stiffness: FloatArray = field(metadata=column("tag"))
    stiffness_initial: FloatArray = field(metadata=column("tag"))
    clearance: FloatArray = field(metadata=column("tag"))
    events: tuple[tuple[int, Event], ...] = ()
    stiffness_best: FloatArray | None = field(default=None, metadata=column("tag"))
    restart: FloatArray | None = field(default=None, metadata=column("tag"))
    off_chord: FloatArray | None = field(default=None, metadata=column("tag"))
    off_axis: FloatArray | None = field(default=None, metadata=column("tag"))
    tool: IntArray | None = field(default=None, metadata=column("move", dtype=np.int32))
    base: IntArray | None = field(default=None, metadata=column("move", dtype=np.int32))
    orientation_speed: FloatArray | None = field(default=None, metadata=column("move"))
    compensation: FloatArray | None = field(default=None, metadata=column("move", 3))
    shift_along: FloatArray | None = field(default=None, metadata=column("move", 3))
    compensation_u95: FloatArray | None = field(default=None, metadata=column("move"))
    compensation_inside: IntArray | None = field(
        default=None, metadata=column("move", dtype=np.int32)
    )
    compensation_note: str = ""
    along_path: AlongPath | None = None
    findings: tuple[Finding, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        for name in ("stiffness_best", "restart", "off_chord", "off_axis"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.full(len(self.toolpath), np.nan))
        freeze_columns(self, move=len(self.kind), tag=len(self.toolpath))

    @classmethod
    def nothing(cls, toolpath: ToolPath, name: str, findings: tuple[Finding, ...]) -> Plan:
        """Return a plan without a move: what was read cannot be run as it stands."""
        tags = np.full(len(toolpath), np.nan)
        none, kinds = np.zeros(0), np.zeros(0, dtype=np.int32)
        return cls(
            name=name,
            toolpath=toolpath,
            kind=kinds,
            role=kinds,
            tag=kinds,
            T_base_tcp=np.zeros((0, 4, 4)),
            aux=np.zeros((0, 3)),
            q=np.zeros((0, 6)),
            spin=none,
            branch=kinds,
            speed=none,
            ptp_fraction=none,
            blend=none,
            dwell=none,
            duration=none,
            external=np.zeros((0, 0)),
            stiffness=tags,
            stiffness_initial=tags,
            clearance=tags,
            findings=findings,
        )

    def __len__(self) -> int:
        """Return the number of moves."""
        return len(self.kind)

    @property
    def stiffness_lost(self) -> FloatArray:
        """(n,) share of the best stiffness within reach that a tag does without, NaN if unknown."""
        lost: FloatArray = 1.0 - self.stiffness / np.asarray(self.stiffness_best)
        return lost

    @property
    def left_out(self) -> BoolArray:
        """(n,) tags that a move passes within the tolerances of the cell, none ending there."""
        left: BoolArray = np.isfinite(np.asarray(self.off_chord))
        return left

    @property
    def tool_of_moves(self) -> IntArray:
        """(m,) index of each move's tool in the cell."""
        return np.zeros(len(self), dtype=np.int32) if self.tool is None else self.tool

    @property
    def base_of_moves(self) -> IntArray:
        """(m,) index of each move's base in the cell."""
        return np.zeros(len(self), dtype=np.int32) if self.base is None else self.base

    def stretches(self) -> list[tuple[int, int, int, int]]:
        """Return the stretches of moves [low, high) with one tool in one base, and these two."""
        tool, base = self.tool_of_moves, self.base_of_moves
        return [
            (low, high, int(tool[low]), int(base[low]))
            for low, high in runs(np.stack([tool, base]))
        ]

    def rows(self, index: Rows) -> Plan:
        """Return the moves ``index`` (k,), growing; one may stand several times.

        An event stays before the first move that is left of those behind it. Columns of tags stay.
        """
        index = np.arange(len(self))[index]
        events = tuple((int(np.searchsorted(index, move)), event) for move, event in self.events)
        return replace(self, events=events, **columns_at(self, "move", index))

    @classmethod
    def concat(cls, parts: Sequence[Plan]) -> Plan:
        """Return the moves of plans of the same toolpath behind each other.

        A tag has the numbers of the last part that knows them; equal findings count once. Name,
        notes and settings are those of the first. All of them are compensated, or none.
        """
        if any(part.tool is not None for part in parts):
            frames = [(part.tool_of_moves, part.base_of_moves) for part in parts]
            parts = [replace(p, tool=f[0], base=f[1]) for p, f in zip(parts, frames, strict=True)]
        changes = columns_joined(parts, "move")
        for name in columns_at(parts[0], "tag", np.arange(0)):
            changes[name] = getattr(parts[0], name)
            for part in parts[1:]:
                own = getattr(part, name)
                changes[name] = np.where(np.isfinite(own), own, changes[name])
        first = np.cumsum([0, *(len(part) for part in parts)]).tolist()
        changes["events"] = tuple(
            (move + low, event)
            for low, part in zip(first, parts, strict=False)
            for move, event in part.events
        )
        findings = [finding for part in parts for finding in part.findings]
        return replace(parts[0], findings=tuple(dict.fromkeys(findings)), **changes)

    def within(self, toolpath: ToolPath, low: int) -> Plan:
        """Return a plan of a stretch of tags, from ``low`` on, as one of the whole toolpath.

        An event that the whole has too is the very one of the whole.
        """
        changes: dict[str, Any] = {}
        for name, values in columns_at(self, "tag", np.arange(len(self.toolpath))).items():
            changes[name] = np.full((len(toolpath), *values.shape[1:]), np.nan)
            changes[name][low : low + len(values)] = values
        findings = tuple(
            replace(i, tag_index=None if i.tag_index is None else i.tag_index + low)
            for i in self.findings
        )
        known = {event: event for event in toolpath.events}
        shifted = [(move, replace(e, index=e.index + low)) for move, e in self.events]
        events = tuple((move, known.get(event, event)) for move, event in shifted)
        return replace(
            self, toolpath=toolpath, tag=self.tag + low, findings=findings, events=events, **changes
        )

    @property
    def cycle_time(self) -> float:
        """Estimated time of all moves and waits [s]; routines of the cell take none."""
        return float(np.nansum(self.duration) + self.waits.sum())

    @property
    def waits(self) -> FloatArray:
        """(m,) how long [s] the robot waits behind each move: dwells of holes and of the file."""
        waits = np.nan_to_num(self.dwell)
        for move, event in self.events:
            if event.kind is EventKind.DWELL and len(waits):
                waits[max(move - 1, 0)] += event.value
        return waits

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that forbid a program."""
        return tuple(finding for finding in self.findings if finding.severity is Severity.ERROR)

    @property
    def failing_tags(self) -> IndexArray:
        """(k,) tags at which errors stand, rising; -1 among them for errors of the whole job."""
        tags = [-1 if error.tag_index is None else error.tag_index for error in self.errors]
        return np.unique(np.array(tags, dtype=np.int64))
