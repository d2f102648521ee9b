"""The readings of a measurement file, as all commands take them, and what a model expects there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from postproc.cell import Cell
from postproc.compensation import split
from postproc.gap import Prediction
from postproc.gap import predict as predict_rows
from postproc.kinematics import Kinematics, build
from postproc.measurement import (
    MeasurementSet,
    only_points,
    only_told,
    read_campaign,
    repaired,
    without_copies,
)
from postproc.model import ModelFile


def readings(
    paths: Sequence[str | Path],
    kinematics: Kinematics,
    cell: Cell,
    model: ModelFile | None = None,
    register: bool = False,
    every_row: bool = False,
    any_reading: bool = False,
) -> MeasurementSet:
    """Return the rows of one campaign, in the units of their columns; remarks say what was wrong.

    ``model``: its registration says where the readings are; None: in the robot root; ``register``:
    the measured frame is unknown. ``every_row``: the answer has a line for each row, none is left
    out; ``any_reading``: rows may read one or two numbers of their point, or its distance; without
    both, all of them have three coordinates.
    """
    rows = read_campaign(paths, set_aside=not every_row)
    if not every_row:
        rows = without_copies(rows)
        rows = only_told(rows) if any_reading else only_points(rows)
    frame = None if register or model is None else model.registration
    return repaired(rows, kinematics, cell, register, frame)


def predict(
    measurements: str | Path, cell: Cell, model: ModelFile | None = None, register: bool = False
) -> tuple[Prediction, MeasurementSet]:
    """Return the prediction and the rows that it is for; arguments as ``gap.predict``.

    What the model says of motions along a path is left out: rows are read at rest.

    Raises:
        DataError: if a file is wrong or lacks a column.
    """
    kinematics = build(cell.robot)
    rows = readings([measurements], kinematics, cell, model, register, every_row=True)
    still, moving = (None, {}) if model is None else split(model)
    told = predict_rows(rows, kinematics, cell, still, register)
    return replace(told, missing=(*told.missing, *sorted(moving))), rows
