"""What is in force at the motions: is it set at all, is it what the cell stands for?

All that a controller takes from its own configuration where the program does not say it is asked
for, as far as a motion depends on it; a program that is right by luck is not right.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray
from postproc.cell import Cell, Tool
from postproc.controller import INITMOV, STOPMESS, Blend, MotionType, Settings
from postproc.errors import RunKind, Severity
from postproc.krl import Aggregate, Assign, initial_values, system_variable
from postproc.paths import SLOWEST
from postproc.units import DEG, MM, PERCENT
from postproc.verification.report import Remark, Said
from postproc.verification.run import Run

MOST_CORI = 5.0 * DEG
"""Largest $APO.CORI [rad]: that of a delivered controller."""
MOST_CDIS = 3.0 * MM
"""$APO.CDIS [m] of a delivered controller; a cell may wish for more."""
_ON_THE_SPOT = 1e-5
"""Motions of the tool point shorter than this [m] are turns: digits of the text."""
_SAME = 1e-3
"""Speeds and masses may differ by this share."""
PLANNED_CPTP = 100.0
"""$APO.CPTP [%] of our programs: joint motions are rounded as far as the controller can."""
_WHY = {
    INITMOV: "speeds, frames and modes are left over from the program before",
    STOPMESS: "a stop of the robot does not stop the program",
    "$TOOL": "it counts from whatever tool was last in force",
    "$BASE": "it counts from $WORLD or the base before",
    "$LOAD": "the controller moves with the load before",
    "$VEL.CP": "it runs at the speed that the controller is configured for",
    "$APO.CDIS": "it is blended as far as the controller is configured for",
    "$CIRC_TYPE": "the tool turns on the arc as the controller is configured",
}


def check_settings(run: Run) -> Iterator[Said]:
    """Check what is in force at every motion, and the load data that the program enters."""
    trace = run.paths.trace
    for row, settings in enumerate(trace.settings):
        motions = np.flatnonzero(trace.setting == row)
        if len(motions):
            yield from (Remark(*fault) for fault in _faults(run, settings, motions))
    yield from _turns_too_slowly(run)
    yield from _unset(run)
    yield from _load_data(run)


def check_rapids(run: Run) -> Iterator[Said]:
    """Check that path motions that do not cut are no faster than the rapids of the cell."""
    trace, cell = run.paths.trace, run.cell
    if not run.has_file:
        return
    speed = trace.column("speed")
    most = min(cell.motion.rapid_speed, cell.krl.path_speed_max)
    bad = np.flatnonzero(trace.is_cp & ~run.is_cut & (speed > most * (1.0 + _SAME)))
    if len(bad):
        text = f"a rapid of {speed[bad[0]]:g} m/s, the cell allows {most:g}, {len(bad)} motions"
        yield Remark(RunKind.SPEED, int(bad[0]), text)


def _faults(
    run: Run, settings: Settings, motions: AnyIntArray
) -> Iterator[tuple[RunKind, int, str]]:
    """Yield kind, first motion and words of what is wrong with settings that motions run with."""
    trace, cell = run.paths.trace, run.cell
    is_cp = trace.is_cp[motions]
    first = int(motions[0])
    if settings.system["$IPO_MODE"] == "TCP" and not trace.is_axes[motions].all():
        yield RunKind.FRAME, first, "$IPO_MODE is #TCP: the tool would stand and the part move"
    yield from _orientation(run, settings, motions)
    tool = cell.tools[run.paths.station.tool[first]]
    if not _has_load(tool, settings):
        yield RunKind.LOAD, first, f"the load in force is not that of tool {tool.number}"
    if settings.cori > MOST_CORI * (1.0 + _SAME):
        text = f"$APO.CORI is {settings.cori / DEG:g} deg, expected at most {MOST_CORI / DEG:g}"
        yield RunKind.SETUP, first, text
    most = max(cell.motion.approximation, MOST_CDIS)
    blended = motions[trace.blend[motions] == Blend.DISTANCE]
    if len(blended) and settings.cdis > most * (1.0 + _SAME):
        text = f"$APO.CDIS is {settings.cdis / MM:g} mm, the cell asks for {most / MM:g} at most"
        yield RunKind.SETUP, int(blended[0]), text
    if len(blended) and settings.cdis == 0.0:
        text = f"C_DIS with $APO.CDIS 0: an exact stop at each of {len(blended)} points"
        yield RunKind.SETUP, int(blended[0]), text
    if settings.advance == 0 and cell.krl.advance > 0 and is_cp.any():
        text = f"$ADVANCE is 0: an exact stop at every point, the cell has {cell.krl.advance}"
        yield RunKind.SETUP, first, text
    yield from _others(run, settings, first)
    yield from _shares(cell, settings, first, is_joint=not is_cp.all())
    top = cell.krl.path_speed_max
    if "$VEL.CP" in settings.done and settings.speed > top * (1.0 + _SAME):
        text = f"a path speed of {settings.speed:g} m/s, the cell allows {top:g}"
        yield RunKind.SPEED, first, text


def _orientation(
    run: Run, settings: Settings, motions: AnyIntArray
) -> Iterator[tuple[RunKind, int, str]]:
    trace = run.paths.trace
    moving = motions[run.paths.curves.length[motions] > 0.0]
    paths = moving[trace.is_cp[moving]]
    kind = settings.system["$ORI_TYPE"]
    if kind in ("JOINT", "IGNORE") and len(paths):
        text = f"$ORI_TYPE is #{kind}: the hand turns by its axes, the tool axis leaves the path"
        yield RunKind.ORIENTATION, int(paths[0]), text
    arcs = paths[trace.motion_type[paths] == MotionType.CIRC]
    if settings.system["$CIRC_TYPE"] != "BASE" and len(arcs):
        text = "$CIRC_TYPE is #PATH: the tool turns with the arc, which is not checked"
        yield RunKind.ORIENTATION, int(arcs[0]), text


def _others(run: Run, settings: Settings, motion: int) -> Iterator[tuple[RunKind, int, str]]:
    """Yield the first setting that is neither as every plan counts with nor the cell's."""
    initial = {k: float(v) for k, v in initial_values().items() if isinstance(v, float | int)}
    delivered = [name for name in initial if name.startswith(("$ACC", "$APO.CVEL"))]
    counts = {name: [initial[name]] for name in delivered}
    if run.has_file:
        counts["$APO.CPTP"] = [initial["$APO.CPTP"], PLANNED_CPTP]
        counts["$ADVANCE"] = [initial["$ADVANCE"], float(run.cell.krl.advance)]
    for name, value in sorted(settings.system.items()):
        expected, variable = counts.get(name), system_variable(name)
        if not expected or variable is None or variable.name in run.cell.accept:
            continue
        if not isinstance(value, str) and any(
            math.isclose(value, known, rel_tol=_SAME) for known in expected
        ):
            continue
        unit, least = f" {variable.unit}".rstrip(), expected[-1]
        is_ramp = name.startswith("$ACC")
        why = "speeds are reached later than planned, or harder" if is_ramp else "the plan has not"
        text = f"{name} is {value}{unit}, expected {least:g} as delivered: {why}"
        yield RunKind.SPEED if is_ramp else RunKind.SETUP, motion, text
        return


