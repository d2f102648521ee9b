"""Which built-in arm a controller drives: by its lengths first, then by its name."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.backup.machine import SAME_LENGTH_MM, Machine
from postproc.cell import LENGTHS, OpwGeometry, Robot, find_robot, load_robot, robot_names, type_of
from postproc.errors import CellError
from postproc.records import dataclass
from postproc.units import DEG, MM


@dataclass(frozen=True, slots=True)
class ArmMatch:
    """The built-in arm of a controller, None where there is none; remarks for people."""

    robot: Robot | None
    remarks: tuple[str, ...]


def match_arm(machine: Machine) -> ArmMatch:
    """Return the built-in arm whose seven lengths are those of the machine data.

    Where several have them the name decides; where the name is that of another arm, or of none of
    several, the arm is built from the machine data alone.
    """
    same = [name for name in robot_names() if _is_same(name, machine)]
    named = _named(machine.trafoname)
    shown = machine.trafoname or "without a name"
    if named in same:
        return ArmMatch(load_robot(named), (f"$TRAFONAME {shown}",))
    if named is None and len(same) == 1:
        text = f"$TRAFONAME {shown} is no built-in arm; the lengths are those of {same[0]}"
        return ArmMatch(load_robot(same[0]), (text,))
    if named is not None:
        text = f"$TRAFONAME {shown} names {named}, which has other lengths than the machine data"
    elif same:
        text = f"$TRAFONAME {shown}: several arms have these lengths ({', '.join(same)})"
    else:
        text = f"$TRAFONAME {shown}: no built-in arm has these lengths"
    return ArmMatch(None, (f"{text}; all numbers are those of the machine data",))


def short_name(machine: Machine) -> str:
    """Return the name of the arm as the controller writes it, without mounting and hand."""
    return type_of(machine.trafoname) or "robot"


def limits_of(machine: Machine, robot: Robot | None) -> tuple[list[list[float]], list[str]]:
    """Return the soft limits of A1..A6 [deg], never wider than the arm's, and remarks."""
    limits, remarks = [], []
    for axis, soft in enumerate(machine.limits_deg):
        own = _own_limits(robot, axis)
        known = [pair for pair in (soft, own) if pair is not None]
        if not known:
            return [], [f"A{axis + 1}: neither the controller nor a source gives limits"]
        low, high = max(p[0] for p in known), min(p[1] for p in known)
        if soft is None:
            text = f"A{axis + 1}: the controller has no usable soft limits, these are the arm's"
            remarks.append(text)
        elif low >= high:
            low, high = own or soft
            remarks.append(f"A{axis + 1}: {soft[0]:g} to {soft[1]:g} of the controller lie outside")
        elif (low, high) != soft:
            remarks.append(
                f"A{axis + 1}: the controller allows {soft[0]:g} to {soft[1]:g}, wider than the arm"
            )
        limits.append([low, high])
    if robot is not None and "q_min" in robot.doubts:
        remarks.append(f"of the arm {robot.doubts['q_min']}: the soft limits stand alone")
    return limits, remarks


def _own_limits(robot: Robot | None, axis: int) -> tuple[float, float] | None:
    if robot is None or "q_min" in robot.doubts or np.isnan(robot.q_min[axis]):
        return None
    return round(float(robot.q_min[axis] / DEG), 9), round(float(robot.q_max[axis] / DEG), 9)


def _is_same(name: str, machine: Machine) -> bool:
    geometry = load_robot(name).geometry
    assert isinstance(geometry, OpwGeometry)  # noqa: S101 - every built-in robot has one
    apart = np.abs(lengths_of(geometry) - np.array(machine.lengths_mm)).max()
    return bool(apart <= SAME_LENGTH_MM)


def lengths_of(geometry: OpwGeometry) -> FloatArray:
    """Return a1, a2, b, c1, c2, c3, c4 [mm]."""
    return np.array([getattr(geometry, key) for key in LENGTHS]) / MM


def _named(trafoname: str) -> str | None:
    if not trafoname:
        return None
    try:
        return find_robot(trafoname)
    except CellError:
        return None
