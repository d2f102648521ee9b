"""Drill cycles G73, G74 and G81 to G89: their words to a ``Cycle`` of the model.

The tag of a hole stands at its R level, where the feed starts; where the part's surface is the file
does not say.
"""

from __future__ import annotations

from math import isnan, nan

import numpy as np

from postproc.model import Cycle, CycleKind, MotionKind
from postproc.readers.gcode.state import Drill, Machine
from postproc.units import MM, MS

KINDS = {
    "G73": CycleKind.BRKCHP, "G74": CycleKind.TAP_LEFT, "G81": CycleKind.DRILL,
    "G82": CycleKind.FACE, "G83": CycleKind.DEEP, "G84": CycleKind.TAP, "G85": CycleKind.REAM,
    "G86": CycleKind.BORE_RAPID, "G89": CycleKind.REAM,
}  # fmt: skip
_PECKING = (CycleKind.DEEP, CycleKind.BRKCHP)
_MOST_REPEATS = 10_000


def drill(machine: Machine, said: dict[str, float]) -> None:
    """Make the holes of the block at hand under a drill cycle.

    ``said``: its words in units of the file but for X, Y, Z, R and Q, which are in metres.
    """
    mode = machine.modes
    if mode.plane != "G17":
        raise machine.error("GCD012", "a drill cycle outside of G17")
    if machine.leans:
        raise machine.error("GCD012", "a drill cycle along z while the head is tilted")
    if isnan(machine.drill.initial):
        machine.drill = Drill(float(machine.position[2]))
        if not mode.retract:
            text = "neither G98 nor G99: the tool goes back to the level it came from, as with G98"
            machine.warn("GCD103", text)
    holds = machine.drill.words
    holds |= {letter: said[letter] for letter in "ZRQPF" if letter in said}
    repeats = int(said.get("K", said.get("L", 1.0)))
    if not {"X", "Y", "Z", "R"} & said.keys() or repeats == 0:
        return
    if repeats < 0 or repeats > _MOST_REPEATS or (repeats > 1 and machine.absolute):
        raise machine.error("GCD012", f"{repeats} times one hole, expected one or, with G91, steps")
    level, bottom = _levels(machine)
    cycle = machine.cycles.setdefault(_cycle(machine, level - bottom), len(machine.cycles))
    ahead = np.array([said.get("X", nan), said.get("Y", nan)])
    for _ in range(repeats):
        place = machine.position[:2]
        step = place + np.nan_to_num(ahead)
        place = np.where(np.isnan(ahead), place, ahead) if machine.absolute else step
        if np.isnan(place).any():
            raise machine.error("GCD010", "a hole whose X or Y is not known")
        point = np.array([*place, level])
        feed = machine.path_feed()
        machine.tag(MotionKind.HOLE, point, cycle=cycle, feed=feed)
        up = max(machine.drill.initial, level) if mode.retract != "G99" else level
        machine.position = np.array([*place, up])


def _levels(machine: Machine) -> tuple[float, float]:
    """Return where the feed starts and where the hole ends, along z [m]."""
    holds, start = machine.drill.words, machine.drill.initial
    level, bottom = holds.get("R", nan), holds.get("Z", nan)
    if not machine.absolute:
        level += start
        bottom += level
    if isnan(level) or isnan(bottom) or (isnan(start) and machine.modes.retract != "G99"):
        what = "Z" if isnan(bottom) else "R" if isnan(level) else "a retract level"
        raise machine.error("GCD012", f"a drill cycle without {what}")
    if bottom >= level:
        text = f"a hole from {level / MM:g} to {bottom / MM:g} mm, expected a bottom below R"
        raise machine.error("GCD012", text)
    return level, bottom


def _cycle(machine: Machine, depth: float) -> Cycle:
    holds, code = machine.drill.words, machine.modes.motion
    kind = KINDS[code]
    level = holds["R"] + (0.0 if machine.absolute else machine.drill.initial)
    up = 0.0 if machine.modes.retract == "G99" else max(machine.drill.initial - level, 0.0)
    peck = holds.get("Q", 0.0) if kind in _PECKING else 0.0
    if kind in _PECKING and not peck > 0.0:
        raise machine.error("GCD012", f"{code} without the step Q of its pecks")
    per_turn = machine.feed if machine.modes.feed == "G95" else nan
    is_tap = kind in (CycleKind.TAP, CycleKind.TAP_LEFT)
    pitch = machine.path_feed() / machine.speed if is_tap and machine.speed else nan
    return Cycle(
        kind=kind,
        depth=depth,
        clearance=0.0,
        retract=up,
        peck_first=min(peck, depth),
        peck=min(peck, depth),
        break_chip=kind is CycleKind.BRKCHP,
        dwell=holds.get("P", 0.0) if code in ("G82", "G89", "G74", "G84") else 0.0,
        feed=machine.path_feed(),
        pitch=pitch,
        feed_per_turn=per_turn,
    )


def seconds(machine: Machine, letter: str) -> float:
    """Return a dwell [s]: with a decimal point in seconds, without one in ms where P says it."""
    word = next(word for word in machine.block.words if word.letter == letter)
    if letter == "P" and word.whole and word.value >= 1.0 and machine.dialect != "linuxcnc":
        text = "a dwell P without a decimal point is in milliseconds, as on Fanuc controls"
        machine.warn("GCD104", text)
        return word.value * MS
    return word.value
