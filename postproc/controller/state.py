"""The controller's motion state: tool, base, speeds, approximation, and what BAS does to them.

After ``BAS(#INITMOV,0)``: tool 1, base $WORLD, delivered defaults. ``BAS(#VEL_CP,v)`` is clamped at
the default path speed without a message, as on the controller. BASE_DATA are frames in $WORLD, the
world of the cell; $ROBROOT is where the cell says that the robot stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np

from postproc import krl
from postproc.arrays import FloatArray
from postproc.controller.runtime import UNKNOWN, component, matrix_of, pose_of, text_of
from postproc.controller.trace import Settings
from postproc.geometry import inverse
from postproc.records import dataclass
from postproc.units import PERCENT

Scalar = float | str
"""A number, or the text of any other value."""


_MOST_KNOWN = 4096
"""So many answers are remembered at most."""


@dataclass(slots=True)
class FrameTable:
    """Distinct frames by row; equal poses share a row."""

    rows: list[FloatArray] = field(default_factory=list)
    _known: dict[bytes, int] = field(default_factory=dict)

    def row(self, T: FloatArray) -> int:
        """Return the row of a transform (4, 4), new or known."""
        key = np.ascontiguousarray(T).tobytes()
        if key not in self._known:
            self._known[key] = len(self.rows)
            self.rows.append(np.asarray(T, dtype=np.float64))
        return self._known[key]

    def stack(self) -> FloatArray:
        """Return all frames (k, 4, 4)."""
        return np.stack(self.rows) if self.rows else np.zeros((0, 4, 4))


class MotionState:
    """Motion settings, changed by assignments to system variables and by BAS.

    Args:
        tools: TOOL_DATA by number; bases: BASE_DATA by number. Both are looked up when selected,
            so a program that writes them is followed.
        T_world_robroot: (4, 4) $ROBROOT [m].
    """

    def __init__(
        self,
        tools: Mapping[int, krl.Pose],
        bases: Mapping[int, krl.Pose],
        T_world_robroot: FloatArray,
    ) -> None:
        self.tool_data = dict(tools)
        self.base_data = dict(bases)
        self._T_world_robroot = np.asarray(T_world_robroot, dtype=np.float64)
        self._T_robroot_world = inverse(self._T_world_robroot)
        self.tool_frames, self.base_frames = FrameTable(), FrameTable()
        self.values = Settings(self.tool_frames.row(np.eye(4)), self._base_row(np.eye(4)))
        self.missing: list[str] = []
        """Frames that were selected and are not known, until somebody asks."""
        self.unjudged: list[tuple[str, str]] = []
        """What was set to something that is not known: its name and what is wrong with it."""
        self.table: list[Settings] = []
        """All settings that a motion was run with, by row."""
        self._rows: dict[object, int] = {}
        self._known: dict[object, Any] = {}
        """What was asked of values before: programs go to and fro between a few settings."""

    # -------------------------------------------------------------------- what a motion is run with

    def row(self) -> int:
        """Return the row of the present settings in the table of all."""
        source, row = self._known.get(id(self.values), (None, 0))
        if source is not self.values:
            row = self._rows.setdefault(self.values.key, len(self.table))
            self.table += [self.values] * (row == len(self.table))
            self._remember(id(self.values), row)
        return int(row)

    @property
    def T_flange_tcp(self) -> FloatArray:
        """(4, 4) tool in force [m]."""
        return self.tool_frames.rows[self.values.tool]

    @property
    def T_robroot_base(self) -> FloatArray:
        """(4, 4) base in force [m]."""
        return self.base_frames.rows[self.values.base]

    def _base_row(self, T_world_base: FloatArray) -> int:
        return self.base_frames.row(self._T_robroot_world @ T_world_base)

    def _set(self, done: str = "", **changes: Any) -> None:  # noqa: ANN401
        """Change values that the program has ``done``, and system variables; None takes one out."""
        key = (id(self.values), done, *changes.items())
        source, after = self._known.get(key, (None, None))
        if source is not self.values:
            fields = {name: value for name, value in changes.items() if name.isidentifier()}
            if len(fields) < len(changes):
                system = {**self.values.system, **changes}
                fields["system"] = {
                    k: v for k, v in system.items() if k not in fields and v is not None
                }
            if done and done not in self.values.done:
                fields["done"] = self.values.done | {done}
            after = replace(self.values, **fields)
            after = self._known.setdefault(after.key, (after, after))[0]
            self._remember(key, after)
        self.values = after

    def _remember(self, key: object, answer: object) -> None:
        """Keep an answer for the present values, which are kept as well: else ids come again."""
        if len(self._known) > _MOST_KNOWN:
            self._known.clear()
        self._known[key] = (self.values, answer)

    def note(self, what: str, *, on: bool = True) -> None:
        """Note that something was done, or undone, that later motions rely on."""
        done = self.values.done | {what} if on else self.values.done - {what}
        if done != self.values.done:
            self.values = replace(self.values, done=done)

    def _unknown(self, key: str) -> None:
        self.unjudged.append((key, f"{key} is set to something that is not known here"))

    def _refused(self, key: str, value: float) -> None:
        self.unjudged.append(
            (key, f"{key} with {value:g}: the controller does not accept this number")
        )

    # -------------------------------------------------------------------------------------- frames

    def select_tool(self, number: Any) -> None:  # noqa: ANN401 - may be unknown
        """Take TOOL_DATA[number]; 0 and below is the flange itself."""
        pose = self._numbered(self.tool_data, number, "tool")
        if pose is not None:
            number = max(int(number), 0)
            self._set("$TOOL", tool=self.tool_frames.row(matrix_of(pose)), tool_number=number)

    def select_load(self, number: Any) -> None:  # noqa: ANN401 - may be unknown
        """Take LOAD_DATA[number], as BAS(#TOOL) does besides the tool."""
        if isinstance(number, int) and not isinstance(number, bool):
            own = {k: None for k in self.values.system if k.startswith("$LOAD.")}
            self._set("$LOAD", load_number=max(number, 0), load_mass=math.nan, **own)
        else:
            self._unknown("$LOAD")

    def select_base(self, number: Any) -> None:  # noqa: ANN401 - may be unknown
        """Take BASE_DATA[number]; 0 and below is $WORLD."""
        pose = self._numbered(self.base_data, number, "base")
        if pose is not None:
            number = max(int(number), 0)
            self._set("$BASE", base=self._base_row(matrix_of(pose)), base_number=number)

    def _numbered(self, data: Mapping[int, krl.Pose], number: Any, what: str) -> krl.Pose | None:  # noqa: ANN401
        if isinstance(number, bool) or not isinstance(number, int):
            self.missing.append(f"{what} of a number that is not known")
            return None
        if number <= 0:
            return krl.Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if number not in data:
            known = ", ".join(str(n) for n in sorted(data)) or "none"
            self.missing.append(f"{what} {number} is not defined, the cell has {known}")
            return None
        return data[number]

    def set_frame(self, name: str, value: Any, number: int) -> None:  # noqa: ANN401
        """Take a pose as $TOOL or $BASE."""
        if not isinstance(value, krl.Pose):
            self.missing.append(f"{name} is set to a frame that is not known")
            return
        T = matrix_of(value)
        if name == "$TOOL":
            self._set(name, tool=self.tool_frames.row(T), tool_number=number)
        else:
            self._set(name, base=self._base_row(T), base_number=number)

    # ---------------------------------------------------------------------------- system variables

    def assign(self, key: str, value: Any) -> bool:  # noqa: ANN401
        """Set a system variable by its canonical name; False if what it does is not followed."""
        if key in ("$TOOL", "$BASE"):
            self.set_frame(key, value, -1)
            return True
        if key == "$LOAD" or key.startswith("$LOAD."):
            self._own_load(key, value)
            return True
        if key in krl.initial_values():
            self._followed(key, value)
            return True
        parts = _parts(value)
        if parts:
            return all([self.assign(f"{key}.{name.upper()}", item) for name, item in parts])
        self._set("", **{key: _scalar(value)})
        return False

    def _followed(self, key: str, value: Any) -> None:  # noqa: ANN401
        """Set a variable of the table that is followed, if it takes the value."""
        variable = krl.system_variable(key)
        if variable is None:
            return
        if variable.constants:
            name = value.name.upper() if isinstance(value, krl.Enum) else ""
            if name in variable.constants:
                self._set(variable.name, **{key: name})
            else:
                self._unknown(key)
        elif not _is_number(value):
            self._unknown(key)
        elif not variable.takes(value) and not self._may_stand_still(variable, value):
            self._refused(key, value)
        else:
            self._set(variable.name, **{key: float(value)})

    @staticmethod
    def _may_stand_still(variable: krl.SystemVariable, value: float) -> bool:
        """Whether a speed is 0: the checks of the motions say that the arm would not move."""
        return value == 0 and variable.name in ("$VEL.CP", "$VEL_AXIS", "$ACC_AXIS")

    def _own_load(self, key: str, value: Any) -> None:  # noqa: ANN401
        """Take a load of the program's own; one component of it makes the rest no known load."""
        mass: Any = component(value, "M") if key == "$LOAD" else UNKNOWN
        mass = float(mass) if _is_number(mass) else math.nan
        self._set("$LOAD", load_number=-1, load_mass=mass)
        self._set("", **dict(_leaves(key, value)))

    def read(self, key: str) -> Any:  # noqa: ANN401
        """Return a system variable of the motion state, ``UNKNOWN`` for any other."""
        if key in self.values.system:
            value = self.values.system[key]
            return krl.Enum(value) if isinstance(value, str) else value
        if key in ("$ACT_TOOL", "$ACT_BASE"):
            values = self.values
            return values.tool_number if key == "$ACT_TOOL" else values.base_number
        frames: dict[str, Callable[[], FloatArray]] = {
            "$TOOL": lambda: self.T_flange_tcp,
            "$BASE": lambda: self._T_world_robroot @ self.T_robroot_base,
            "$ROBROOT": lambda: self._T_world_robroot,
            "$NULLFRAME": lambda: np.eye(4),
            "$WORLD": lambda: np.eye(4),
        }
        name, _, rest = key.partition(".")
        pose = pose_of(frames[name]()) if name in frames else UNKNOWN
        return component(pose, rest) if rest else pose

    # ------------------------------------------------------------------------------------------ BAS

    def bas(self, command: str, argument: Any, active: Mapping[str, Any]) -> bool:  # noqa: ANN401
        """Run ``BAS(#command, argument)``; False if the command (in upper case) is not known.

        ``active``: FDAT_ACT, PDAT_ACT and LDAT_ACT as far as they are set.
        """
        if command == "INITMOV":
            self._reset()
        elif command == "TOOL":
            self.select_tool(argument)
            self.select_load(argument)
        elif command == "BASE":
            self.select_base(argument)
        elif command in ("VEL_PTP", "ACC_PTP", "VEL_CP", "ACC_CP"):
            self._speed(command, argument)
        elif command in ("PTP_PARAMS", "CP_PARAMS", "PTP_DAT", "CP_DAT", "FRAMES"):
            is_ptp = command.startswith("PTP")
            if command != "FRAMES":
                self.motion_data(active.get("PDAT_ACT" if is_ptp else "LDAT_ACT", UNKNOWN))
            if not command.endswith("_DAT"):
                self.frame_data(active.get("FDAT_ACT", UNKNOWN))
            if command.endswith("_PARAMS"):
                self._speed("VEL_PTP" if is_ptp else "VEL_CP", argument)
        else:
            return False
        return True

    def _reset(self) -> None:
        kept = self.values.done & {STOPMESS}
        self.values = replace(
            Settings(self.values.tool, self._base_row(np.eye(4))),
            tool_number=self.values.tool_number,
            load_number=1,
        )
        # TOOL_DATA[1] exists on every controller, measured or not.
        if 1 in self.tool_data:
            self.select_tool(1)
        else:
            self._set(tool=self.tool_frames.row(np.eye(4)), tool_number=1)
        self.values = replace(self.values, done=kept | {INITMOV})

    def _speed(self, command: str, value: Any) -> None:  # noqa: ANN401
        """Run the commands that set a speed or an acceleration."""
        if not _is_number(value):
            self._unknown(f"BAS(#{command})")
        elif command == "VEL_CP":
            # above the default of the controller BAS takes that, without a message
            self._followed("$VEL.CP", min(value, _default("$VEL.CP")))
        elif command == "ACC_CP":
            self._followed("$ACC.CP", _default("$ACC.CP") * PERCENT * min(value, 100.0))
        else:
            name = "$VEL_AXIS" if command == "VEL_PTP" else "$ACC_AXIS"
            for axis in range(1, 7):
                self._followed(f"{name}[{axis}]", value)

    def frame_data(self, fdat: Any) -> None:  # noqa: ANN401
        """Take tool, base and interpolation mode of a FDAT."""
        if not isinstance(fdat, krl.Aggregate):
            self.missing.append("the frame data (FDAT) of the motion are not known")
            return
        self.select_tool(component(fdat, "TOOL_NO"))
        self.select_load(component(fdat, "TOOL_NO"))
        self.select_base(component(fdat, "BASE_NO"))
        self._followed("$IPO_MODE", component(fdat, "IPO_FRAME"))

    def motion_data(self, data: Any) -> None:  # noqa: ANN401
        """Take acceleration, approximation and all else of a PDAT or LDAT."""
        if not isinstance(data, krl.Aggregate):
            self.unjudged.append(("PDAT", "the motion data (PDAT, LDAT) are not known"))
            return
        is_ptp = self.approximation(data)
        for name, value in data.fields:
            part = name.upper().partition("[")[0]
            if part in ("ORI_TYP", "CIRC_TYP"):
                self._followed("$ORI_TYPE" if part == "ORI_TYP" else "$CIRC_TYPE", value)
            elif part == "ACC":
                self._speed("ACC_PTP" if is_ptp else "ACC_CP", value)
            elif part not in ("VEL", "APO_DIST", "APO_MODE"):
                self._set("", **dict(_leaves(f"{'PDAT' if is_ptp else 'LDAT'}.{part}", value)))

    def approximation(self, data: krl.Aggregate) -> bool:
        """Take the approximation of a PDAT or LDAT; return whether it is that of a PTP."""
        distance, mode = component(data, "APO_DIST"), component(data, "APO_MODE")
        is_ptp = component(data, "ORI_TYP") is UNKNOWN and component(data, "AXIS_VEL") is UNKNOWN
        if _is_number(distance):
            in_percent = is_ptp and not (isinstance(mode, krl.Enum) and mode.name.upper() == "CDIS")
            self._followed("$APO.CPTP" if in_percent else "$APO.CDIS", distance)
        return is_ptp


def _is_number(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, int | float) and not isinstance(value, bool)


def _default(key: str) -> float:
    return float(krl.initial_values()[key])


def _parts(value: Any) -> list[tuple[str, Any]]:  # noqa: ANN401 - a KRL value
    """Return the components of a structure, none of anything else."""
    if isinstance(value, krl.Aggregate):
        return list(value.fields)
    return list(krl.components(value)) if isinstance(value, krl.Pose | krl.Axes) else []


def _leaves(key: str, value: Any) -> Iterator[tuple[str, Scalar]]:  # noqa: ANN401
    """Yield the scalars of a value, each by its canonical name."""
    parts = _parts(value)
    for name, item in parts:
        yield from _leaves(f"{key}.{name.upper()}", item)
    if not parts:
        yield key, _scalar(value)


def _scalar(value: Any) -> Scalar:  # noqa: ANN401
    return float(value) if _is_number(value) else text_of(value)


INITMOV = "BAS(#INITMOV)"
STOPMESS = "INTERRUPT 3"
"""The delivered interrupt that stops the program with the robot, declared and switched on."""
