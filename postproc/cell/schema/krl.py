"""Keys of ``[krl]`` and ``[krl.hooks]``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Self, cast

from pydantic import ConfigDict, Field, model_validator

from postproc.cell.choices import HomeStyle, Kss, MotionStyle, PointPlace, Split
from postproc.cell.schema.table import NotNegative, Options, Table, Text, entry, key
from postproc.names import LETTERS
from postproc.records import dataclass

KrlName = Annotated[str, Field(pattern=LETTERS)]
Signal = Annotated[int, Field(ge=1, le=8192)]


class HooksTable(Table):
    """Routines that the integrator defines and programs call; names of process.hole too."""

    model_config = ConfigDict(extra="allow")

    @model_validator(mode="after")
    def _names(self) -> HooksTable:
        for name, routine in (self.model_extra or {}).items():
            if not isinstance(routine, str) or not re.fullmatch(LETTERS, routine):
                raise ValueError(f"{name}: expected the name of a routine, found {routine!r}")
        return self

    spindle_on: KrlName = entry(
        "PP_SPINDLE_ON", "gets the speed [1/min], negative counterclockwise"
    )
    spindle_off: KrlName = entry("PP_SPINDLE_OFF", "without parameter")
    coolant_on: KrlName = entry(
        "PP_COOLANT_ON", "gets 1 flood, 2 mist, 3 through the tool, 4 air, 5 tap, 6 to 8 custom"
    )
    coolant_off: KrlName = entry("PP_COOLANT_OFF", "without parameter")
    stop: KrlName = entry("PP_STOP", "stop of the CAM program")
    optional_stop: KrlName = entry("PP_OPTIONAL_STOP", "optional stop")
    tool_change: KrlName = entry("PP_TOOL_CHANGE", "gets the tool number")
    signal: KrlName = entry("PP_SIGNAL", "sets a signal; gets its name, port (0: none) and value")
    wait_signal: KrlName = entry(
        "PP_WAIT_SIGNAL", "waits for a signal; gets its name, port (0: none) and value"
    )
    spindle_orient: KrlName | None = entry(
        None,
        "stops the spindle at an angle at the bottom of a bore and returns when it "
        "stands there; gets the angle [deg]; default: none, such a bore is refused",
    )
    tap_reverse: KrlName | None = entry(
        None,
        "reverses the spindle at the bottom of a tapped hole and returns when it turns "
        "the other way; gets the speed [1/min], negative counterclockwise. Naming it says that the "
        "tap is in a floating holder; default: none, tapping is refused",
    )
    stops_advance: list[str] | None = entry(
        None,
        "keys of those routines whose lines stop the advance run before they do "
        "anything (WAIT, HALT, $OUT without CONTINUE); before the others a program gets "
        "WAIT SEC 0; default: no WAIT SEC 0, and those of which it is not known are named",
    )


@dataclass(frozen=True, slots=True)
class KrlOptions(Options):
    """How programs are written."""

    emitter: str = key("kuka_krl", "what writes the programs; see `postproc plugins`", form=Text)
    template: str = key(
        "default", "built-in template, or a folder relative to the cell file", form=Text
    )
    max_points_per_file: int = key(1000, "a longer program is split into sub-programs", ge=2)
    split: Split = key(Split.POINTS, "operations: each operation begins a sub-program")
    motion: MotionStyle = key(
        MotionStyle.DENSE,
        "dense: PTP, LIN, CIRC; spline: SPTP, SLIN, SCIRC; spline_block: the same in "
        "SPLINE blocks; forms: as dense, entries and approaches as inline forms",
    )
    home: HomeStyle = key(
        HomeStyle.AXES,
        "how home_deg is written: axes: its values; xhome: PTP XHOME; form: the pad's "
        "inline form, which selects tool 1. For both XHOME of the controller is home_deg",
    )
    points: PointPlace = key(
        PointPlace.INLINE, "dat: the points stand in the .dat file, to be touched up"
    )
    kss: Kss = key(
        Kss.V8_6,
        "system software of the controller: 5 (KRC2, no splines), 8.3 and 8.5 (forms "
        "with parameters in their line), 8.6 and 8.7 (in a fold of their own)",
    )
    advance: int = key(3, "$ADVANCE: motions planned ahead; 0 stops at every point", ge=0, le=5)
    orientation_speed: float = key(200.0, "$VEL.ORI1 and ORI2 [deg/s]", "deg_s", gt=0.0, le=400.0)
    path_speed_max: float = key(
        2.0, "largest path speed [m/s]: rapids are slowed, a feed is refused", "m_s", gt=0.0, le=3.0
    )
    block: float = key(
        12.0,
        "time that the controller needs to plan a motion ahead: points that follow "
        "each other faster are worth a warning [ms]",
        "ms",
        gt=0.0,
    )
    memory: float = key(
        4.0, "memory for programs: larger ones are worth a warning [MB]", "mb", gt=0.0
    )
    cam_lines: bool = key(True, "name the CAM line behind each motion")
    setup: bool = key(False, "write NAME_SETUP, which enters tool, base and load data")
    hooks_example: bool = key(False, "write PP_HOOKS, an example of the routines of krl.hooks")
    inertia: tuple[float, ...] | None = key(
        None,
        "principal inertia for LOAD_DATA of a cell with one tool [kg*m^2]",
        "kg_m2",
        form=Annotated[list[NotNegative], Field(min_length=3, max_length=3)],
    )
    outputs: Mapping[str, int] = key(
        {}, "signal of an OLP task to the number of its output: $OUT[n]", form=dict[str, Signal]
    )
    inputs: Mapping[str, int] = key(
        {}, "signal of an OLP task to the number of its input: $IN[n]", form=dict[str, Signal]
    )
    hooks: Mapping[str, str] = key({}, "routines that programs call", form=HooksTable)
    stops_advance: tuple[str, ...] | None = None
    """Keys of the hooks whose routines stop the advance run first; None: the cell does not say."""

    @property
    def is_spline(self) -> bool:
        """Whether all motions are the newer ones, which do not blend with the classic ones."""
        return self.motion in (MotionStyle.SPLINE, MotionStyle.SPLINE_BLOCK)

    def checked(self) -> Self:
        """Return the options; ValueError for motions that the controller does not have."""
        if self.is_spline and not self.kss.has_splines:
            raise ValueError(f"motion: {self.motion.value} needs KSS 8, found kss = {self.kss}")
        if self.is_spline and self.home is HomeStyle.FORM and not self.kss.has_parameter_folds:
            raise ValueError(f"home: form of an SPTP needs KSS 8.6, found kss = {self.kss}")
        table = cast("HooksTable", self.hooks)
        stops = None if table.stops_advance is None else tuple(table.stops_advance)
        hooks = table.model_dump(exclude={"stops_advance"}, exclude_none=True)
        return replace(self, hooks=hooks, stops_advance=stops)
