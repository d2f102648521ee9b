"""Keys of ``[krl]`` and ``[krl.hooks]``."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import ConfigDict, Field, model_validator

from postproc.cell.choices import HomeStyle, Kss, MotionStyle, PointPlace, Split
from postproc.cell.schema.table import CHOICE, EMPTY, NotNegative, Positive, Table, Text
from postproc.names import LETTERS

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

    spindle_on: KrlName = Field(
        default="PP_SPINDLE_ON", description="gets the speed [1/min], negative counterclockwise"
    )
    spindle_off: KrlName = Field(default="PP_SPINDLE_OFF", description="without parameter")
    coolant_on: KrlName = Field(
        default="PP_COOLANT_ON",
        description="gets 1 flood, 2 mist, 3 through the tool, 4 air, 5 tap, 6 to 8 custom",
    )
    coolant_off: KrlName = Field(default="PP_COOLANT_OFF", description="without parameter")
    stop: KrlName = Field(default="PP_STOP", description="stop of the CAM program")
    optional_stop: KrlName = Field(default="PP_OPTIONAL_STOP", description="optional stop")
    tool_change: KrlName = Field(default="PP_TOOL_CHANGE", description="gets the tool number")
    signal: KrlName = Field(
        default="PP_SIGNAL", description="sets a signal; gets its name, port (0: none) and value"
    )
    wait_signal: KrlName = Field(
        default="PP_WAIT_SIGNAL",
        description="waits for a signal; gets its name, port (0: none) and value",
    )
    spindle_orient: KrlName | None = Field(
        default=None,
        description="stops the spindle at an angle at the bottom of a bore and returns when it "
        "stands there; gets the angle [deg]; default: none, such a bore is refused",
    )
    tap_reverse: KrlName | None = Field(
        default=None,
        description="reverses the spindle at the bottom of a tapped hole and returns when it turns "
        "the other way; gets the speed [1/min], negative counterclockwise. Naming it says that the "
        "tap is in a floating holder; default: none, tapping is refused",
    )
    stops_advance: list[str] | None = Field(
        default=None,
        description="keys of those routines whose lines stop the advance run before they do "
        "anything (WAIT, HALT, $OUT without CONTINUE); before the others a program gets "
        "WAIT SEC 0; default: no WAIT SEC 0, and those of which it is not known are named",
    )


class KrlTable(Table):
    """How programs are written."""

    emitter: Text = Field(
        default="kuka_krl", description="what writes them; see `postproc plugins`"
    )
    template: Text = Field(
        default="default", description="built-in template, or a folder relative to the cell file"
    )
    max_points_per_file: Annotated[int, Field(ge=2)] = Field(
        default=1000, description="a longer program is split into sub-programs"
    )
    split: Annotated[Split, CHOICE] = Field(
        default=Split.POINTS, description="operations: each operation begins a sub-program"
    )
    motion: Annotated[MotionStyle, CHOICE] = Field(
        default=MotionStyle.DENSE,
        description="dense: PTP, LIN, CIRC; spline: SPTP, SLIN, SCIRC; spline_block: the same in "
        "SPLINE blocks; forms: as dense, entries and approaches as inline forms",
    )
    home: Annotated[HomeStyle, CHOICE] = Field(
        default=HomeStyle.AXES,
        description="how home_deg is written: axes: its values; xhome: PTP XHOME; form: the pad's "
        "inline form, which selects tool 1. For both XHOME of the controller is home_deg",
    )
    points: Annotated[PointPlace, CHOICE] = Field(
        default=PointPlace.INLINE,
        description="dat: the points stand in the .dat file, to be touched up",
    )
    kss: Annotated[Kss, CHOICE] = Field(
        default=Kss.V8_6,
        description="system software of the controller: 5 (KRC2, no splines), 8.3 and 8.5 (forms "
        "with parameters in their line), 8.6 and 8.7 (in a fold of their own)",
    )
    advance: Annotated[int, Field(ge=0, le=5)] = Field(
        default=3, description="$ADVANCE: motions planned ahead; 0 stops at every point"
    )
    orientation_speed_deg_s: Annotated[float, Field(gt=0.0, le=400.0)] = Field(
        default=200.0, description="$VEL.ORI1 and ORI2 [deg/s]"
    )
    path_speed_max_m_s: Annotated[float, Field(gt=0.0, le=3.0)] = Field(
        default=2.0, description="largest path speed [m/s]: rapids are slowed, a feed is refused"
    )
    block_ms: Positive = Field(
        default=12.0,
        description="time that the controller needs to plan a motion ahead: points that follow "
        "each other faster are worth a warning [ms]",
    )
    memory_mb: Positive = Field(
        default=4.0, description="memory for programs: larger ones are worth a warning [MB]"
    )
    cam_lines: bool = Field(default=True, description="name the CAM line behind each motion")
    setup: bool = Field(
        default=False, description="write NAME_SETUP, which enters tool, base and load data"
    )
    hooks_example: bool = Field(
        default=False, description="write PP_HOOKS, an example of the routines of krl.hooks"
    )
    inertia_kg_m2: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] | None = Field(
        default=None,
        description="principal inertia for LOAD_DATA of a cell with one tool [kg*m^2]",
    )
    outputs: dict[str, Signal] = Field(
        default=EMPTY, description="signal of an OLP task to the number of its output: $OUT[n]"
    )
    inputs: dict[str, Signal] = Field(
        default=EMPTY, description="signal of an OLP task to the number of its input: $IN[n]"
    )
    hooks: HooksTable = Field(default=EMPTY, description="routines that programs call")

    @model_validator(mode="after")
    def _motions_of_kss(self) -> KrlTable:
        is_spline = self.motion in (MotionStyle.SPLINE, MotionStyle.SPLINE_BLOCK)
        if is_spline and not self.kss.has_splines:
            raise ValueError(f"motion: {self.motion.value} needs KSS 8, found kss = {self.kss}")
        if is_spline and self.home is HomeStyle.FORM and not self.kss.has_parameter_folds:
            raise ValueError(f"home: form of an SPTP needs KSS 8.6, found kss = {self.kss}")
        return self
