"""Campaigns from Python: joint stiffness, the sim-to-real gap, what a model expects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.api.cells import Cell, Source, cell_of
from postproc.api.parts import load_model, read
from postproc.cell import Cell as CellValues
from postproc.gap import Prediction
from postproc.jobs.diagnose import DiagnosisJob
from postproc.jobs.diagnose import diagnose as diagnose_campaign
from postproc.jobs.identify import IdentifyJob
from postproc.jobs.identify import identify as identify_campaign
from postproc.jobs.predict import predict as predict_rows
from postproc.model import ModelFile, ToolPath
from postproc.progress import Progress
from postproc.stiffness.identify import IdentifyOptions
from postproc.units import MM


def identify(
    measurements: Source,
    cell: Cell | Source,
    *,
    method: str | None = None,
    grid_mm: float | None = None,
    origin_mm: Sequence[float] | None = None,
    blend: bool = True,
    confidence: float = 0.9,
    register: bool = False,
    tool: int | None = None,
    progress: Progress | None = None,
) -> IdentifyJob:
    """Return joint stiffness identified from readings with and without load.

    Args:
        measurements: CSV of readings.
        cell: the cell it was measured in, or its file.
        method: ``auto``, ``constant``, ``grid`` or ``continuous``; None: ``grid`` where ``grid_mm``
            is given, else ``auto``.
        grid_mm: edge of the grid cells [mm].
        origin_mm: (3,) lowest corner of the grid [mm]; None: of the tool points.
        blend: run continuously between cell centres; False: average on faces (Jiao et al. 2022).
        confidence: of the intervals.
        register: fit the tracker's frame and the reflector's place first.
        tool: TOOL number of the one on the flange, in a cell with several.
        progress: called with (done, total, what).

    Returns:
        The job: model, figures, page.

    Raises:
        CellError: CEL015 if the cell has several tools and none is named.
        DataError: if the file is wrong or lacks a column.
        StiffnessError: if an option is wrong or the loads show no joint.
    """
    options = IdentifyOptions(
        method=method or ("auto" if grid_mm is None else "grid"),
        grid=None if grid_mm is None else grid_mm * MM,
        origin=None if origin_mm is None else np.asarray(origin_mm, dtype=np.float64) * MM,
        blend=blend,
        confidence=confidence,
        register=register,
    )
    return identify_campaign(measurements, _cell(cell, tool), options, progress)


def diagnose(
    measurements: Source | Sequence[Source],
    cell: Cell | Source,
    *,
    model: ModelFile | Source | None = None,
    register: bool = False,
    program: ToolPath | Source | None = None,
    before: Source | Sequence[Source] = (),
    tool: int | None = None,
    progress: Progress | None = None,
) -> DiagnosisJob:
    """Return where a robot misses its model, which effect causes it and how far that shrinks it.

    Args:
        measurements: CSV of a campaign, or several files of one.
        cell: the cell it was measured in, or its file.
        model: what the simulation knows already.
        register: the measured frame and the reflector's place on the tool are unknown: fit them.
        program: toolpath or CAM file; tells where along it the gap lies.
        before: the campaign before the compensation: promised against measured, by row ids.
        tool: TOOL number of the one on the flange, in a cell with several.
        progress: called with (done, total, what).

    Returns:
        The job: verdict, adopted effects, document, model.

    Raises:
        CellError: CEL015 if the cell has several tools and none is named.
        DataError: if a file is wrong or lacks a column.
    """
    known = cell_of(_cell(cell, tool))
    files, earlier = _files(measurements), _files(before)
    part = read(program, known) if isinstance(program, Source) else program
    return diagnose_campaign(files, known, _model(model), register, part, progress, earlier)


def _files(source: Source | Sequence[Source]) -> list[Source]:
    return [source] if isinstance(source, Source) else list(source)


def predict(
    measurements: Source,
    cell: Cell | Source,
    model: ModelFile | Source | None = None,
    *,
    register: bool = False,
    tool: int | None = None,
) -> Prediction:
    """Return the tool point that a model expects at each row of a measurement file.

    Args:
        measurements: CSV of commanded joints and conditions.
        cell: the cell, or its file.
        model: what is known of the arm; None: nominal.
        register: fit the measured frame and the reflector anew on these rows.
        tool: TOOL number of the one on the flange, in a cell with several.

    Returns:
        Points in the frame of the measurement, and the misfit.

    Raises:
        CellError: CEL015 if the cell has several tools and none is named.
        DataError: if a file is wrong or lacks a column.
    """
    return predict_rows(measurements, _cell(cell, tool), _model(model), register)[0]


def _cell(cell: Cell | Source, tool: int | None) -> CellValues:
    return cell_of(cell).for_tool(tool)


def _model(model: ModelFile | Source | None) -> ModelFile | None:
    return load_model(model) if isinstance(model, Source) else model
