"""Judge a program's text: by itself, against the CAM file, or by where the real tool lands."""

from __future__ import annotations

from pathlib import Path

from postproc.cell import Cell
from postproc.controller import load_program
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
    """Return the report on a program.

    Args:
        program: the .src file to start; in the backup of a controller, what it calls there and
            the global data are known.
        cell: robot, tool, workpiece, solids, margins.
        toolpath: what it was made from; None: only what the program says by itself.
        tolerances: of the comparison.
        collisions: search for collisions along the motions.
        progress: called with (done, total, what).
        model: what is known of the arm; then the real tool is compared with the CAM file.

    Raises:
        KrlError: if a file is no KRL that could run.
        ReadError: if a file is missing.
    """
    displacement = None
    if model is not None:
        from postproc.compensation import RealArm

        displacement = RealArm.of(cell, model).on_runs
    modules = load_program(program, on_controller=True)
    return verify_text(
        modules,
        modules[0].name,
        cell,
        toolpath,
        tolerances,
        collisions,
        progress,
        displacement=displacement,
    )


def uncounted(cell: Cell, model: ModelFile) -> dict[str, tuple[str, ...]]:
    """Return the effects of a model that no program can show, with the columns they need."""
    from postproc.compensation import RealArm, left_out

    return left_out(RealArm.of(cell, model).model)
