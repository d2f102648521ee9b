"""The controller's motion state: tool, base, speeds, approximation, and what BAS does to them.

After ``BAS(#INITMOV,0)``: tool 1, base $WORLD, delivered defaults. ``BAS(#VEL_CP,v)`` is clamped at
the default path speed without a message, as on the controller. BASE_DATA are frames in $WORLD, the
world of the cell; $ROBROOT is where the cell says that the robot stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.controller.runtime import UNKNOWN, component, matrix_of, pose_of
from postproc.controller.trace import Settings
from postproc.geometry import inverse
from postproc.krl import MOST_ADVANCE, MOST_ORIENTATION_SPEED, Aggregate, Enum, Pose
from postproc.records import dataclass
from postproc.units import DEG, MM, PERCENT

DEFAULT_SPEED = 2.0
"""$VEL.CP after INITMOV and the clamp of BAS(#VEL_CP) [m/s]."""
DEFAULT_ACCELERATION = 2.3
"""$ACC.CP [m/s^2]."""
DEFAULT_ORIENTATION = 200.0
"""$VEL.ORI1 [deg/s]."""
DEFAULT_CDIS = 3.0
"""$APO.CDIS [mm]."""
DEFAULT_CPTP = 50.0
"""$APO.CPTP [%]."""
DEFAULT_CVEL = 100.0
"""$APO.CVEL [%]."""
DEFAULT_CORI = 5.0
"""$APO.CORI [deg]."""


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


@dataclass(frozen=True, slots=True)
class Values:
    """The state as plain values; replaced, never changed, so that WITH can put it back."""

    tool: int
    base: int
    tool_number: int = 0
    base_number: int = 0
    speed: float = DEFAULT_SPEED
    swivel: float = DEFAULT_ORIENTATION
    rotation: float = DEFAULT_ORIENTATION
    acceleration: float = DEFAULT_ACCELERATION
    ptp: tuple[float, ...] = (100.0,) * 6
    ramp: tuple[float, ...] = (100.0,) * 6
    cdis: float = DEFAULT_CDIS
    cptp: float = DEFAULT_CPTP
    cvel: float = DEFAULT_CVEL
    cori: float = DEFAULT_CORI
    advance: int = 3
    orientation: str = "VAR"
    circle: str = "BASE"
    ipo_tcp: bool = False
    load_number: int = 0
    load_mass: float = math.nan
    done: frozenset[str] = frozenset()


class MotionState:
    """Motion settings, changed by assignments to system variables and by BAS.

    Args:
        tools: TOOL_DATA by number; bases: BASE_DATA by number. Both are looked up when selected,
            so a program that writes them is followed.
        T_world_robroot: (4, 4) $ROBROOT [m].
    """

    def __init__(
        self, tools: Mapping[int, Pose], bases: Mapping[int, Pose], T_world_robroot: FloatArray
    ) -> None:
        self.tool_data = dict(tools)
        self.base_data = dict(bases)
        self._T_world_robroot = np.asarray(T_world_robroot, dtype=np.float64)
        self._T_robroot_world = inverse(self._T_world_robroot)
        self.tool_frames, self.base_frames = FrameTable(), FrameTable()
        self.values = Values(self.tool_frames.row(np.eye(4)), self._base_row(np.eye(4)))
        self.missing: list[str] = []
        """Frames that were selected and are not known, until somebody asks."""
        self.unjudged: list[tuple[str, str]] = []
        """What was set to something that is not known: its name and what is wrong with it."""
        self._rows: dict[Settings, int] = {}
        self._known: dict[object, Any] = {}
        """What was asked of values before: programs go to and fro between a few settings."""

    # -------------------------------------------------------------------- what a motion is run with

    def row(self) -> int:
        """Return the row of the present settings in the table of all."""
        v = self.values
        source, known = self._known.get(id(v), (None, 0))
        if source is v:
            return int(known)
        settings = Settings(
            tool=v.tool,
            base=v.base,
            tool_number=v.tool_number,
            base_number=v.base_number,
            speed=v.speed,
            orientation_speed=min(v.swivel, v.rotation) * DEG,
            acceleration=v.acceleration,
            ptp=tuple(share * PERCENT for share in v.ptp),
            cdis=v.cdis * MM,
            cptp=v.cptp * PERCENT,
            cvel=v.cvel * PERCENT,
            cori=v.cori * DEG,
            ramp=tuple(share * PERCENT for share in v.ramp),
            advance=v.advance,
            orientation=v.orientation,
            circle=v.circle,
            ipo_tcp=v.ipo_tcp,
            load_number=v.load_number,
            load_mass=v.load_mass,
            done=v.done,
        )
        row = self._rows.setdefault(settings, len(self._rows))
        self._remember(id(v), row)
        return row

    @property
    def table(self) -> tuple[Settings, ...]:
        """All settings that a motion was run with, by row."""
        return tuple(self._rows)

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

    def _set(self, done: str = "", **changes: Any) -> None:  # noqa: ANN401 - fields of Values
        """Change values; ``done``: what the program has set by that."""
        key = (id(self.values), done, *changes.items())
        source, after = self._known.get(key, (None, None))
        if source is not self.values:
            if done and done not in self.values.done:
                changes["done"] = self.values.done | {done}
            after = replace(self.values, **changes)
            after = self._known.setdefault(after, (after, after))[0]
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
        self.unjudged.append((key, f"{key} with {value:g}: the controller takes no such number"))

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
            self._set("$LOAD", load_number=max(number, 0), load_mass=math.nan)
        else:
            self._unknown("$LOAD")

    def select_base(self, number: Any) -> None:  # noqa: ANN401 - may be unknown
        """Take BASE_DATA[number]; 0 and below is $WORLD."""
        pose = self._numbered(self.base_data, number, "base")
        if pose is not None:
            number = max(int(number), 0)
            self._set("$BASE", base=self._base_row(matrix_of(pose)), base_number=number)

    def _numbered(self, data: Mapping[int, Pose], number: Any, what: str) -> Pose | None:  # noqa: ANN401
        if isinstance(number, bool) or not isinstance(number, int):
            self.missing.append(f"{what} of a number that is not known")
            return None
        if number <= 0:
            return Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if number not in data:
            known = ", ".join(str(n) for n in sorted(data)) or "none"
            self.missing.append(f"{what} {number} is not defined, the cell has {known}")
            return None
        return data[number]

    def set_frame(self, name: str, value: Any, number: int) -> None:  # noqa: ANN401
        """Take a pose as $TOOL or $BASE."""
        if not isinstance(value, Pose):
            self.missing.append(f"{name} is set to a frame that is not known")
            return
        T = matrix_of(value)
        if name == "$TOOL":
            self._set(name, tool=self.tool_frames.row(T), tool_number=number)
        else:
            self._set(name, base=self._base_row(T), base_number=number)

    # ---------------------------------------------------------------------------- system variables

    def assign(self, key: str, value: Any) -> bool:  # noqa: ANN401
        """Set a system variable by its canonical name; False if it is none of the motion's."""
        if key in ("$TOOL", "$BASE"):
            self.set_frame(key, value, -1)
        elif key in _STRUCTURES and isinstance(value, Aggregate):
            for name, item in value.fields:
                if not self.assign(f"{key}.{name.upper()}", item):
                    self._unknown(f"{key}.{name.upper()}")
        elif key in NUMBERS:
            self.number(key, value)
        elif key.startswith(("$VEL_AXIS[", "$ACC_AXIS[")):
            self._axis_share(key, value)
        elif key in _MODES:
            self._mode(key, value)
        elif key == "$LOAD" or key.startswith("$LOAD."):
            self._load(key, value)
        else:
            return key in _RAMPS or key.startswith(_INDEXED_RAMPS)
        return True

    def number(self, key: str, value: Any) -> None:  # noqa: ANN401
        """Set a system variable of ``NUMBERS``."""
        if not _is_number(value):
            self._unknown(key)
        elif value > _MOST.get(key, math.inf) or (key == "$ADVANCE" and value != int(value)):
            self._refused(key, value)
        elif value > 0 or (value == 0 and not key.startswith(_RATES)):
            self._set(key, **{NUMBERS[key]: value})
        else:
            self._refused(key, value)

    def _axis_share(self, key: str, value: Any) -> None:  # noqa: ANN401
        name, _, digits = key[:-1].partition("[")
        if not (digits.isdigit() and 1 <= int(digits) <= 6 and _is_number(value)):
            self._unknown(key)
            return
        if not 0.0 <= value <= 100.0:
            self._refused(key, value)
            return
        column = "ptp" if name == "$VEL_AXIS" else "ramp"
        shares = list(getattr(self.values, column))
        shares[int(digits) - 1] = float(value)
        self._set(name, **{column: tuple(shares)})

    def _mode(self, key: str, value: Any) -> None:  # noqa: ANN401
        name = value.name.upper() if isinstance(value, Enum) else ""
        if name not in _MODES[key]:
            self._unknown(key)
        elif key == "$IPO_MODE":
            self._set(key, ipo_tcp=name == "TCP")
        else:
            self._set(key, **{"orientation" if key == "$ORI_TYPE" else "circle": name})

    def _load(self, key: str, value: Any) -> None:  # noqa: ANN401
        """Take a load of the program's own; one component of it makes the rest no known load."""
        mass: Any = component(value, "M") if key == "$LOAD" else UNKNOWN
        mass = float(mass) if _is_number(mass) else math.nan
        self._set("$LOAD", load_number=-1, load_mass=mass)

    def read(self, key: str) -> Any:  # noqa: ANN401
        """Return a system variable of the motion state, ``UNKNOWN`` for any other."""
        if key in NUMBERS:
            return getattr(self.values, NUMBERS[key])
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
        return pose_of(frames[key]()) if key in frames else UNKNOWN

    # ------------------------------------------------------------------------------------------ BAS

    def bas(self, command: str, argument: Any, active: Mapping[str, Any]) -> bool:  # noqa: ANN401
        """Run ``BAS(#command, argument)``; False if the command is not known.

        Args:
            command: without ``#``, upper case.
            argument: second argument, ``UNKNOWN`` if not known.
            active: FDAT_ACT, PDAT_ACT and LDAT_ACT as far as they are set.
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
        elif command in ("PTP_PARAMS", "CP_PARAMS"):
            point_to_point = command == "PTP_PARAMS"
            self.motion_data(active.get("PDAT_ACT" if point_to_point else "LDAT_ACT", UNKNOWN))
            self.frame_data(active.get("FDAT_ACT", UNKNOWN))
            self._speed("VEL_PTP" if point_to_point else "VEL_CP", argument)
        elif command in ("PTP_DAT", "CP_DAT"):
            name = "PDAT_ACT" if command == "PTP_DAT" else "LDAT_ACT"
            self.motion_data(active.get(name, UNKNOWN))
        elif command == "FRAMES":
            self.frame_data(active.get("FDAT_ACT", UNKNOWN))
        else:
            return False
        return True

    def _reset(self) -> None:
        kept = self.values.done & {STOPMESS}
        self.values = replace(
            Values(self.values.tool, self._base_row(np.eye(4))),
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
        if not _is_number(value):
            self._unknown(f"BAS(#{command})")
        elif command == "ACC_CP" and not value > 0:
            self._refused(f"BAS(#{command})", value)
        elif command == "VEL_CP":
            self._set("$VEL.CP", speed=min(float(value), DEFAULT_SPEED))
        elif command == "VEL_PTP":
            self._set("$VEL_AXIS", ptp=(float(value),) * 6)
        elif command == "ACC_PTP":
            self._set("$ACC_AXIS", ramp=(float(value),) * 6)
        else:
            self._set("$ACC.CP", acceleration=DEFAULT_ACCELERATION * PERCENT * float(value))

    def frame_data(self, fdat: Any) -> None:  # noqa: ANN401
        """Take tool, base and interpolation mode of a FDAT."""
        if not isinstance(fdat, Aggregate):
            self.missing.append("the frame data (FDAT) of the motion are not known")
            return
        self.select_tool(component(fdat, "TOOL_NO"))
        self.select_load(component(fdat, "TOOL_NO"))
        self.select_base(component(fdat, "BASE_NO"))
        self._mode("$IPO_MODE", component(fdat, "IPO_FRAME"))

    def motion_data(self, data: Any) -> None:  # noqa: ANN401
        """Take acceleration and approximation of a PDAT or LDAT."""
        if not isinstance(data, Aggregate):
            self.unjudged.append(("PDAT", "the motion data (PDAT, LDAT) are not known"))
            return
        distance, mode = component(data, "APO_DIST"), component(data, "APO_MODE")
        is_ptp = component(data, "ORI_TYP") is UNKNOWN and component(data, "AXIS_VEL") is UNKNOWN
        if _is_number(distance):
            in_percent = is_ptp and not (isinstance(mode, Enum) and mode.name.upper() == "CDIS")
            if in_percent:
                self._set("$APO.CPTP", cptp=distance)
            else:
                self._set("$APO.CDIS", cdis=distance)
        for name, key in (("ORI_TYP", "$ORI_TYPE"), ("CIRC_TYP", "$CIRC_TYPE")):
            if component(data, name) is not UNKNOWN:
                self._mode(key, component(data, name))


def _is_number(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, int | float) and not isinstance(value, bool)


NUMBERS = {
    "$VEL.CP": "speed",
    "$VEL.ORI1": "swivel",
    "$VEL.ORI2": "rotation",
    "$ACC.CP": "acceleration",
    "$APO.CDIS": "cdis",
    "$APO.CPTP": "cptp",
    "$APO.CVEL": "cvel",
    "$APO.CORI": "cori",
    "$ADVANCE": "advance",
}
"""System variables that are one number, by their canonical names."""
_MOST = {
    "$ADVANCE": MOST_ADVANCE,
    "$APO.CPTP": 100.0,
    "$APO.CVEL": 100.0,
    "$VEL.ORI1": MOST_ORIENTATION_SPEED,
    "$VEL.ORI2": MOST_ORIENTATION_SPEED,
}
"""The controller takes no more."""
_RATES = ("$VEL.ORI", "$ACC.")
_MODES = {
    "$ORI_TYPE": ("VAR", "CONSTANT", "JOINT"),
    "$CIRC_TYPE": ("BASE", "PATH"),
    "$IPO_MODE": ("BASE", "TCP"),
}
_RAMPS = frozenset({"$ACC.ORI1", "$ACC.ORI2"})
_INDEXED_RAMPS = ("$ACC_EXTAX[", "$VEL_EXTAX[", "$GEAR_JERK", "$JERK")
"""How fast speeds are reached, within what the controller allows: they move no point."""
INITMOV = "BAS(#INITMOV)"
STOPMESS = "INTERRUPT 3"
"""The delivered interrupt that stops the program with the robot, declared and switched on."""
_STRUCTURES = frozenset({"$VEL", "$ACC", "$APO"})
