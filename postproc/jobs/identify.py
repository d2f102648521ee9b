"""Identify joint stiffness from a campaign: rows in, model and figures out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from postproc.cell import Cell
from postproc.files import write_files
from postproc.gap import stiffness_tables
from postproc.jobs.given import Source, cell_of
from postproc.jobs.paged import Paged
from postproc.jobs.readings import readings
from postproc.kinematics import build
from postproc.model import ModelFile, save_model
from postproc.progress import Progress
from postproc.stiffness.identify import Identification, IdentifyOptions, identify_document, warnings
from postproc.stiffness.identify import identify as identify_rows
from postproc.units import MM


class IdentifyJob(Paged):
    """Joint stiffness identified from a campaign. Nothing is on disk before ``write``."""

    def __init__(self, result: Identification, cell: Cell) -> None:
        self.result = result
        self.cell = cell

    @cached_property
    def document(self) -> dict[str, Any]:
        """The ``postproc.identify/1`` document, as ``identify --json`` prints it."""
        return identify_document(self.result)

    @property
    def warnings(self) -> Sequence[str]:
        """What to doubt, in words."""
        return warnings(self.result)

    @property
    def model(self) -> ModelFile:
        """The model of the arm that was found."""
        result = self.result
        effects = stiffness_tables(result.field, result.constant.c_joint)
        return ModelFile(effects, result.registration, result.notes)

    def page(self) -> bytes:
        """Return the page with the figures: one HTML file that opens offline."""
        from postproc.jobs.drawing import drawing_of
        from postproc.report.pages.identify import identify_page

        return identify_page(self.result, drawing_of(self.cell))

    def write(self, file: str | Path) -> Path:
        """Write ``model.toml`` and return its path.

        Args:
            file: the model file.

        Returns:
            Its path.

        Raises:
            ReadError: if it cannot be written.
        """
        write_files({Path(file): save_model(self.model)})
        return Path(file)

    def __repr__(self) -> str:
        """Return method and number of rows on one line."""
        return f"<IdentifyJob {self.document['method']}: {self.document['rows']} rows>"


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
    cell = cell_of(cell).for_tool(tool)
    kinematics = build(cell.robot)
    rows = readings([measurements], kinematics, cell, register=register)
    p_flange_tcp = cell.tool.T_flange_tcp[:3, 3]
    known = cell.joint_stiffness
    result = identify_rows(rows, kinematics, p_flange_tcp, options, known, progress)
    return IdentifyJob(result, cell)
