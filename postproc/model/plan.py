"""A plan: the controller motions that run a toolpath, each with the joint angles it ends in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from postproc.arrays import FloatArray, IntArray, frozen_floats, frozen_ints
from postproc.errors import Finding, Severity
from postproc.model.toolpath import Event, ToolPath


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
class Plan:
    """Moves in columns of length m; the tags they serve are those of ``toolpath``.

    Args:
        name: program name as asked for.
        toolpath: what was read.
        kind: (m,) ``MoveKind``; role: (m,) ``MoveRole``; tag: (m,) index of the tag served.
        T_base_tcp: (m, 4, 4) commanded TCP pose at the move's end, workpiece frame ($BASE) [m].
        aux: (m, 3) point on the way of a CIRC [m], workpiece frame, NaN else.
        q: (m, 6) joint angles at the move's end [rad], turns included.
        spin: (m,) angle about the tool axis against the reference [rad]; branch: (m,) 0..7.
        speed: (m,) path speed [m/s] of LIN and CIRC; NaN for PTP.
        ptp_fraction: (m,) share of axis speed 0..1 of PTP; NaN else.
        blend: (m,) approximation distance [m] at the move's end, 0 = exact stop.
        dwell: (m,) wait after the move [s].
        duration: (m,) estimated time of the move [s].
        external: (m, k) external axes [m or rad], k = 0 without any.
        stiffness: (n,) index along the objective's direction per tag [N/m], NaN without stiffness.
        stiffness_initial: (n,) the same at spin 0 before optimisation.
        clearance: (n,) smallest distance per tag [m], NaN where not asked for.
        events: (move index before which it happens, event).
        compensation: (m, 3) shift applied to the commanded position [m], workpiece frame, or None.
        findings: findings; any error among them forbids a program.
        settings: options as used, for the record; timing: seconds per stage.
    """

    name: str
    toolpath: ToolPath
    kind: IntArray
    role: IntArray
    tag: IntArray
    T_base_tcp: FloatArray
    aux: FloatArray
    q: FloatArray
    spin: FloatArray
    branch: IntArray
    speed: FloatArray
    ptp_fraction: FloatArray
    blend: FloatArray
    dwell: FloatArray
    duration: FloatArray
    external: FloatArray
    stiffness: FloatArray
    stiffness_initial: FloatArray
    clearance: FloatArray
    events: tuple[tuple[int, Event], ...] = ()
    compensation: FloatArray | None = None
    compensation_note: str = ""
    findings: tuple[Finding, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_ints(self, "kind", (None,))
        m, n = len(self.kind), len(self.toolpath)
        for name in ("role", "tag", "branch"):
            frozen_ints(self, name, (m,))
        frozen_floats(self, "T_base_tcp", (m, 4, 4))
        frozen_floats(self, "aux", (m, 3))
        frozen_floats(self, "q", (m, 6))
        frozen_floats(self, "external", (m, None))
        for name in ("spin", "speed", "ptp_fraction", "blend", "dwell", "duration"):
            frozen_floats(self, name, (m,))
        for name in ("stiffness", "stiffness_initial", "clearance"):
            frozen_floats(self, name, (n,))
        frozen_floats(self, "compensation", (m, 3))

    def __len__(self) -> int:
        """Return the number of moves."""
        return len(self.kind)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that forbid a program."""
        return tuple(finding for finding in self.findings if finding.severity is Severity.ERROR)
