"""Measuring campaigns: rows, files, registration."""

from postproc.measurement.campaign import read_campaign
from postproc.measurement.file import (
    DIRECTION,
    EXPECTED,
    JOINTS,
    ORIENTATION,
    SPEED,
    WRENCH,
    read_measurements,
)
from postproc.measurement.register import fit_registration
from postproc.measurement.rows import MeasurementSet

__all__ = [
    "DIRECTION",
    "EXPECTED",
    "JOINTS",
    "ORIENTATION",
    "SPEED",
    "WRENCH",
    "MeasurementSet",
    "fit_registration",
    "read_campaign",
    "read_measurements",
]
