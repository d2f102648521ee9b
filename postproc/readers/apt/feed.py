"""Feeds and spindle speeds: every order and unit of FEDRAT and SPINDL."""

from __future__ import annotations

from math import isnan, pi

from postproc.model import EventKind, WordClass
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded
from postproc.units import INCH_PER_MIN, MM_PER_MIN, RPM, SINGLE, Dimension, Unit, unit_named

_OF_THE_FILE = {"PERMIN": False, "UPM": False, "PERREV": True, "UPR": True}
"""Words for the file's own unit of length, and whether it is per turn of the spindle."""
_EACH_MINUTE = (MM_PER_MIN, INCH_PER_MIN)
"""The feeds of files in mm and in inches [m/s]."""
_SURFACE_SPEEDS = frozenset({"SFM", "SMM"})
_FEED_REFUSED = {
    "INVERS": "a feed in inverse time; the last feed stays in force",
    "LOCK": "an override that is to be locked",
    "MAXIPM": "a limit of the feed is not watched",
    "MAXMPM": "a limit of the feed is not watched",
}
_NO_SPEED = frozenset({"ORIENT", "MAXRPM", "RANGE", "RADIUS", "DIAMTR"})
"""Words of SPINDL whose number is no speed."""
_SPINDLE_REFUSED = {
    "ORIENT": "the spindle is to stand at an angle",
    "LOCK": "the spindle is to be locked",
    "SFM": "a constant surface speed; the speed of the tool's diameter is kept",
    "SMM": "a constant surface speed; the speed of the tool's diameter is kept",
    "MAXRPM": "a limit of the speed is not watched",
}
_SPINDLE_NOTED = frozenset({"BOTH", "LOW", "MEDIUM", "HIGH", "AUTO", "RANGE"})


def _stated(word: str, *dimensions: Dimension) -> Unit | None:
    """Return the unit that a word states, None if it is none of these dimensions."""
    unit = None if word in _OF_THE_FILE else unit_named(word)
    return unit if unit is not None and unit.dimension in dimensions else None


def is_feed_unit(word: str) -> bool:
    """Return whether a word is a unit of feed."""
    return word in _OF_THE_FILE or _stated(word, Dimension.SPEED, Dimension.ADVANCE) is not None


def is_per_turn(word: str) -> bool:
    """Return whether a unit of feed counts per turn of the spindle."""
    return _OF_THE_FILE.get(word, _stated(word, Dimension.ADVANCE) is not None)


def feed_statement(state: AptState, statement: Statement) -> None:
    """Handle FEDRAT/: a number and perhaps a unit, in either order."""
    settle_turn_feed(state)
    known = state.feed_memo.get(statement.text)
    if known is not None:
        state.feed.set(state.at, known)
        state.revolution_feed = None
        return
    value, unit = _feed_words(state, statement)
    if "INVERS" in statement.upper:
        return
    if value is None:
        raise state.error("APT050", "FEDRAT has no number", _last_feed(state))
    if value <= 0.0:
        raise state.error("APT052", "FEDRAT must be above zero", _last_feed(state))
    if is_per_turn(unit) and isnan(state.spindle):
        state.set_feed(float("nan"))
        state.waiting_feed = (state.done + state.at, unit, state.line)
    else:
        state.set_feed(feed_value(state, value, unit))
    state.revolution_feed = None
    if is_per_turn(unit):
        state.revolution_feed = value * _turn_length(state, unit)
    elif not _contradicts(state, unit):
        state.feed_memo[statement.text] = state.feed.value


def settle_turn_feed(state: AptState) -> None:
    """Refuse a feed per turn that points have used before a spindle speed was given."""
    if state.waiting_feed is None:
        return
    points, unit, line = state.waiting_feed
    if state.done + state.at > points:
        _refuse_turn_feed(state, unit, line)
    state.waiting_feed = None


def _refuse_turn_feed(state: AptState, unit: str, line: int) -> None:
    state.faults.warn("APT150", "a feed per turn without a spindle speed", line)
    reason = f"{unit} is a feed per turn, and no spindle speed is known here"
    state.uses.refuse("FEDRAT", WordClass.PROCESS, line, reason)


def _feed_words(state: AptState, statement: Statement) -> tuple[float | None, str]:
    """Return the number and the unit of FEDRAT/."""
    value: float | None = None
    unit = "PERMIN"
    for word in statement.upper:
        number = bounded(word)
        if number is not None and value is None:
            value = number
        elif is_feed_unit(word):
            unit = word
        elif word in _FEED_REFUSED:
            state.refuse(f"FEDRAT/{word}", WordClass.PROCESS, _FEED_REFUSED[word])
        elif word and not _goes_with(statement.upper, number):
            text = f"FEDRAT has {word[:20]!r}, expected a number and a unit such as MMPM"
            raise state.error("APT051", text)
    return value, unit


def _goes_with(words: tuple[str, ...], number: float | None) -> bool:
    """Return whether a word belongs to a refused one: INVERS,AUTO, or the number of MAXIPM."""
    return "INVERS" in words or (number is not None and "MAXIPM" in words)


def feed_value(state: AptState, value: float, unit: str) -> float:
    """Return a feed [m/s]; NaN if it is per turn and no spindle speed is known."""
    if is_per_turn(unit):
        if isnan(state.spindle):
            _refuse_turn_feed(state, unit, state.line)
        return value * _turn_length(state, unit) * state.spindle
    stated = _stated(unit, Dimension.SPEED)
    if stated is not None:
        return value * (_contradicted(state, unit) or stated.factor)
    return value * state.scale / SINGLE["min"].factor


