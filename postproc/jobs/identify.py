"""Identify joint stiffness from a campaign: rows in, model and figures out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from postproc.cell import Cell
from postproc.files import write_files
from postproc.gap import stiffness_tables
from postproc.jobs.paged import Paged
from postproc.jobs.readings import readings
from postproc.kinematics import build
from postproc.model import ModelFile, save_model
from postproc.progress import Progress
from postproc.stiffness.identify import Identification, IdentifyOptions, identify_document, warnings
from postproc.stiffness.identify import identify as identify_rows


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
    measurements: str | Path,
    cell: Cell,
    options: IdentifyOptions | None = None,
    progress: Progress | None = None,
) -> IdentifyJob:
    """Return the joint stiffness that a campaign shows.

    Args:
        measurements: file of readings with and without load.
        cell: robot and tool.
        options: method, grid, intervals, registration.
        progress: called with (done, total, what).

    Raises:
        DataError: if the file is wrong or lacks a column.
        StiffnessError: if the loads show no joint.
    """
    kinematics = build(cell.robot)
    options = options or IdentifyOptions()
    rows = readings([measurements], kinematics, cell, register=options.register)
    p_flange_tcp = cell.tool.T_flange_tcp[:3, 3]
    known = cell.joint_stiffness
    result = identify_rows(rows, kinematics, p_flange_tcp, options, known, progress)
    return IdentifyJob(result, cell)
