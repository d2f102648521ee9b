"""Measuring campaigns: rows, files, and the one registration."""

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
from postproc.measurement.registration import (
    fit_registration,
    in_robroot,
    rigid_motion,
    unloaded_rows,
)
from postproc.measurement.rows import MeasurementSet
from postproc.measurement.scatter import MEAN_LENGTH, robust_sigma

__all__ = [
    "DIRECTION",
    "EXPECTED",
    "JOINTS",
    "MEAN_LENGTH",
    "ORIENTATION",
    "SPEED",
    "WRENCH",
    "MeasurementSet",
    "fit_registration",
    "in_robroot",
    "read_campaign",
    "read_measurements",
    "rigid_motion",
    "robust_sigma",
    "unloaded_rows",
]
