"""What an OLP file says, as records: robot and profiles, tasks of motions and calls."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import rotation_from_abc, transform
from postproc.records import dataclass

N_JOINTS = 6
NAN = float("nan")


@dataclass(frozen=True, slots=True)
class MotionProfile:
    """Speed of a profile: share of the robot's maximum, or [m/s]; NaN where not given.

    ``is_timed``: it gives the time of a motion instead.
    """

    share: float = NAN
    speed: float = NAN
    is_timed: bool = False


@dataclass(slots=True)
class RobotData:
    """What a ``Resource`` says about the robot and its profiles."""

    name: str = ""
    max_speed: float = NAN
    coordinates: str = ""
    tools: dict[str, int] = field(default_factory=dict)
    """Lines of the tool profiles."""
    motions: dict[str, MotionProfile] = field(default_factory=dict)
    blends: dict[str, float] = field(default_factory=dict)
    """Fly-by distance [m] of the accuracy profiles; 0 = exact stop, NaN = by a share of speed."""
    objects: dict[str, tuple[str, FloatArray]] = field(default_factory=dict)
    """Reference frame and pose of the object frames."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One robot motion; positions [m], angles roll, pitch, yaw [rad], NaN where not given."""

    line: int
    name: str
    group: str
    kind: str
    via: bool
    motion_profile: str
    tool_profile: str
    accuracy_profile: str
    object_profile: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    base: tuple[float, ...]
    joints: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Call:
    """A call of another task."""

    line: int
    task: str


@dataclass(frozen=True, slots=True)
class Statement:
    """An activity between motions: a signal that is set or waited for, a delay, or any other.

    ``kind``: ``signal``, ``wait`` or ``delay``, the type of any other; ``name``: of a signal, of
    the activity; ``value``: 1 or 0 of a signal, seconds of a delay; ``port``: its number, 0 where
    the file gives none.
    """

    line: int
    kind: str
    name: str = ""
    port: int = 0
    value: float = 0.0


Item = Motion | Call | Statement


@dataclass(slots=True)
class Document:
    """All tasks of the one robot in the file, in file order."""

    robot: RobotData = field(default_factory=RobotData)
    tasks: dict[str, list[Item]] = field(default_factory=dict)
    task_lines: dict[str, int] = field(default_factory=dict)
    strange: dict[str, list[int]] = field(default_factory=dict)
    """Lines of elements, attributes and values that stand in no table, by their name."""


def pose(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> FloatArray:
    """Return T (4, 4) from a position [m] and roll, pitch, yaw [rad].

    R = Rz(Roll) Ry(Pitch) Rx(Yaw): DELMIA's yaw turns about x.
    """
    return transform(rotation_from_abc(np.array(rpy)), np.array(xyz))
