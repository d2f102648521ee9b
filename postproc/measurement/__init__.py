"""Measuring campaigns: rows, files, and the one registration."""

from postproc.measurement.campaign import read_campaign
from postproc.measurement.columns import (
    DIRECTION,
    EXPECTED,
    JOINTS,
    ORIENTATION,
    POSITION,
    SPEED,
    WRENCH,
)
from postproc.measurement.fill_in import cells, table_to_fill_in
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
    "POSITION",
    "SPEED",
    "WRENCH",
    "MeasurementSet",
    "cells",
    "fit_registration",
    "in_robroot",
    "read_campaign",
    "rigid_motion",
    "robust_sigma",
    "table_to_fill_in",
    "unloaded_rows",
]
