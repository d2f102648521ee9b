"""One block after the other, in the order of RS274: feed, speed, tool, spindle, motion, stop."""

from __future__ import annotations

from dataclasses import replace
from math import isnan, nan

import numpy as np

from postproc.arrays import FloatArray
from postproc.model import CamSetup, CamTool, EventKind, MotionKind, WordClass
from postproc.readers.gcode.arcs import PLANES, ArcWords, arc_of
from postproc.readers.gcode.codes import CYCLES, GROUP_OF, HARMLESS, is_executed, refusal
from postproc.readers.gcode.cycles import drill, seconds
from postproc.readers.gcode.state import Drill, Machine
from postproc.units import RPM

_LENGTHS = "XYZIJKR"
_HOLE_LENGTHS = "XYZRQ"
"""K counts there."""
_AXES = "XYZ"
_ROTARY = "ABCUVW"
_KNOWN = frozenset("GMNOXYZIJKRQFSTPLHD" + _ROTARY)
_MOST_TURNS = 1000
_REFERENCE = ("G28", "G30", "G53")
_PLAIN = {"G0": MotionKind.RAPID, "G1": MotionKind.LINEAR}
_SPINDLE = {"M3": 1.0, "M4": -1.0, "M5": 0.0}
_COOLANT = {"M7": "MIST", "M8": "FLOOD"}
_STOPS = {"M0": EventKind.STOP, "M1": EventKind.OPTIONAL_STOP}


def execute(machine: Machine) -> None:
    """Carry out the block at hand."""
    codes = [word.code for word in machine.block.words if word.letter in "GM"]
    values = _values(machine)
    _refuse(machine, codes, values)
    _modes(machine, codes)
    said = _in_metres(machine, values)
    _turn(machine, codes, values)
    _technology(machine, codes, said)
    if "G4" in codes:
        _dwell(machine, values)
    else:
        _motion(machine, codes, said)
    for code in codes:
        if code in _STOPS:
            machine.event(_STOPS[code])
        machine.ended |= code in ("M2", "M30")


def _values(machine: Machine) -> dict[str, float]:
    """Return the number of each letter but G, M, N and O."""
    values: dict[str, float] = {}
    for word in machine.block.words:
        if word.letter in "GMNO":
            continue
        if word.letter in values:
            raise machine.error("GCD003", f"{word.letter} appears twice in a block")
        if word.letter in _AXES and word.whole and word.value != 0.0:
            text = "lengths without a decimal point are whole units; some controls read thousandths"
            machine.warn("GCD102", text)
        values[word.letter] = word.value
    return values


def _refuse(machine: Machine, codes: list[str], values: dict[str, float]) -> None:
    """Keep what is not carried out, so that no program is made of it."""
    for code in codes:
        if not is_executed(code) and code not in HARMLESS:
            why = refusal(code)
            if code == "G8" or (code == "G5" and not values.keys() & set("XYIJ")):
                continue  # look-ahead of the control
            machine.refuse(code, why.word_class, f"{code}: {why.reason}")
    if machine.block.skip:
        machine.refuse("/", WordClass.PROCESS, "a block that the operator may skip")
    for letter, value in values.items():
        if machine.head is not None and letter in machine.head.letters:
            continue
        if letter in _ROTARY and value != 0.0:
            text = f"{letter} turns or moves an axis of the machine tool; expected X, Y, Z along +z"
            hint = "[import] head or --head says what a head's rotary words turn"
            machine.refuse(letter, WordClass.COORDINATES, text, hint)
        elif letter not in _KNOWN:
            machine.refuse(letter, WordClass.UNKNOWN, "is in no table of words")


def _modes(machine: Machine, codes: list[str]) -> None:
    """Let codes hold; a motion code ends a series of holes."""
    found: dict[str, str] = {}
    units = machine.modes.units
    if "G80" in codes:
        machine.drill, machine.modes.motion = Drill(), ""
    for code in codes:
        group = GROUP_OF.get(code)
        if group is None:
            continue
        if found.setdefault(group, code) != code:
            raise machine.error("GCD004", f"{found[group]} and {code} in one block")
    for group, code in found.items():
        if group == "base":
            _base(machine, code)
        elif group == "motion":
            if code not in CYCLES:
                machine.drill = Drill()
            machine.modes.motion = code
        else:
            setattr(machine.modes, group, code)
    if units not in ("", machine.modes.units) and any(
        word.letter == "F" for word in machine.block.words
    ):
        text = "controls differ in which unit F has in the block that changes the unit"
        machine.refuse("F", WordClass.PROCESS, text)


def _base(machine: Machine, code: str) -> None:
    """Count from another setup on; where it lies only the cell or the control knows."""
    name = code
    if code == "G54.1":
        number = next((word.value for word in machine.block.words if word.letter == "P"), nan)
        name = f"G54.1 P{number:g}"
    known = [setup.name for setup in machine.setups]
    if name not in known:
        aliases = (str(len(known) + 1),)
        machine.setups.append(CamSetup(name, machine.line, aliases=aliases))
        known.append(name)
    if machine.base >= 0 and known.index(name) != machine.base:
        machine.position = np.full(3, nan)  # the same place has other coordinates
    machine.base = known.index(name)


