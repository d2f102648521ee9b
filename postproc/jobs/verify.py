"""Judge a program's text: by itself, against the CAM file, or by where the real tool lands."""

from __future__ import annotations

import math

from postproc.cell import Cell
from postproc.controller import load_program
from postproc.errors import UsageError
from postproc.jobs.given import Source, cell_of, load_model, part_of
from postproc.model import ModelFile, ToolPath
from postproc.progress import Progress
from postproc.units import DEG, MM
from postproc.verification import Tolerances, VerifyReport
from postproc.verification import verify as verify_text


def verify(
    program: Source,
    cell: Cell | Source,
    against: ToolPath | Source | None = None,
    *,
    model: ModelFile | Source | None = None,
    tol_mm: float = 0.01,
    tol_deg: float = 0.005,
    collisions: bool = True,
    progress: Progress | None = None,
) -> VerifyReport:
    """Return what the text of a program does on the robot model.

    Args:
        program: the .src file to start; sub-programs are taken from beside it, in the backup of a
            controller what it calls there and the global data.
        cell: the cell it is to run in.
        against: the toolpath or CAM file it was made from: every point, axis, arc, feed, hole,
            dwell and event of it must be found.
        model: model of the arm: where the real, loaded tool lands is what counts.
        tol_mm: how far a point may be off [mm].
        tol_deg: how far the tool axis may be off [deg].
        collisions: search for collisions along the motions.
        progress: called with (done, total, what).

    Returns:
        Violations, warnings and the worst deviations.

    Raises:
        UsageError: VER002 if a model is given without anything to compare with, VER003 if a
            tolerance is no finite number above 0.
        KrlError: if a file is no KRL that could run.
        ReadError: if a file is missing.
    """
    cell, displacement = cell_of(cell), None
    if model is not None and against is None:
        raise UsageError("VER002", "a model needs a CAM file: the real tool is compared with it")
    tolerances = Tolerances(at_least("tol_mm", tol_mm) * MM, at_least("tol_deg", tol_deg) * DEG)
    toolpath = None if against is None else part_of(against, cell)
    if model is not None:
        from postproc.compensation import RealArm

        arm = load_model(model) if isinstance(model, Source) else model
        displacement = RealArm.of(cell, arm).on_runs
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


def at_least(name: str, value: float, *, or_zero: bool = False) -> float:
    """Return a tolerance that differences can be held against: against NaN, none is too large."""
    is_number = isinstance(value, int | float) and math.isfinite(value)
    if is_number and (value > 0.0 or (or_zero and value == 0.0)):
        return value
    expected = "a finite number, 0 or above" if or_zero else "a finite number above 0"
    raise UsageError("VER003", f"{name} is {value!r}, expected {expected}")


def uncounted(cell: Cell, model: ModelFile) -> dict[str, tuple[str, ...]]:
    """Return the effects of a model that no program can show, with the columns they need."""
    from postproc.compensation import RealArm, left_out

    return left_out(RealArm.of(cell, model).model)