def _turns_too_slowly(run: Run) -> Iterator[Said]:
    """Report paths that turn at another speed than the cell's, unless turn or axes set the time."""
    trace, curves, cell = run.paths.trace, run.paths.curves, run.cell
    asked = cell.krl.orientation_speed
    own = [dict(settings.system) for settings in trace.settings]
    ends = [(float(v["$VEL.ORI1"]) * DEG, float(v["$VEL.ORI2"]) * DEG) for v in own] or [(0.0, 0.0)]
    slow, fast = np.sort(np.array(ends), axis=1).T[:, trace.setting]
    way = curves.length / np.maximum(trace.column("speed"), SLOWEST)
    stands = curves.length * slow < SLOWEST * curves.angle
    is_turn = (curves.angle / asked >= way) | (curves.length < _ON_THE_SPOT) | stands
    bad = trace.is_cp & ((fast > asked * (1.0 + _SAME)) | (slow < asked * (1.0 - _SAME)) & ~is_turn)
    rows = np.flatnonzero(bad)
    if len(rows) and "$VEL.ORI1" not in cell.accept:
        low, high = slow[rows[0]] / DEG, fast[rows[0]] / DEG
        text = f"$VEL.ORI1 and ORI2 are {low:g} and {high:g} deg/s, the cell has {asked / DEG:g}"
        yield Remark(RunKind.SPEED, int(rows[0]), f"{text}, {len(rows)} motions")


