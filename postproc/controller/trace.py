"""What a program does when it is run: executed motions in columns, and what happens between them.

Columns hold the controller's own numbers turned to SI; nothing here knows kinematics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.errors import Finding
from postproc.krl import Aggregate, Axes, Pose, initial_values
from postproc.records import dataclass
from postproc.units import DEG, MM, PERCENT


class MotionType(IntEnum):
    """How the robot gets to the target of a motion."""

    PTP = 0
    LIN = 1
    CIRC = 2
    SPL = 3


class Blend(IntEnum):
    """What happens at the target of a motion."""

    EXACT = 0
    """The robot stops there."""
    THROUGH = 1
    """A point within a spline block: passed exactly, without a stop."""
    DISTANCE = 2
    """``C_DIS`` or ``C_SPL``: cut off within ``Settings.cdis``."""
    AXES = 3
    """``C_PTP``: cut off within a share of the axis travel."""
    OTHER = 4
    """``C_ORI`` or ``C_VEL``: cut off by up to half of the segment."""


class EventWord(StrEnum):
    """What happens between motions."""

    DWELL = "dwell"
    HOOK = "hook"
    """A call of a hook, or of a routine that is not in these files."""
    OUTPUT = "output"
    WAIT_FOR = "wait_for"
    HALT = "halt"
    CONTROL = "control"
    """A line of program control, where a program is listed rather than run."""
    DATA = "data"
    """Tool, base or load data that are written."""
    OTHER = "other"
    """Anything else that is listed."""
    ASIDE = "aside"
    """What is none of these and moves no arm, but may change how it moves, or what others do."""


@dataclass(frozen=True, slots=True, eq=False)
class Settings:
    """What is in force at a motion; replaced, never changed, so that WITH can put it back.

    ``tool``, ``base``: rows of the frame tables; ``*_number``: as selected, -1 for a frame without
    one, or for a load of its own of ``load_mass`` [kg]. ``system``: every system variable that is
    followed or was set, that load too, by its canonical name in the controller's units. ``done``:
    what the program itself has set or called; the rest is as the controller is configured.
    """

    tool: int
    base: int
    tool_number: int = 0
    base_number: int = 0
    load_number: int = 0
    load_mass: float = math.nan
    system: Mapping[str, Any] = field(default_factory=initial_values)
    done: frozenset[str] = frozenset()

    @property
    def key(self) -> object:
        """What is the same for the same settings."""
        numbers = (self.tool, self.base, self.tool_number, self.base_number, self.load_number)
        return (*numbers, str(self.load_mass), frozenset(self.system.items()), self.done)

    @property
    def speed(self) -> float:
        """Along a path [m/s]."""
        return float(self.system["$VEL.CP"])

    @property
    def acceleration(self) -> float:
        """Along a path [m/s2]."""
        return float(self.system["$ACC.CP"])

    @property
    def orientation_speed(self) -> float:
        """Of the slower of both turns [rad/s]."""
        return float(min(self.system["$VEL.ORI1"], self.system["$VEL.ORI2"]) * DEG)

    @property
    def ptp(self) -> tuple[float, ...]:
        """Share of the speed of each axis."""
        return self._shares("$VEL_AXIS")

    @property
    def ramp(self) -> tuple[float, ...]:
        """Share of the acceleration of each axis."""
        return self._shares("$ACC_AXIS")

    def _shares(self, name: str) -> tuple[float, ...]:
        return tuple(self.system[f"{name}[{axis}]"] * PERCENT for axis in range(1, 7))

    @property
    def cdis(self) -> float:
        """Where approximation may begin [m] before the target."""
        return float(self.system["$APO.CDIS"] * MM)

    @property
    def cori(self) -> float:
        """Where approximation may begin [rad] before the orientation of the target."""
        return float(self.system["$APO.CORI"] * DEG)

    @property
    def advance(self) -> int:
        """So many motions are planned ahead."""
        return int(self.system["$ADVANCE"])


class TraceEvent(NamedTuple):
    """Something before motion ``motion`` (the number of motions: after the last).

    ``value``: seconds of a dwell, first argument of a hook, else NaN; ``on_the_way``: of a trigger,
    the robot does not stop for it. ``early``: by so many motions the advance run may let it happen
    before; ``is_surmise``: that is so unless the lines of the routine, which are not in these
    files, stop the advance run. ``is_within``: one of the lines of a hook, which stands for it.
    """

    motion: int
    word: EventWord
    name: str
    value: float
    arguments: tuple[object, ...]
    line: int
    file: int
    on_the_way: bool = False
    early: int = 0
    is_surmise: bool = False
    is_within: bool = False


@dataclass(frozen=True, slots=True)
class Trace:
    """Executed motions in columns of length m.

    Args:
        motion_type: (m,) ``MotionType``; blend: (m,) ``Blend``; setting: (m,) row of ``settings``.
        is_axes: (m,) the target is joint angles.
        target: (m, 6) joint angles [rad], or X, Y, Z [m] and A, B, C [rad] of the TCP in $BASE.
        status, turn: (m,) S and T of the target, -1 where not written.
        external: (m, 6) E1..E6 as written [mm or deg], NaN where not written.
        file: (m,) row of ``files``; line: (m,).
        block: (m,) number of the spline block, -1 outside.
        is_relative: (m,) written as a shift from where the robot stands.
        auxiliary: X..C of the point on the way [m, rad] of a circular motion, NaN where not given.
        angle: arc angle [rad] of a circular motion with CA.
        tools: (t, 4, 4) T_flange_tcp; bases: (b, 4, 4) T_robroot_base [m].
        events: between the motions, in order; asides: what else is run there, likewise.
        findings: what could not be run as written.
        unsure: motions right before which something happens that is not known.
    """

    motion_type: IntArray
    blend: IntArray
    setting: IntArray
    is_axes: BoolArray
    target: FloatArray
    status: IntArray
    turn: IntArray
    external: FloatArray
    file: IntArray
    line: IntArray
    block: IntArray
    is_relative: BoolArray
    auxiliary: Mapping[int, FloatArray]
    angle: Mapping[int, float]
    tools: FloatArray
    bases: FloatArray
    settings: tuple[Settings, ...]
    files: tuple[str, ...]
    events: tuple[TraceEvent, ...] = ()
    asides: tuple[TraceEvent, ...] = ()
    findings: tuple[Finding, ...] = field(default=())
    unsure: frozenset[int] = frozenset()

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.motion_type)

    def column(self, name: str) -> FloatArray:
        """Return a number of the settings per motion (m,)."""
        values = np.array([float(getattr(item, name)) for item in self.settings] or [0.0])
        return np.asarray(values[self.setting])

    @property
    def is_cp(self) -> BoolArray:
        """(m,) motions along a path of the TCP."""
        return np.asarray(self.motion_type != MotionType.PTP)

    @property
    def is_exact(self) -> BoolArray:
        """(m,) motions that pass their target exactly, with a stop or within a spline block."""
        return np.isin(self.blend, (Blend.EXACT, Blend.THROUGH))

    def place(self, motion: int) -> tuple[str, int]:
        """Return file and line of a motion."""
        return self.files[int(self.file[motion])], int(self.line[motion])

    def place_of(self, event: TraceEvent) -> tuple[str, int]:
        """Return file and line of an event."""
        return self.files[event.file], event.line


@dataclass(slots=True)
class World:
    """What the program finds on the controller.

    Args:
        tools: TOOL_DATA by number; bases: BASE_DATA by number [mm, deg], in $WORLD.
        T_world_robroot: (4, 4) $ROBROOT [m].
        points: named points that are not in the files, such as the home position, and the data of
            its form.
        joints: returns the joints (6,) [rad] at the end of a trace, for joint motions relative to
            a Cartesian target.
        hooks: routines of the integrator, in upper case: their calls are events, and trusted where
            the routine is in none of the files; one that is there is run as any other.
        stopping: those of them whose lines, as the cell says, stop the advance run first.
        accept: names, in upper case, of what cannot be judged and is taken on trust.
    """

    tools: Mapping[int, Pose] = field(default_factory=dict)
    bases: Mapping[int, Pose] = field(default_factory=dict)
    points: Mapping[str, Pose | Axes | Aggregate] = field(default_factory=dict)
    T_world_robroot: FloatArray = field(default_factory=lambda: np.eye(4))
    joints: Callable[[Trace], FloatArray | None] = lambda _trace: None
    hooks: frozenset[str] = frozenset()
    stopping: frozenset[str] = frozenset()
    accept: frozenset[str] = frozenset()