def _in_metres(machine: Machine, values: dict[str, float]) -> dict[str, float]:
    """Return the words with lengths in metres."""
    said = {letter: value for letter, value in values.items() if letter not in _ROTARY}
    wanted = _HOLE_LENGTHS if machine.modes.motion in CYCLES else _LENGTHS
    lengths = [letter for letter in said if letter in wanted]
    if lengths and "G4" not in {word.code for word in machine.block.words}:
        scale = machine.scale()
        said |= {letter: said[letter] * scale for letter in lengths}
        if not machine.modes.distance and said.keys() & set(_AXES):
            machine.modes.distance = "G90"
            machine.warn("GCD105", "neither G90 nor G91: coordinates are read as absolute")
    return said


def _turn(machine: Machine, codes: list[str], values: dict[str, float]) -> None:
    """Take the words of the head; X, Y, Z have to be of the tip where it leans."""
    if machine.head is None:
        return
    for code in codes:
        if code in ("G43", "G43.4", "G49"):
            machine.of_tip = machine.head.of_tip or code == "G43.4"
    said = {letter: values[letter] for letter in machine.head.letters if letter in values}
    if any(code in _REFERENCE for code in codes):
        machine.turned |= dict.fromkeys(said, nan)
        return
    for letter, value in said.items():
        before = 0.0 if machine.absolute else machine.turned.get(letter, nan)
        machine.turned[letter] = before + value
    if said and machine.modes.motion in ("G2", "G3"):
        raise machine.error("GCD011", "an arc that turns the head")
    if machine.leans and not machine.of_tip:
        text = "the head leans without G43.4: whether X, Y, Z are of the tool tip is not said"
        hint = "where they are, say so: tip behind the axes of [import] head"
        machine.refuse("ABC", WordClass.COORDINATES, text, hint)


def _technology(machine: Machine, codes: list[str], said: dict[str, float]) -> None:
    """Take feed, speed, tool, spindle and coolant."""
    if "F" in said:
        if said["F"] <= 0.0 or isnan(said["F"]):
            raise machine.error("GCD014", f"a feed of {said['F']:g}")
        machine.feed = said["F"] * machine.scale()
    if "S" in said:
        _speed(machine, said["S"])
    if "T" in said:
        machine.selected = int(said["T"])
    if "M6" in codes:
        _change(machine)
    for code in codes:
        if code in _SPINDLE:
            _spindle(machine, _SPINDLE[code], said)
        elif code in _COOLANT:
            machine.event(EventKind.COOLANT_ON, 0.0, _COOLANT[code])
        elif code == "M9":
            machine.event(EventKind.COOLANT_OFF)


def _speed(machine: Machine, speed: float) -> None:
    if speed < 0.0:
        raise machine.error("GCD014", f"a spindle speed of {speed:g}")
    changed = machine.turning != 0.0 and speed * RPM != machine.speed
    machine.speed = speed * RPM
    if changed and not any(word.code in _SPINDLE for word in machine.block.words):
        value = machine.turning * machine.speed
        machine.event(EventKind.SPINDLE_ON, value, f"S{speed:g}")


def _spindle(machine: Machine, turning: float, said: dict[str, float]) -> None:
    if turning == 0.0 or machine.speed == 0.0:
        if machine.modes.motion in ("G1", "G2", "G3") and said.keys() & set(_AXES):
            text = "controls differ in whether the spindle stops before or behind the cut"
            machine.refuse("M5", WordClass.PROCESS, text)
        if machine.turning != 0.0:
            machine.event(EventKind.SPINDLE_OFF)
        machine.turning = 0.0
        return
    if isnan(machine.speed):
        raise machine.error("GCD014", "the spindle starts without a speed S")
    machine.turning = turning
    machine.event(EventKind.SPINDLE_ON, turning * machine.speed, f"M{3 if turning > 0 else 4}")


def _change(machine: Machine) -> None:
    """Change the tool; its length is the cell's."""
    if machine.selected < 0:
        raise machine.error("GCD015", "M6 without a tool T before it")
    numbers = [tool.number for tool in machine.tools]
    if machine.selected not in numbers:
        machine.tools.append(CamTool(machine.selected, line=machine.line))
        numbers.append(machine.selected)
    index = numbers.index(machine.selected)
    if index != machine.tool:
        machine.event(EventKind.TOOL_CHANGE, float(machine.selected))
    machine.tool, machine.turning = index, 0.0


def _dwell(machine: Machine, values: dict[str, float]) -> None:
    letters = [letter for letter in "PXU" if letter in values]
    if len(letters) != 1 or not values[letters[0]] >= 0.0:
        raise machine.error("GCD014", "G4 without its time P or X")
    time = seconds(machine, letters[0])
    if time > 0.0:
        machine.event(EventKind.DWELL, time)


# -------------------------------------------------------------------------------------- motions


