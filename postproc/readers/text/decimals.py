"""Decimal numbers in bulk: a million tokens of a byte buffer to float64, exactly as ``float`` does.

Plain decimals of up to 18 characters are evaluated by columns: mantissa and power of ten are both
exact in float64, so their quotient is the correctly rounded value. Every other token (exponents,
longer texts) goes through numpy's own parser, and whatever is no finite decimal number is marked
and left to the caller, who knows the line it stands in.
"""

from __future__ import annotations

import re
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import BoolArray, ByteArray, FloatArray, IndexArray

LARGEST = 1e9
"""No coordinate, feed or length of a real file comes near this [file units]."""

_FORTRAN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)[dD][+-]?\d{1,4}", re.ASCII)
_WIDTH = 16
_EXACT = 1 << 53
_CHUNK = 1 << 14
_MINUS, _PLUS = 45, 43
_POWERS = 10.0 ** np.arange(_WIDTH)

BLANK = 32
"""Space; every byte up to it counts as blank."""


def _word(byte: int) -> np.uint64:
    """Return the eight-byte word that repeats ``byte``."""
    return np.uint64(byte * 0x0101010101010101)


_ZEROS, _NINE, _LOW7, _HIGH = _word(0x30), _word(0x76), _word(0x7F), _word(0x80)
_DOT = _word(0x30 ^ 0x2E)
_KEEP = np.array(
    [[0xFF * (8 * half + i >= _WIDTH - n) for half in (0, 1) for i in range(8)] for n in range(17)],
    dtype=np.uint8,
).view(np.uint64)
"""(17, 2) masks of the last n of 16 characters."""


def parse_number(text: str) -> float | None:
    """Return the value of one decimal number (an exponent is allowed), None if it is none.

    ``nan``, ``inf``, hexadecimal texts and numbers too large for float64 are none.
    """
    try:
        value = float(text)
    except ValueError:
        if not _FORTRAN.fullmatch(text.strip()):
            return None
        value = float(text.replace("d", "e").replace("D", "e"))
    if "_" in text or not text.isascii() or not isfinite(value):
        return None
    return value


def parse_tokens(
    buffer: ByteArray, starts: IndexArray, ends: IndexArray
) -> tuple[FloatArray, BoolArray]:
    """Return the values (n,) of the texts ``buffer[starts:ends]`` and which of them are numbers.

    Blanks around a number are allowed; what is no finite decimal number is NaN.
    """
    starts = trim_start(buffer, starts, ends)
    ends = trim_end(buffer, starts, ends)
    values = np.full(len(starts), np.nan)
    valid = np.zeros(len(starts), dtype=np.bool_)
    padded = np.concatenate([np.zeros(_WIDTH, dtype=np.uint8), buffer, np.zeros(1, dtype=np.uint8)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, _WIDTH)
    for first in range(0, len(starts), _CHUNK):
        part = slice(first, first + _CHUNK)
        values[part], valid[part] = _parse_plain(windows, padded[_WIDTH:], starts[part], ends[part])
    rest = np.flatnonzero(~valid)
    if len(rest):
        values[rest] = np.nan
        _parse_rest(buffer, starts, ends, rest, values, valid)
    return values, valid


def _parse_plain(
    windows: ByteArray, buffer: ByteArray, starts: IndexArray, ends: IndexArray
) -> tuple[FloatArray, BoolArray]:
    """Evaluate signed plain decimals in windows (m, 16) before byte e, eight bytes at a time."""
    first = buffer[starts]
    negative = first == _MINUS
    starts = starts + (negative | (first == _PLUS))
    length = ends - starts
    keep = _KEEP[np.clip(length, 0, _WIDTH)]
    y = (windows[ends].view(np.uint64) ^ _ZEROS) & keep
    t = y ^ _DOT
    dot = ~(((t & _LOW7) + _LOW7) | t) & _HIGH
    other = (((y & _LOW7) + _NINE) | y) & _HIGH
    dots = np.bitwise_count(dot[:, 0]) + np.bitwise_count(dot[:, 1])
    wrong = other ^ dot
    plain = (length > dots) & (length <= _WIDTH) & ((wrong[:, 0] | wrong[:, 1]) == 0) & (dots <= 1)
    mantissa, decimals = _without_dot(y, dot, dots > 0)
    plain &= mantissa < _EXACT
    value = mantissa / _POWERS[decimals]
    return np.where(negative, -value, value), plain


def _without_dot(
    y: NDArray[np.uint64], dot: NDArray[np.uint64], has_dot: BoolArray
) -> tuple[IndexArray, IndexArray]:
    """Return the digits of (n, 2) words as one integer, and how many stand after the dot."""
    eight, one = np.uint64(8), np.uint64(1)
    unit = dot >> np.uint64(7)
    before = unit - (unit > 0)
    before[:, 0] = np.where(dot[:, 1] > 0, ~np.uint64(0), before[:, 0])
    ahead = y & before
    after = y & ~(before | (unit * np.uint64(0xFF)))
    after[:, 0] |= ahead[:, 0] << eight
    after[:, 1] |= (ahead[:, 1] << eight) | (ahead[:, 0] >> np.uint64(56))
    skipped = (np.bitwise_count(before[:, 0]) + np.bitwise_count(before[:, 1])) >> 3
    decimals = np.where(has_dot, _WIDTH - 1 - skipped.astype(np.int64), 0)
    v = after * np.uint64(10) + (after >> eight)
    pair = np.uint64(0x000000FF000000FF)
    v = (v & pair) * np.uint64(0x000F424000000064) + ((v >> np.uint64(16)) & pair) * np.uint64(
        0x0000271000000001
    )
    v >>= np.uint64(32)
    mantissa = (v[:, 0] * np.uint64(10**8) + v[:, 1] * one).astype(np.int64)
    return mantissa, decimals


def _parse_rest(
    buffer: ByteArray,
    starts: IndexArray,
    ends: IndexArray,
    rest: IndexArray,
    values: FloatArray,
    valid: BoolArray,
) -> None:
    """Evaluate the tokens ``rest`` one by one, in place."""
    cache: dict[bytes, float | None] = {}
    for i in rest:
        if ends[i] - starts[i] > 64:
            continue
        raw = buffer[starts[i] : ends[i]].tobytes()
        if raw not in cache:
            cache[raw] = parse_number(raw.decode("latin-1"))
        value = cache[raw]
        if value is not None:
            values[i], valid[i] = value, True


def trim_start(buffer: ByteArray, starts: IndexArray, ends: IndexArray) -> IndexArray:
    """Return starts (n,) moved past the blanks of each span ``buffer[starts:ends]``."""
    if len(buffer) == 0:
        return starts
    moved = np.array(starts)
    last = len(buffer) - 1
    rows = np.flatnonzero((buffer[np.minimum(moved, last)] <= BLANK) & (moved < ends))
    while len(rows):
        moved[rows] += 1
        at = moved[rows]
        rows = rows[(buffer[np.minimum(at, last)] <= BLANK) & (at < ends[rows])]
    return moved


def trim_end(buffer: ByteArray, starts: IndexArray, ends: IndexArray) -> IndexArray:
    """Return ends (n,) moved before the blanks of each span ``buffer[starts:ends]``."""
    if len(buffer) == 0:
        return ends
    moved = np.array(ends)
    rows = np.flatnonzero((buffer[np.maximum(moved - 1, 0)] <= BLANK) & (moved > starts))
    while len(rows):
        moved[rows] -= 1
        at = moved[rows]
        rows = rows[(buffer[np.maximum(at - 1, 0)] <= BLANK) & (at > starts[rows])]
    return moved