def _has_load(tool: Tool, settings: Settings) -> bool:
    used = settings.tool_number if settings.tool_number >= 0 else tool.number
    if settings.load_number == used:
        return True
    return _is_mass(tool, settings.load_mass)


def _is_mass(tool: Tool, mass: float) -> bool:
    return math.isfinite(mass) and math.isclose(mass, tool.mass, rel_tol=_SAME, abs_tol=1e-6)


def _may_be_mass(tool: Tool, mass: float) -> bool:
    """Return whether a load is the tool's, not measured (below 0), or nothing tells."""
    return mass < 0.0 or math.isnan(tool.mass) or _is_mass(tool, mass)


def _shares(
    cell: Cell, settings: Settings, motion: int, *, is_joint: bool
) -> Iterator[tuple[RunKind, int, str]]:
    for name, shares in (("VEL", settings.ptp), ("ACC", settings.ramp)):
        low, high = min(shares) / PERCENT, max(shares) / PERCENT
        if high - low > _SAME * high:
            text = f"${name}_AXIS goes from {low:g} to {high:g} %: the slowest axis sets the speed"
            yield RunKind.SPEED, motion, text
    if is_joint and not min(*settings.ptp, *settings.ramp) > 0.0:
        yield RunKind.SPEED, motion, "joint motions at 0 %: the arm does not move"
    if is_joint and max(settings.ptp) > cell.motion.rapid * (1.0 + _SAME):
        allowed = cell.motion.rapid / PERCENT
        text = f"joint motions at {max(settings.ptp) / PERCENT:g} %, the cell allows {allowed:g}"
        yield RunKind.SPEED, motion, text


def _unset(run: Run) -> Iterator[Said]:
    """Report what motions depend on and the program has not set: the first of each."""
    trace = run.paths.trace
    if not len(trace):
        return
    cartesian = ~trace.is_axes
    blended = (trace.blend == Blend.DISTANCE) & (trace.is_cp | np.r_[trace.is_cp[1:], False])
    every = np.ones(len(trace), dtype=np.bool_)
    needs: tuple[tuple[str, BoolArray], ...] = (
        (INITMOV, every),
        (STOPMESS, every),
        ("$TOOL", cartesian),
        ("$BASE", cartesian),
        ("$LOAD", every),
        ("$VEL.CP", trace.is_cp),
        ("$APO.CDIS", blended),
        ("$CIRC_TYPE", trace.motion_type == MotionType.CIRC),
    )
    for name, rows in needs:
        lacks = np.array([name not in settings.done for settings in trace.settings])
        bad = np.flatnonzero(rows & lacks[trace.setting])
        if len(bad):
            text = f"a motion before {name} is set: {_WHY[name]}"
            yield Remark(RunKind.SETUP, int(bad[0]), text)


def _load_data(run: Run) -> Iterator[Said]:
    """Check the load data that the program or its set-up enters for the tools of the cell."""
    tools = {f"LOAD_DATA[{tool.number}]": tool for tool in run.cell.tools}
    for module in run.modules:
        of_module = (s for routine in module.routines for s in routine.statements)
        for statement in [s for s in of_module if type(s) is Assign and s.target[:1] != "$"]:
            name = statement.target.upper().partition("]")[0] + "]"
            if name not in tools:
                continue
            mass = statement.value.get("M") if isinstance(statement.value, Aggregate) else None
            if isinstance(mass, float | int) and _may_be_mass(tools[name], float(mass)):
                continue
            place = (module.src_path, statement.line)
            text = f"{name} is not the mass of the tool of the cell"
            yield Remark(RunKind.LOAD, place, text, Severity.ERROR)