def _motion(machine: Machine, codes: list[str], said: dict[str, float]) -> None:
    axes = [letter for letter in _AXES if letter in said]
    reference = next((code for code in codes if code in _REFERENCE), None)
    if reference is not None:
        _to_reference(machine, reference, said)
    elif machine.modes.motion in CYCLES:
        if "P" in said:
            said = {**said, "P": seconds(machine, "P")}
        drill(machine, said)
    elif axes or _turns_in_place(machine) or _is_arc(machine, said):
        _to_point(machine, said)


def _is_arc(machine: Machine, said: dict[str, float]) -> bool:
    return machine.modes.motion in ("G2", "G3") and bool(said.keys() & set("IJKR"))


def _turns_in_place(machine: Machine) -> bool:
    """Return whether a block turns the head where the tool stands."""
    return not np.isnan(machine.position).any() and _turns(machine)


def _turns(machine: Machine) -> bool:
    letters = machine.head.letters if machine.head else ""
    return any(word.letter in letters for word in machine.block.words)


def _target(machine: Machine, said: dict[str, float]) -> FloatArray:
    target = machine.position.copy()
    for axis, letter in enumerate(_AXES):
        if letter in said:
            target[axis] = said[letter] + (0.0 if machine.absolute else target[axis])
    return target


def _to_point(machine: Machine, said: dict[str, float]) -> None:
    mode = machine.modes.motion
    if mode not in ("G0", "G1", "G2", "G3"):
        raise machine.error("GCD016", "coordinates without G0, G1, G2 or G3")
    start, target = machine.position, _target(machine, said)
    machine.position = target
    if np.isnan(target).any():
        if mode != "G0":
            lost = ", ".join(_AXES[axis] for axis in np.flatnonzero(np.isnan(target)))
            raise machine.error("GCD010", f"a cut to a place whose {lost} is not known")
        return
    _rise(machine, target)
    exact = 0.0 if any(word.code == "G9" for word in machine.block.words) else nan
    if mode == "G0":
        machine.tag(MotionKind.RAPID, target, blend=exact)
        return
    feed = machine.path_feed()
    if mode == "G1":
        machine.tag(MotionKind.LINEAR, target, feed=feed, blend=exact)
        return
    if np.isnan(start).any():
        raise machine.error("GCD010", "an arc from a place that is not known")
    words = _arc_words(machine, said, start)
    ends = [target]
    if words.turns > 1 and start[PLANES[words.plane][2]] == target[PLANES[words.plane][2]]:
        ends = [start] * (words.turns - 1) + ends  # flat turns are full circles before the arc
        words = replace(words, turns=1)
    for end in ends:
        machine.arcs.append(arc_of(words, start, end, machine.faults))
        arc = len(machine.arcs) - 1
        machine.tag(MotionKind.ARC, end, feed=feed, arc=arc, blend=exact)


def _arc_words(machine: Machine, said: dict[str, float], start: FloatArray) -> ArcWords:
    """Return what a block says of its arc; centres are increments unless G90.1 holds."""
    plane = machine.modes.plane
    first, second, third = PLANES[plane]
    centre = np.full(3, nan)
    if {"IJK"[first], "IJK"[second]} & said.keys():
        for axis in (first, second):
            if machine.modes.centre == "G90.1":
                centre[axis] = said.get("IJK"[axis], nan)
            else:
                centre[axis] = start[axis] + said.get("IJK"[axis], 0.0)
    if "IJK"[third] in said and said["IJK"[third]] != 0.0:
        raise machine.error("GCD011", f"{'IJK'[third]} in an arc of {plane}")
    turns = int(said.get("P", 1.0))
    if not 1 <= turns <= _MOST_TURNS:
        raise machine.error("GCD011", f"an arc of {turns} turns")
    return ArcWords(
        plane, machine.modes.motion == "G2", centre, said.get("R", nan), turns, machine.line
    )


def _to_reference(machine: Machine, code: str, said: dict[str, float]) -> None:
    """Leave for a place of the machine tool: it is not driven, the robot has its own home."""
    text = f"{code} leads to a place of the machine tool and is not driven; the robot has its own"
    machine.warn("GCD101", text)
    moved = [axis for axis, letter in enumerate(_AXES) if letter in said]
    if code != "G53":
        through = _target(machine, said)
        if not np.isnan(through).any() and not np.array_equal(through, machine.position):
            _rise(machine, through)
            machine.tag(MotionKind.RAPID, through)
            machine.position = through
        moved = moved or ([] if _turns(machine) else [0, 1, 2])
    position = machine.position.copy()
    position[moved] = nan
    machine.position = position
    if 2 in moved:
        machine.homed_line = machine.line


def _rise(machine: Machine, target: FloatArray) -> None:
    """Draw the retract to a reference as far as the next point proves it: up to its height."""
    if machine.homed_line and machine.tags:
        last = machine.tags[-1].point.copy()
        if machine.tags[-1].kind is MotionKind.HOLE:
            last[2] += list(machine.cycles)[machine.tags[-1].cycle].retract
        if target[2] > last[2]:
            last[2] = target[2]
            turned, machine.turned = machine.turned, machine.turned_at_last
            machine.tag(MotionKind.RAPID, last, machine.homed_line)
            machine.turned = turned
    machine.homed_line = 0
