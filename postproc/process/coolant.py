"""Which coolant a CAM file asks for."""

from __future__ import annotations

_MODES = (
    ("THRU", 3),
    ("THROUGH", 3),
    ("TAPKUL", 3),
    ("HIGH", 3),
    ("MIST", 2),
    ("AIR", 4),
    ("FLOOD", 1),
)


def coolant_mode(text: str) -> int:
    """Return the number that the integrator's routine gets for the words of a CAM file.

    1 flood, 2 mist, 3 through the tool, 4 air; flood where the file does not say.
    """
    words = text.upper()
    return next((number for word, number in _MODES if word in words), 1)
