"""Number text for KRL: fixed point, enough digits, never ``-0``, ``nan`` or an exponent.

REAL on the controller is IEEE single, so more digits than these are noise; fewer are a defect
(two decimals of m/s print every feed below 300 mm/min as ``0.00``). Rounding is idempotent: the
text of a number that was read from our text is that text again.
"""

from __future__ import annotations

import math
from functools import lru_cache

from postproc.errors import KrlError

LENGTH_DIGITS = 4
"""Decimals of X, Y, Z and of distances [mm]."""
ANGLE_DIGITS = 5
"""Decimals of A, B, C, A1..A6 and E1..E6 [deg, mm]."""
SPEED_DIGITS = 6
"""Smallest number of decimals of path speeds [m/s]; more where six significant digits need them."""
SECOND_DIGITS = 4
"""Decimals of waiting times [s]."""
PLAIN_DIGITS = 4
"""Decimals of any other REAL."""
LARGEST = 1e9
"""A larger magnitude is a fault of the input, not a number for a robot."""

STATUS_MAX = 0b11111
TURN_MAX = (1 << 12) - 1


def real(value: float, digits: int = PLAIN_DIGITS) -> str:
    """Return a REAL in fixed point with ``digits`` decimals; a value that rounds to 0 gives 0."""
    if not -LARGEST <= value <= LARGEST:  # catches nan as well
        raise KrlError("KRL901", f"{value!r} cannot be written as a REAL")
    return f"{value:z.{digits}f}"


def nonzero(value: float, digits: int, what: str) -> str:
    """Return as ``real`` a value that must not be lost: KRL902 if it would print as 0."""
    text = real(value, digits)
    if value != 0.0 and float(text) == 0.0:
        message = f"{what} {value!r} would be written as {text}, expected at least {10**-digits:g}"
        raise KrlError("KRL902", message)
    return text


def speed(metres_per_second: float) -> str:
    """Return a path speed [m/s] with six decimals and six significant digits at least."""
    if not 0.0 < metres_per_second <= LARGEST:
        raise KrlError("KRL903", f"a path speed of {metres_per_second!r} m/s, expected above 0")
    return significant(metres_per_second)


@lru_cache(maxsize=1024)
def significant(value: float) -> str:
    """Return six significant digits in fixed point, at least ``SPEED_DIGITS`` decimals."""
    real(value)
    if value == 0.0:
        return f"{0.0:.{SPEED_DIGITS}f}"
    decimals = max(SPEED_DIGITS, 5 - math.floor(math.log10(abs(value))))
    text = nonzero(float(f"{value:.5e}"), min(decimals, 12), "value")
    while text.endswith("0") and len(text) - text.index(".") - 1 > SPEED_DIGITS:
        text = text[:-1]
    return text


def percent(value: float) -> str:
    """Return a percentage, without decimals where it is whole."""
    rounded = round(value, 3) if math.isfinite(value) else value
    if not 0.0 < rounded <= 100.0:
        raise KrlError("KRL904", f"{value!r} percent, expected above 0 and at most 100")
    return f"{rounded:.0f}" if rounded == int(rounded) else f"{rounded:.3f}"


def status(value: int) -> str:
    """Return the status S of a position."""
    if not 0 <= value <= STATUS_MAX:
        raise KrlError("KRL905", f"status {value}, expected 0 to {STATUS_MAX}")
    return str(value)


def turn(value: int) -> str:
    """Return the turn T of a position: one bit for each of up to twelve axes."""
    if not 0 <= value <= TURN_MAX:
        raise KrlError("KRL905", f"turn {value}, expected 0 to {TURN_MAX}")
    return str(value)
