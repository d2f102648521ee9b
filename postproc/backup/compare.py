"""Where a cell and a controller differ, number by number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
from postproc.backup.arm import lengths_of, limits_of, match_arm
from postproc.backup.controller import Controller
from postproc.backup.external import ExternalAxisEntry, ExternalKinematic
from postproc.backup.frames import BaseEntry, ToolEntry
from postproc.backup.machine import SAME_LENGTH_MM
from postproc.backup.variables import matrix, six
from postproc.cell import LENGTHS, Cell, ExternalAxis, HomeStyle, OpwGeometry, Tool
from postproc.errors import Severity
from postproc.geometry import inverse, rotation_angle
from postproc.records import dataclass
from postproc.units import DEG, MM

_SAME = 1e-3
"""mm, deg, kg, or share of a speed: what is no farther apart is the same."""
_XHOME = "XHOME"
"""The home that programs may go to by its name."""

At = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Difference:
    """One number that differs: key of the cell, both values in units of the key, weight, words."""

    key: str
    at: At
    cell: Any
    controller: Any
    severity: Severity
    text: str


@dataclass(frozen=True, slots=True)
class BackupComparison:
    """How many numbers were compared, and those that differ."""

    compared: int
    differences: tuple[Difference, ...]


def compare(cell: Cell, controller: Controller) -> BackupComparison:
    """Return where a cell and a controller differ.

    An error is what would make programs wrong on this controller: lengths, wider limits, another
    frame, mass or root. What one side lacks is a warning in the cell, a note on the controller.
    """
    both = _Both(cell, controller)
    both.arm()
    both.frames()
    both.home()
    both.external_axes()
    return BackupComparison(both.compared, tuple(both.found))


@dataclass(slots=True)
class _Both:
    """Compares a cell with a controller; counts the numbers and keeps what differs."""

    cell: Cell
    controller: Controller
    compared: int = 0
    found: list[Difference] = field(default_factory=list)

    def differ(self, a: ArrayLike, b: ArrayLike, tolerance: float = _SAME) -> bool:
        """Return whether two equally long lists of numbers are apart."""
        own, other = np.atleast_1d(np.asarray(a, float)), np.atleast_1d(np.asarray(b, float))
        self.compared += own.size
        return not bool(np.abs(own - other).max() <= tolerance)

    def add(self, key: str, at: At, mine: Any, theirs: Any, severity: Severity, text: str) -> None:  # noqa: ANN401 - numbers, names or lists
        """Keep a difference."""
        self.found.append(Difference(key, at, mine, theirs, severity, text))

    def span(
        self, key: str, at: At, mine: Sequence[float], theirs: Sequence[float], said: str, unit: str
    ) -> None:
        """Compare limits; ``said`` goes before those of the cell."""
        if not self.differ(mine, theirs):
            return
        is_wider = mine[0] < theirs[0] - _SAME or mine[1] > theirs[1] + _SAME
        text = f"{said} {mine[0]:g} to {mine[1]:g} {unit}, on the controller "
        text += f"{theirs[0]:g} to {theirs[1]:g}{', the cell allows more' if is_wider else ''}"
        severity = Severity.ERROR if is_wider else Severity.NOTE
        self.add(key, at, list(mine), list(theirs), severity, text)

    def speed(self, key: str, at: At, mine: float, theirs: float, said: str, unit: str) -> None:
        """Compare speeds; ``said`` goes before that of the cell."""
        if self.differ(mine, theirs, _SAME * theirs):
            severity = Severity.WARNING if mine > theirs else Severity.NOTE
            text = f"{said} {mine:g} {unit}/s, on the controller {theirs:g}"
            self.add(key, at, mine, theirs, severity, text)

    def frame(self, key: str, at: At, mine: FloatArray, theirs: FloatArray) -> None:
        """Compare frames; angles are compared as rotations, B near 90 has many."""
        step = np.asarray(mine)[:3, 3] - theirs[:3, 3]
        turn = float(rotation_angle(np.asarray(mine)[:3, :3], theirs[:3, :3]) / DEG)
        is_apart = self.differ(step / MM, np.zeros(3))
        if self.differ([turn] * 3, np.zeros(3)) or is_apart:
            own, other = six(mine, 6), six(theirs, 6)
            shown = [" ".join(f"{value:g}" for value in frame) for frame in (own, other)]
            text = (
                f"{key} is {shown[0]}, on the controller {shown[1]}: "
                f"{float(np.linalg.norm(step)) / MM:.3f} mm and {turn:.3f} deg apart"
            )
            self.add(key, at, own, other, Severity.ERROR, text)

    # ---------------------------------------------------------------------------------- the arm

    def arm(self) -> None:
        """Compare lengths, limits, speeds and root of the arm."""
        robot, machine = self.cell.robot, self.controller.machine
        if isinstance(robot.geometry, OpwGeometry):
            own = lengths_of(robot.geometry).tolist()
            for name, mine, theirs in zip(LENGTHS, own, machine.lengths_mm, strict=True):
                if self.differ(mine, theirs, SAME_LENGTH_MM):
                    key = "robot.dimensions_mm." + name
                    text = f"{key} is {mine:g} mm, on the controller {theirs:g}"
                    self.add(key, ("robot",), mine, theirs, Severity.ERROR, text)
        match = match_arm(machine)
        if match.robot is not None and match.robot.name != robot.name:
            text = f"the arm is {robot.name}, $TRAFONAME of the controller {machine.trafoname}"
            at, severity = ("robot", "model"), Severity.WARNING
            self.add("robot.model", at, robot.name, match.robot.name, severity, text)
        for axis, limits in enumerate(limits_of(machine, match.robot)[0]):
            span = [float(robot.q_min[axis] / DEG), float(robot.q_max[axis] / DEG)]
            key, said = f"robot.limits_deg[{axis + 1}]", f"limits of A{axis + 1} are"
            self.span(key, ("robot", "limits_deg"), span, limits, said, "deg")
        for axis, theirs in enumerate(machine.speed_deg_s or ()):
            key = f"robot.speed_deg_s[{axis + 1}]"
            speed = float(robot.qd_max[axis] / DEG)
            self.speed(key, ("robot", "speed_deg_s"), speed, theirs, f"{key} is", "deg")
        root = matrix(self.controller.root)
        self.frame("robot.base", ("robot", "base"), robot.T_world_robroot, root)

    def home(self) -> None:
        """Compare homes: an error where programs go to the controller's own by its name."""
        by_name = self.cell.krl.home is not HomeStyle.AXES
        homes = self.controller.homes
        name = _XHOME if by_name else next(iter(homes), _XHOME)
        if self.cell.motion.home is None:
            return
        mine = [round(float(angle / DEG), 6) for angle in self.cell.motion.home]
        theirs = homes.get(name)
        key, at = "motion.home_deg", ("motion", "home_deg")
        if theirs is None:
            if by_name:
                text = f"programs go to {name}, which the backup does not have"
                self.add(key, at, mine, None, Severity.WARNING, text)
        elif self.differ(mine, theirs):
            shown = (" ".join(f"{angle:g}" for angle in home) for home in (mine, theirs))
            text = "motion.home_deg is {}, {name} of the controller {}".format(*shown, name=name)
            text += ": programs go there by its name" if by_name else ""
            severity = Severity.ERROR if by_name else Severity.NOTE
            self.add(key, at, mine, list(theirs), severity, text)

    # ------------------------------------------------------------------------- tools and bases

    def frames(self) -> None:
        """Compare tools and bases by their numbers."""
        cell, controller = self.cell, self.controller
        T_robroot_world = inverse(matrix(controller.root))
        tools: _Known = {t.number: (t, matrix(t.frame)) for t in controller.tools if t.is_carried}
        placed = ((base, controller.T_world_base(base)) for base in controller.bases)
        bases: _Known = {b.number: (b, T_robroot_world @ T) for b, T in placed if T is not None}
        self._numbered("tool", [(t.number, t.T_flange_tcp) for t in cell.tools], tools)
        self._numbered("base", [(b.number, b.T_robroot_base) for b in cell.bases], bases)
        for word, known in (("tool", tools), ("base", bases)):
            for number, (entry, _) in known.items():
                text = f"{word.upper()}_DATA[{number}] {entry.name} of the controller "
                text += "is not in the cell"
                self.add(f"{word}s[{number}]", (), None, list(entry.frame), Severity.NOTE, text)

    def _numbered(self, word: str, own: Sequence[tuple[int, FloatArray]], known: _Known) -> None:
        """Compare the entries of a cell with those of the same numbers, and take these out."""
        for place, (number, T) in enumerate(own):
            at = (f"{word}s", place)
            if number in known:
                entry, theirs = known.pop(number)
                key = f"{word}s[{number}]"
                self.frame(f"{key}.frame", (*at, "frame"), T, theirs)
                if isinstance(entry, ToolEntry):
                    self._load(key, at, self.cell.tools[place], entry)
            elif not np.allclose(T, np.eye(4), atol=1e-12):
                used = self.controller.tools if word == "tool" else self.controller.bases
                shown = ", ".join(str(entry.number) for entry in used) or "none"
                name = f"{word.upper()}_DATA[{number}]"
                text = f"{name} is not used on the controller, used are {shown}"
                self.add(name, at, None, None, Severity.WARNING, text)

    def _load(self, key: str, at: At, tool: Tool, entry: ToolEntry) -> None:
        mass = entry.mass_kg
        if mass is None:
            return
        if np.isnan(tool.mass):
            text = f"{key} has no mass_kg, on the controller {mass:g}"
            self.add(f"{key}.mass_kg", at, None, mass, Severity.WARNING, text)
        elif self.differ(tool.mass, mass):
            own = float(tool.mass)
            text = f"{key}.mass_kg is {own:g} kg, on the controller {mass:g}"
            self.add(f"{key}.mass_kg", (*at, "mass_kg"), own, mass, Severity.ERROR, text)
        if tool.com is not None and entry.cog is not None:
            mine, theirs = [float(v / MM) for v in tool.com], list(entry.cog[:3])
            if self.differ(mine, theirs):
                text = f"{key}.cog_mm is {mine}, on the controller {theirs}"
                self.add(f"{key}.cog_mm", (*at, "cog_mm"), mine, theirs, Severity.ERROR, text)

    # ---------------------------------------------------------------------------- external axes

    def external_axes(self) -> None:
        """Compare external axes; programs with values for one that is not there are errors."""
        own = {axis.name: (place, axis) for place, axis in enumerate(self.cell.external_axes)}
        theirs = [(k, entry) for k in self.controller.externals for entry in k.axes]
        for kinematic, entry in theirs:
            key = f"external_axes[{entry.name}]"
            if entry.name in own:
                place, axis = own.pop(entry.name)
                self._axis(key, ("external_axes", place), axis, entry, kinematic)
            else:
                text = f"{entry.name} of the controller ({kinematic.name}) is not in the cell: "
                text += "programs do not move it"
                self.add(key, (), None, entry.name, Severity.WARNING, text)
        names = ", ".join(entry.name for _, entry in theirs) or "no external axes"
        for place, axis in own.values():
            text = f"{axis.name} of the cell is not on the controller, it has {names}"
            key, at = f"external_axes[{axis.name}]", ("external_axes", place)
            self.add(key, at, axis.name, None, Severity.ERROR, text)

    def _axis(
        self,
        key: str,
        at: At,
        axis: ExternalAxis,
        entry: ExternalAxisEntry,
        kinematic: ExternalKinematic,
    ) -> None:
        if kinematic.kind != axis.kind:
            theirs = kinematic.kind or "of no kinematic"
            text = f"{axis.name} is a {axis.kind} of the cell, on the controller {theirs}"
            self.add(f"{key}.kind", at, axis.kind, kinematic.kind, Severity.ERROR, text)
            return
        unit, per = ("mm", MM) if entry.is_linear else ("deg", DEG)
        if entry.limits:
            name, span = f"range_{unit}", (axis.q_min / per, axis.q_max / per)
            said = f"{axis.name} goes from"
            self.span(f"{key}.{name}", (*at, name), span, entry.limits, said, unit)
        if entry.speed:
            name, said = f"speed_{unit}_s", f"{axis.name} runs at"
            self.speed(f"{key}.{name}", (*at, name), axis.qd_max / per, entry.speed, said, unit)
        if entry.frame is not None:
            self._line(f"{key}.axis", at, axis, matrix(entry.frame))

    def _line(self, key: str, at: At, axis: ExternalAxis, T_world_axis: FloatArray) -> None:
        """Compare where an axis points, and the line about which a positioner turns."""
        direction = T_world_axis[:3, 2]
        sine = np.linalg.norm(np.cross(axis.axis, direction))
        off = float(np.arctan2(sine, axis.axis @ direction)) / DEG
        step = np.asarray(axis.T_world_axis)[:3, 3] - T_world_axis[:3, 3]
        aside = 0.0 if axis.kind == "rail" else float(np.linalg.norm(np.cross(step, direction)))
        is_turned = self.differ(off, 0.0)
        if self.differ(aside / MM, 0.0) or is_turned:
            text = f"{axis.name} lies {aside / MM:.3f} mm and {off:.3f} deg off the controller's"
            self.add(key, at, off, 0.0, Severity.ERROR, text)


_Known = dict[int, tuple[ToolEntry | BaseEntry, FloatArray]]
