"""The arm as ``$machine.dat`` describes it: lengths, soft limits, speeds, root."""

from __future__ import annotations

import math

from postproc.arrays import TINY
from postproc.backup.variables import FRAME, Variables, rated_speed
from postproc.cell import same_type
from postproc.errors import ReadError
from postproc.records import dataclass

AXES = range(1, 7)
_DYNAMICS = {12: "c1", 13: "a1", 14: "c2", 15: "a2", 17: "c3", 18: "c4"}
"""Index of $DYN_DAT with a second copy of a length; that of a2 has the other sign."""
SAME_LENGTH_MM = 0.1
"""Lengths of two arms that are no farther apart are those of one."""


@dataclass(frozen=True, slots=True)
class Machine:
    """One arm.

    Args:
        trafoname: $TRAFONAME.
        lengths_mm: a1, a2, b, c1, c2, c3, c4.
        limits_deg: soft limits of A1..A6, None where not given or equal.
        speed_deg_s: of A1..A6, None if one is not known.
        root: X Y Z A B C of $ROBROOT [mm, deg].
        payload_kg: $DEF_L_M, None where not given.
        notes: what a person should know.
    """

    trafoname: str
    lengths_mm: tuple[float, ...]
    limits_deg: tuple[tuple[float, float] | None, ...]
    speed_deg_s: tuple[float, ...] | None
    root: tuple[float, ...]
    payload_kg: float | None
    notes: tuple[str, ...]


def machine_of(data: Variables, robcor: Variables | None) -> Machine:
    """Return the arm of machine data; BAK007 if it is no six-axis arm with a central hand."""
    _require_six_axis_arm(data)
    lengths = _lengths(data)
    notes = []
    root = data.parts("$ROBROOT", FRAME)
    if root is None:
        notes.append("no $ROBROOT: the robot root is taken to be at the world origin")
    speeds = [rated_speed(data, axis, 360.0) for axis in AXES]
    if None in speeds:
        notes.append("no $RAT_MOT_AX or $VEL_AXIS_MA: axis speeds are not known from the files")
    payload = robcor.number("$DEF_L_M") if robcor else None
    mixed = _mixed(data, robcor, lengths) if robcor else ""
    if mixed:
        notes.append(mixed)
    return Machine(
        trafoname=data.text("$TRAFONAME"),
        lengths_mm=lengths,
        limits_deg=tuple(_limits(data, axis) for axis in AXES),
        speed_deg_s=tuple(s for s in speeds if s is not None) if None not in speeds else None,
        root=tuple(root or [0.0] * 6),
        payload_kg=payload if payload is not None and payload > 0.0 and not mixed else None,
        notes=tuple(notes),
    )


def _require_six_axis_arm(data: Variables) -> None:
    wanted = {"$MAIN_AXIS": "#NR", "$WRIST_AXIS": "#ZEH", "$KINCLASS": "#STANDARD"}
    for name, word in wanted.items():
        found = data.get(name)
        if found is not None and found != word:
            raise _no_arm(data, name, f"{name} is {found}, expected {word}")
    axes = data.number("$TRAFO_AXIS")
    if axes is not None and axes != len(AXES):
        raise _no_arm(data, "$TRAFO_AXIS", f"$TRAFO_AXIS is {axes:g}, expected 6")
    for name in ("$DEF_A4FIX", "$DEF_A5LINK", "$A4PAR", "$SPINDLE"):
        if data.get(name) not in (None, False, 0, "FALSE"):
            raise _no_arm(data, name, f"{name} is set: not an arm with a free spherical wrist")
    if any(data.number("$AXIS_DIR", axis) == 0.0 for axis in AXES):
        raise _no_arm(data, "$AXIS_DIR", "$AXIS_DIR is 0 for one of A1 to A6: no six-axis arm")


def _no_arm(data: Variables, name: str, text: str) -> ReadError:
    hint = "only six-axis arms with a spherical wrist are read from backups; give a URDF for others"
    return ReadError("BAK007", text, data.source(name), hint)


def _lengths(data: Variables) -> tuple[float, ...]:
    """Return a1, a2, b, c1, c2, c3, c4 [mm]; frames of the transformation must be plain."""
    frames = {name: data.parts(name, FRAME) for name in ("$TIRORO", "$TX3P3", "$TFLWP")}
    a1, c2 = data.number("$LENGTH_A"), data.number("$LENGTH_B")
    missing = [name for name, frame in frames.items() if frame is None]
    missing += [name for name, v in (("$LENGTH_A", a1), ("$LENGTH_B", c2)) if v is None]
    if missing:
        text = f"{', '.join(missing)} is missing or no number: the lengths of the arm are not known"
        raise ReadError("BAK007", text, data.source("$TRAFONAME"))
    root, elbow, flange = (frame or [0.0] * 6 for frame in frames.values())
    plain = [*root[:2], *root[3:], elbow[1], elbow[3], elbow[5], *flange[:2], *flange[3:]]
    if max(map(abs, plain)) > TINY or abs(elbow[4] - 90.0) > TINY:
        text = "$TIRORO, $TX3P3 or $TFLWP turn or shift sideways: no plain six-axis arm"
        raise _no_arm(data, "$TX3P3", text)
    lengths = (a1 or 0.0, -elbow[2] + 0.0, 0.0, root[2], c2 or 0.0, elbow[0], flange[2])
    if max(map(abs, lengths)) > 1e4 or lengths[4] <= 0.0 or math.hypot(elbow[0], elbow[2]) < 1.0:
        raise _no_arm(data, "$LENGTH_B", "the lengths are those of no arm")
    return lengths


def _limits(data: Variables, axis: int) -> tuple[float, float] | None:
    low, high = data.number("$SOFTN_END", axis), data.number("$SOFTP_END", axis)
    if low is None or high is None or not -720.0 <= low < high <= 720.0:
        return None
    return low, high


def _mixed(data: Variables, robcor: Variables, lengths: tuple[float, ...]) -> str:
    """Return words on dynamics of another robot than the machine data, empty where they agree."""
    own, other = data.text("$TRAFONAME"), robcor.text("$MODEL_NAME")
    a1, a2, _, c1, c2, c3, c4 = lengths
    wanted = {"c1": c1, "a1": a1, "c2": c2, "a2": -a2, "c3": c3, "c4": c4}
    copies = {key: robcor.number("$DYN_DAT", index) for index, key in _DYNAMICS.items()}
    wrong = [
        f"{key} {wanted[key]:g} and {copy:g} mm"
        for key, copy in copies.items()
        if copy is not None and abs(copy - wanted[key]) > SAME_LENGTH_MM
    ]
    if (other and own and not same_type(own, other)) or (wrong and any(copies.values())):
        lengths_differ = f"; lengths differ: {', '.join(wrong)}" if wrong else ""
        return (
            f"$machine.dat is of {own or 'an unnamed robot'}, $robcor.dat of "
            f"{other or 'another one'}{lengths_differ}: the files come from two robots, check the "
            "type plate of the arm"
        )
    return ""
