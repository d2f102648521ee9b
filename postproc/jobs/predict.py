"""The tool points that a model expects at the rows of a measurement file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from postproc.cell import Cell
from postproc.compensation import split
from postproc.gap import Prediction
from postproc.gap import predict as predict_rows
from postproc.jobs.readings import readings
from postproc.kinematics import build
from postproc.measurement import MeasurementSet
from postproc.model import ModelFile


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
