"""Every factor between the units of files and SI, and the names of units.

No other module holds 1000, 25.4 or pi/180, or reads the name of a unit.
"""

from __future__ import annotations

import math
import re
from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple
from unicodedata import combining, normalize

MM = 1e-3
"""One millimetre in metres."""
UM = 1e-6
"""One micrometre in metres."""
INCH = 25.4e-3
"""One inch in metres."""
DEG = math.pi / 180.0
"""One degree in radians."""
TURN = 2.0 * math.pi
"""One turn in radians."""
MM_PER_MIN = 1e-3 / 60.0
"""One mm/min in m/s."""
INCH_PER_MIN = 25.4e-3 / 60.0
"""One inch/min in m/s."""
RPM = 1.0 / 60.0
"""One turn per minute in turns per second."""
MS = 1e-3
"""One millisecond in seconds."""
MEGABYTE = 1e6
"""One megabyte in bytes."""
PERCENT = 1e-2
"""One percent."""
NMM_PER_RAD = 1e-3
"""One N*mm/rad of joint stiffness in N*m/rad."""
N_PER_MM = 1e3
"""One N/mm of Cartesian stiffness in N/m."""
STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2]."""


class Dimension(StrEnum):
    """What a unit measures, in the words of a message."""

    LENGTH = "length"
    ANGLE = "angle"
    TIME = "time"
    SHARE = "share"
    SPEED = "speed"
    TURNS = "turns per time"
    ADVANCE = "length per turn"


class Unit(NamedTuple):
    """What a name of a unit means: its dimension, its factor to SI, and whether it is imperial."""

    dimension: Dimension
    factor: float
    imperial: bool = False


_FOOT = 12.0 * INCH
_NAMES: dict[Dimension, dict[float, str]] = {
    Dimension.LENGTH: {
        MM: "mm millimeter millimeters millimetre millimetres",
        1.0: "m meter meters metre metres",
        10.0 * MM: "cm centimeter centimeters centimetre centimetres",
        UM: "um \u03bcm micron microns micrometer micrometre",
        INCH: 'in inch inches zoll pouce pouces "',
        _FOOT: "ft foot feet",
    },
    Dimension.ANGLE: {
        DEG: "deg degree degrees \u00b0 grad degre degres",  # grad: German for degree
        1.0: "rad radian radians",
    },
    Dimension.TIME: {
        1.0: "s sec second seconds sek sekunde sekunden seconde secondes",
        MS: "ms msec millisecond milliseconds",
        60.0: "min minute minutes minuten",
        3600.0: "h hr hour",
    },
    Dimension.SHARE: {PERCENT: "% percent prozent"},
}
"""Names of units by what they measure and their factor, in lower case."""
SINGLE = {
    name: Unit(dimension, factor, dimension is Dimension.LENGTH and factor in (INCH, _FOOT))
    for dimension, units in _NAMES.items()
    for factor, names in units.items()
    for name in names.split()
}
_TURN_NAMES = "1 rev revs revolution r u umdr umdrehungen tr trs t tour tours turn turns"
_TURN = frozenset(_TURN_NAMES.split())
_SHORT = {
    "rpm": "1/min", "upm": "1/min", "rps": "1/s", "hz": "1/s", "mmpm": "mm/min",
    "mmpmin": "mm/min", "mpm": "m/min", "mps": "m/s", "ipm": "in/min", "ips": "in/s",
    "fpm": "ft/min", "sfm": "ft/min", "smm": "m/min", "mmpr": "mm/rev", "ipr": "in/rev",
}  # fmt: skip
"""Units in one word; UPM: German for turns a minute; SFM, SMM: of a cutter's rim, APT's words."""
_INVERSE = re.compile(r"([a-z]+)\s*\^?\s*\(?[-\u2212]\s*1\)?$")
_BETWEEN = re.compile(r"[\s_/\u00b7*.]+")
_PER = frozenset({"per", "pro", "par"})


@lru_cache(maxsize=512)
def unit_named(text: str) -> Unit | None:
    """Return what the name of a unit means, None if it is none.

    A unit is one of length, angle or time, or two of them with a sign or a word between:
    ``mm/min``, ``mm_per_min``, ``mm min^-1``, ``1/min``, ``mm/rev``.

    >>> unit_named("mm/s"), unit_named("m min-1") == unit_named("m/min"), unit_named("kN")
    (Unit(dimension=<Dimension.SPEED: 'speed'>, factor=0.001, imperial=False), True, None)
    """
    plain = normalize("NFD", normalize("NFKC", text).lower().strip())
    plain = "".join(c for c in plain if not combining(c))
    plain = _INVERSE.sub(r"/\1", plain)
    plain = f"1{plain}" if plain.startswith("/") else plain
    parts = [part for part in _BETWEEN.split(_SHORT.get(plain, plain)) if part not in ("", *_PER)]
    if len(parts) == 1:
        return SINGLE.get(parts[0])
    if len(parts) != 2:
        return None
    (first, second), over = (SINGLE.get(part) for part in parts), parts[1]
    if second is not None and second.dimension is Dimension.TIME:
        if first is not None and first.dimension is Dimension.LENGTH:
            return Unit(Dimension.SPEED, first.factor / second.factor, first.imperial)
        return Unit(Dimension.TURNS, 1.0 / second.factor) if parts[0] in _TURN else None
    if first is not None and first.dimension is Dimension.LENGTH and over in _TURN - {"1"}:
        return Unit(Dimension.ADVANCE, first.factor, first.imperial)
    return None
