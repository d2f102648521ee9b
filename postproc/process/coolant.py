"""Coolant words of CAM systems, and the number that the integrator's routine gets for each."""

from __future__ import annotations

COOLANTS = {
    "ON": 1, "FLOOD": 1, "MIST": 2, "THRU": 3, "THROUGH": 3, "TAPKUL": 3, "HIGH": 3, "AIR": 4,
    "TAP": 5, "CUSTOM1": 6, "CUSTOM2": 7, "CUSTOM3": 8,
}  # fmt: skip
"""A kind stands before ON: ``COOLNT/ON,MIST`` is mist."""


def coolant_mode(text: str) -> int:
    """Return the number of the words behind COOLNT: that of the kind named, else flood."""
    words = [word.strip() for word in text.upper().split(",")]
    kinds = [COOLANTS[word] for word in words if word in COOLANTS and word != "ON"]
    return kinds[0] if kinds else COOLANTS["ON"]
