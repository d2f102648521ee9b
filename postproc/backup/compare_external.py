"""Numbers of a cell and a controller side by side, and where their external axes differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.backup.controller import Controller
from postproc.backup.external import ExternalAxisEntry, ExternalKinematic
from postproc.cell import Cell, ExternalAxis
from postproc.errors import Severity
from postproc.geometry import transform_from_kuka
from postproc.records import dataclass
from postproc.units import DEG, MM

LENGTH_MM = 1e-3
ANGLE_DEG = 1e-3
SPEED = 1e-3
"""Share of a speed."""
_RANGE = 1e-3
"""mm of a rail, deg of a positioner."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One number that differs: key of the cell, both values in units of the key, weight, words."""

    key: str
    at: tuple[str | int, ...]
    cell: Any
    controller: Any
    severity: Severity
    text: str


@dataclass(slots=True)
class Counted:
    """How many numbers have been compared."""

    numbers: int = 0

    def differ(self, a: ArrayLike, b: ArrayLike, tolerance: float) -> bool:
        """Return whether two equally long lists of numbers are apart."""
        own, other = np.atleast_1d(np.asarray(a, float)), np.atleast_1d(np.asarray(b, float))
        self.numbers += own.size
        return not bool(np.abs(own - other).max() <= tolerance)


def compare_external_axes(
    cell: Cell, controller: Controller, counted: Counted
) -> Iterator[Difference]:
    """Yield what differs; programs with values for an axis that is not there are errors."""
    own = {axis.name: (place, axis) for place, axis in enumerate(cell.external_axes)}
    for kinematic in controller.externals:
        for entry in kinematic.axes:
            if entry.name in own:
                place, axis = own.pop(entry.name)
                at = ("external_axes", place)
                yield from _axis(at, axis, entry, kinematic, counted)
            else:
                text = f"{entry.name} of the controller ({kinematic.name}) is not in the cell: "
                key = f"external_axes[{entry.name}]"
                text += "programs leave it where it stands"
                yield Difference(key, (), None, entry.name, Severity.WARNING, text)
    for place, axis in own.values():
        text = f"{axis.name} of the cell is not on the controller, it has {_names(controller)}"
        key, at = f"external_axes[{axis.name}]", ("external_axes", place)
        yield Difference(key, at, axis.name, None, Severity.ERROR, text)


def _names(controller: Controller) -> str:
    names = [axis.name for kinematic in controller.externals for axis in kinematic.axes]
    return ", ".join(names) or "no external axes"


def _axis(
    at: tuple[str | int, ...],
    axis: ExternalAxis,
    entry: ExternalAxisEntry,
    kinematic: ExternalKinematic,
    counted: Counted,
) -> Iterator[Difference]:
    key = f"external_axes[{axis.name}]"
    if kinematic.kind != axis.kind:
        theirs = kinematic.kind or "of no kinematic"
        text = f"{axis.name} is a {axis.kind} of the cell, on the controller {theirs}"
        yield Difference(f"{key}.kind", at, axis.kind, kinematic.kind, Severity.ERROR, text)
        return
    unit, per = ("mm", MM) if entry.is_linear else ("deg", DEG)
    span = [axis.q_min / per, axis.q_max / per]
    if entry.limits and counted.differ(span, entry.limits, _RANGE):
        low, high = entry.limits
        is_wider = span[0] < low - _RANGE or span[1] > high + _RANGE
        text = f"{axis.name} goes from {span[0]:g} to {span[1]:g} {unit}, on the controller "
        text += f"{low:g} to {high:g}{', the cell allows more' if is_wider else ''}"
        severity = Severity.ERROR if is_wider else Severity.NOTE
        name = f"{key}.range_{unit}"
        yield Difference(name, (*at, f"range_{unit}"), span, list(entry.limits), severity, text)
    speed = axis.qd_max / per
    if entry.speed and counted.differ(speed, entry.speed, SPEED * entry.speed):
        text = f"{axis.name} runs at {speed:g} {unit}/s, on the controller {entry.speed:g}"
        severity = Severity.WARNING if speed > entry.speed else Severity.NOTE
        name = f"speed_{unit}_s"
        yield Difference(f"{key}.{name}", (*at, name), speed, entry.speed, severity, text)
    if entry.frame is not None:
        yield from _line(key, at, axis, entry.frame, counted)


def _line(
    key: str,
    at: tuple[str | int, ...],
    axis: ExternalAxis,
    frame: tuple[float, ...],
    counted: Counted,
) -> Iterator[Difference]:
    """Yield where an axis points elsewhere, or a positioner turns about another line."""
    T_world_axis = transform_from_kuka(frame[:3], frame[3:])
    direction = T_world_axis[:3, 2]
    off = float(np.arctan2(np.linalg.norm(np.cross(axis.axis, direction)), axis.axis @ direction))
    step = np.asarray(axis.T_world_axis)[:3, 3] - T_world_axis[:3, 3]
    aside = 0.0 if axis.kind == "rail" else float(np.linalg.norm(np.cross(step, direction)))
    is_turned = counted.differ(off / DEG, 0.0, ANGLE_DEG)
    if counted.differ(aside / MM, 0.0, LENGTH_MM) or is_turned:
        text = f"{axis.name} lies {aside / MM:.3f} mm and {off / DEG:.3f} deg off the controller's"
        yield Difference(f"{key}.axis", at, off / DEG, 0.0, Severity.ERROR, text)
