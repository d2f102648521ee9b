"""Feeds and spindle speeds: every order and unit of FEDRAT and SPINDL."""

from __future__ import annotations

from math import isnan, pi

from postproc.model import EventKind
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded
from postproc.units import INCH, INCH_PER_MIN, MM, MM_PER_MIN, RPM

FEED_UNITS = frozenset(
    {"MMPM", "IPM", "MMPR", "IPR", "PERMIN", "PERREV", "MMPMIN", "UPM", "UPR", "MPM", "FPM"}
)
_FACTORS = {"MMPM": MM_PER_MIN, "MMPMIN": MM_PER_MIN, "IPM": INCH_PER_MIN}
_FOOT = 12.0 * INCH
_PER_MINUTE = {"MPM": 1.0, "FPM": _FOOT}
_TURN_LENGTHS = {"MMPR": MM, "IPR": INCH}
PER_TURN = frozenset({"MMPR", "IPR", "PERREV", "UPR"})
"""Feed units per turn of the spindle."""
_SURFACE_SPEEDS = {"SFM": _FOOT, "SMM": 1.0}
_MINUTE = 1.0 / RPM
"""Seconds."""


def feed_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle FEDRAT/: a number and perhaps a unit, in either order."""
    known = state.feed_memo.get(statement.text)
    if known is not None:
        state.feed.set(state.at, known)
        state.revolution_feed = None
        return
    value: float | None = None
    unit = "PERMIN"
    for word in statement.upper:
        number = bounded(word)
        if number is not None and value is None:
            value = number
        elif word in FEED_UNITS:
            unit = word
        elif word:
            raise state.faults.error(
                "APT051", f"FEDRAT has {word[:20]!r}, expected a number and a unit such as MMPM",
                line, statement.text,
            )  # fmt: skip
    if value is None:
        raise state.faults.error(
            "APT050", "FEDRAT has no number", line, statement.text, _last_feed(state)
        )
    if value <= 0.0:
        raise state.faults.error(
            "APT052", "FEDRAT must be above zero", line, statement.text, _last_feed(state)
        )
    state.set_feed(feed_value(state, value, unit, line))
    state.revolution_feed = None
    if unit in PER_TURN:
        state.revolution_feed = value * _turn_length(state, unit)
    else:
        state.feed_memo[statement.text] = state.feed.value


def feed_value(state: AptState, value: float, unit: str, line: int) -> float:
    """Return a feed [m/s]; NaN if it is per turn and no spindle speed is known."""
    if unit in PER_TURN:
        if isnan(state.spindle):
            state.faults.warn("APT150", "a feed per turn without a spindle speed", line)
        return value * _turn_length(state, unit) * state.spindle
    if unit in _PER_MINUTE:
        return value * _PER_MINUTE[unit] / _MINUTE
    if unit in _FACTORS:
        if (unit == "IPM") != (state.units == "inch"):
            state.faults.warn("APT151", f"feeds in {unit} in a file in {state.units}", line)
        return value * _FACTORS[unit]
    return value * state.scale / _MINUTE


def spindle_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle SPINDL/: speed, unit and direction in any order, ON, OFF or nothing else."""
    words = statement.upper
    if "OFF" in words:
        state.add_event(EventKind.SPINDLE_OFF, line)
        return
    sign = -1.0 if "CCLW" in words or "CCW" in words else 1.0
    numbers = [number for word in words if (number := bounded(word)) is not None]
    if numbers:
        state.spindle = abs(_turns_per_second(state, words, numbers[0], line))
    elif isnan(state.spindle):
        raise state.faults.error(
            "APT053", "SPINDL has no speed and none was given before", line, statement.text
        )
    if state.revolution_feed is not None:
        state.set_feed(state.revolution_feed * state.spindle)
    known = 0.0 if isnan(state.spindle) else state.spindle
    state.add_event(EventKind.SPINDLE_ON, line, sign * known, ",".join(words))


def _turns_per_second(state: AptState, words: tuple[str, ...], value: float, line: int) -> float:
    unit = next((word for word in words if word in _SURFACE_SPEEDS), None)
    if unit is None:
        return value * RPM
    diameter = state.tools.diameter
    if isnan(diameter) or diameter <= 0.0:
        state.faults.warn(
            "APT152", f"SPINDL in {unit} without a tool diameter: speed unknown", line
        )
        return float("nan")
    return value * _SURFACE_SPEEDS[unit] / _MINUTE / (pi * diameter)


def _turn_length(state: AptState, unit: str) -> float:
    return _TURN_LENGTHS.get(unit, state.scale)


def _last_feed(state: AptState) -> str:
    if isnan(state.feed.value):
        return "no feed was given before"
    return f"the last one was {state.feed.value / MM_PER_MIN:g} mm/min"