def feed_per_turn(state: AptState, value: float, unit: str) -> float:
    """Return a feed per turn [m]."""
    return value * _turn_length(state, unit)


def _contradicts(state: AptState, word: str) -> bool:
    """Return whether a feed's unit is the one of inches in a file in mm, or the other way round."""
    unit = _stated(word, Dimension.SPEED)
    usual = unit is not None and unit.factor in _EACH_MINUTE
    return usual and unit is not None and unit.imperial != (state.units == "inch")


def _contradicted(state: AptState, unit: str) -> float | None:
    """Return the factor that the user names where the feed's unit contradicts UNITS, else None."""
    if not _contradicts(state, unit):
        return None
    state.warn("APT151", f"feeds in {unit} in a file in {state.units}")
    chosen = state.options.feed_units
    if chosen is not None:
        return INCH_PER_MIN if chosen == "inch" else MM_PER_MIN
    reason = (
        f"the feed is in {unit}, but the file is in {state.units}; one of the two is wrong, and "
        "the feed by a factor of 25.4"
    )
    state.refuse("FEDRAT", WordClass.PROCESS, reason, "--feed-units mm or --feed-units inch")
    return None


def spindle_statement(state: AptState, statement: Statement) -> None:
    """Handle SPINDL/: speed, unit and direction in any order, ON, OFF or 0, or nothing else."""
    words = statement.upper
    value = None if "OFF" in words else _speed(state, words)
    if "OFF" in words or value == 0.0:
        state.add_event(EventKind.SPINDLE_OFF)
        return
    if value is not None:
        state.spindle = abs(_turns_per_second(state, words, value))
    elif {"ORIENT", "LOCK"} & set(words):
        return
    if {"CCLW", "CCW"} & set(words) and value is not None and value < 0.0:
        reason = "a negative speed and counterclockwise: nothing says whether that is clockwise"
        state.refuse("SPINDL/CCLW", WordClass.PROCESS, reason)
    _turn(state, words, value)
    if not isnan(state.spindle):
        settle_turn_feed(state)
    if state.revolution_feed is not None:
        state.set_feed(state.revolution_feed * state.spindle)
    known = 0.0 if isnan(state.spindle) else state.spindle
    state.add_event(EventKind.SPINDLE_ON, state.spindle_sign * known, ",".join(words))


def _turn(state: AptState, words: tuple[str, ...], value: float | None) -> None:
    """Keep which way the spindle turns: a word holds on, the sign of a speed for that speed."""
    named = -1.0 if {"CCLW", "CCW"} & set(words) else 1.0 if {"CLW", "CW"} & set(words) else None
    if value is not None and value < 0.0:
        state.spindle_sign, state.spindle_signed = -1.0, True
    elif named is not None or (state.spindle_signed and value is not None):
        state.spindle_sign, state.spindle_signed = named or 1.0, False


def _speed(state: AptState, words: tuple[str, ...]) -> float | None:
    """Return the number of a SPINDL that is a speed, None if there is none."""
    found = None
    for before, word in zip(("", *words), words, strict=False):
        number = bounded(word)
        if number is not None and before not in _NO_SPEED and found is None:
            found = number
        elif number is not None and before not in _NO_SPEED:
            reason = f"{word} is a second speed behind {found:g}; it is not carried out"
            state.refuse("SPINDL", WordClass.PROCESS, reason)
        elif word in _SPINDLE_REFUSED:
            state.refuse(f"SPINDL/{word}", WordClass.PROCESS, _SPINDLE_REFUSED[word])
        elif word in _SPINDLE_NOTED:
            state.note(f"SPINDL/{word}", WordClass.PROCESS, "a gear or range of the target machine")
    return found


def _turns_per_second(state: AptState, words: tuple[str, ...], value: float) -> float:
    unit = next((word for word in words if word in _SURFACE_SPEEDS), "")
    speed = unit_named(unit)
    if speed is None:
        return value * RPM
    diameter = state.tools.diameter
    if isnan(diameter) or diameter <= 0.0:
        state.warn("APT152", f"SPINDL in {unit} without a tool diameter: speed unknown")
        return float("nan")
    return value * speed.factor / (pi * diameter)


def _turn_length(state: AptState, unit: str) -> float:
    stated = _stated(unit, Dimension.ADVANCE)
    return state.scale if stated is None else stated.factor


def _last_feed(state: AptState) -> str:
    if isnan(state.feed.value):
        return "no feed was given before"
    return f"the last one was {state.feed.value / MM_PER_MIN:g} mm/min"


def dwell_statement(state: AptState, statement: Statement) -> None:
    """Handle DELAY/seconds, DELAY/n,REV in turns of the spindle."""
    numbers = [value for value in statement.numbers() if value is not None]
    if not numbers or numbers[0] < 0.0:
        raise state.error("APT072", "DELAY without a time")
    seconds = numbers[0]
    if "REV" in statement.upper:
        if not state.spindle > 0.0:
            raise state.faults.error("APT072", "DELAY in turns without a spindle speed", state.line)
        seconds /= state.spindle
    state.add_event(EventKind.DWELL, seconds)
