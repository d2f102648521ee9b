"""Diagnose a recorded path: samples in; verdict, model and page out."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

from postproc.cell import Cell
from postproc.controller import load_program
from postproc.jobs.paged import Paged, written
from postproc.kinematics import build
from postproc.model import ModelFile, ToolPath, save_model
from postproc.progress import Progress
from postproc.trace import (
    PathDiagnosis,
    document,
    model_file,
    of_program,
    of_toolpath,
    read_recording,
    summary,
)


class PathJob(Paged):
    """The answer to a recording. Nothing is on disk before ``write``."""

    def __init__(self, found: PathDiagnosis, given: ModelFile | None) -> None:
        self.found = found
        self.given = given

    @cached_property
    def document(self) -> dict[str, Any]:
        """The ``postproc.pathdiagnosis/1`` document, as ``diagnose --trace --json`` prints it."""
        return document(self.found)

    @property
    def summary(self) -> list[str]:
        """The answer in words, line by line."""
        return list(summary(self.document))

    @property
    def model(self) -> ModelFile:
        """The given model plus what was adopted."""
        return model_file(self.found, self.given)

    def page(self) -> bytes:
        """Return the page: one HTML file that opens offline."""
        from postproc.report.pages.trace import trace_page

        return trace_page(self.found, self.document)

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write ``report.html`` and ``model.toml`` and return their paths."""
        files = {"report.html": self.page(), "model.toml": save_model(self.model)}
        return written(folder, files)


def diagnose_trace(
    recording: str | Path,
    cell: Cell,
    model: ModelFile | None = None,
    progress: Progress | None = None,
    program: str | Path | None = None,
    toolpath: ToolPath | None = None,
) -> PathJob:
    """Return the diagnosis of a recorded path, where given of a KRL program or a toolpath."""
    rows = read_recording(recording, progress)
    kinematics = build(cell.robot)
    path = None
    if program is not None:
        modules = load_program(program, on_controller=True)
        path = of_program(modules, cell, kinematics, cell.tool.T_flange_tcp[:3, 3])
    elif toolpath is not None:
        path = of_toolpath(toolpath, cell)
    return PathJob(PathDiagnosis(rows, cell, kinematics, model, progress, path), model)
