"""The tool points that a model expects at the rows of a measurement file."""

from __future__ import annotations

from pathlib import Path

from postproc.cell import Cell
from postproc.gap import Prediction
from postproc.gap import predict as predict_rows
from postproc.kinematics import build
from postproc.measurement import MeasurementSet, read_campaign
from postproc.model import ModelFile


def predict(
    measurements: str | Path,
    cell: Cell,
    model: ModelFile | None = None,
    register: bool = False,
) -> tuple[Prediction, MeasurementSet]:
    """Return the prediction and the rows that it is for; arguments as ``gap.predict``.

    Raises:
        DataError: if a file is wrong or lacks a column.
    """
    rows = read_campaign([measurements])
    return predict_rows(rows, build(cell.robot), cell, model, register), rows
