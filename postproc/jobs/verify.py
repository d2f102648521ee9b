"""Judge a program's text: by itself, against the CAM file, or by where the real tool lands."""

from __future__ import annotations

from pathlib import Path

from postproc.cell import Cell
from postproc.compensation import RealArm, left_out
from postproc.model import ModelFile, ToolPath
from postproc.progress import Progress
from postproc.verification import Tolerances, VerifyReport
from postproc.verification import verify as verify_text


def verify(
    program: str | Path,
    cell: Cell,
    toolpath: ToolPath | None = None,
    tolerances: Tolerances | None = None,
    collisions: bool = True,
    progress: Progress | None = None,
    model: ModelFile | None = None,
) -> VerifyReport:
    """Return the report on a program; arguments as ``verification.verify``.

    Args:
        model: what is known of the arm; then the real tool is compared with the CAM file.
    """
    displacement = None if model is None else RealArm.of(cell, model).displacement
    return verify_text(program, cell, toolpath, tolerances, collisions, progress, displacement)


def uncounted(cell: Cell, model: ModelFile) -> dict[str, tuple[str, ...]]:
    """Return the effects of a model that no program can show, with the columns they need."""
    return left_out(RealArm.of(cell, model).model)
