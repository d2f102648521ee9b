"""Programs from Python: read a part, convert it, verify, lint and compare what was written."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from postproc.api.cells import Cell, Source, cell_of
from postproc.api.job import Job
from postproc.api.parts import load_model, read
from postproc.arrays import FloatArray
from postproc.batch import BatchOptions, BatchOutcome, call_of, run_batch
from postproc.comparison import DiffReport, DiffTolerance
from postproc.comparison import diff as diff_programs
from postproc.emitters import EMITTERS, Emitter
from postproc.errors import Finding, UsageError
from postproc.jobs.convert import ConvertRequest
from postproc.jobs.convert import convert as convert_part
from postproc.jobs.lint import lint as lint_programs
from postproc.jobs.stiffness import SpinStiffness
from postproc.jobs.stiffness import stiffness as spin_stiffness
from postproc.jobs.verify import verify as verify_part
from postproc.krl import LintOptions
from postproc.model import ToolPath
from postproc.planning import OBJECTIVES, Objective, StateContext
from postproc.progress import Progress
from postproc.units import DEG, MM
from postproc.verification import Tolerances, VerifyReport


def convert(
    part: ToolPath | Source,
    cell: Cell | Source,
    *,
    name: str | None = None,
    strategy: str | None = None,
    objective: str | Objective | Callable[[StateContext], FloatArray] | None = None,
    preset: str | None = None,
    emitter: str | Emitter | None = None,
    model: Source | None = None,
    pins: Source | None = None,
    partial: bool = False,
    trade: bool = False,
    progress: Progress | None = None,
) -> Job:
    """Return a part planned, checked and written as program text, in memory.

    Args:
        part: a toolpath of ``read``, or a file.
        cell: a cell of ``load_cell``, or a file.
        name: program name; None: that of the input file.
        strategy: ``global``, ``smooth`` or ``each``; None: the cell's.
        objective: name of a registered objective, or a function of states that returns a cost for
            each (N,), lower is better; None: the cell's.
        preset: ``stiffest``, ``balanced`` or ``fastest``; None: the cell's.
        emitter: name of a registered emitter, or an emitter of your own; None: the cell's.
        model: model file of the arm, to compensate what it predicts.
        pins: CSV of spins that tags must have (``tag,spin_deg``).
        partial: keep the good stretches although tags fail.
        trade: plan with the other presets too; ``document["trade"]`` compares them.
        progress: called with (done, total, what).

    Returns:
        The job: verdict, findings, tables, files in memory.

    Raises:
        PostprocError: if the input, the cell or an option is wrong. A tag that cannot be run is no
            error of the call: it is a finding of the job.
    """
    known = cell_of(cell)
    toolpath = part if isinstance(part, ToolPath) else read(part, known)
    request = ConvertRequest(
        source=toolpath.path,
        cell=known.path,
        name=name,
        emitter=_emitter_name(emitter),
        strategy=strategy,
        objective=_objective_name(objective),
        preset=preset,
        model=None if model is None else str(model),
        pins=None if pins is None else str(pins),
        partial=partial,
        trade=trade,
    )
    return Job(convert_part(request, progress, toolpath, known))


def _objective_name(
    objective: str | Objective | Callable[[StateContext], FloatArray] | None,
) -> str | None:
    if objective is None or isinstance(objective, str):
        return objective
    part = objective if isinstance(objective, Objective) else Objective(objective)
    return OBJECTIVES.lend(part, getattr(part.function, "__name__", "objective"))


def _emitter_name(emitter: str | Emitter | None) -> str | None:
    if emitter is None or isinstance(emitter, str):
        return emitter
    return EMITTERS.lend(emitter, type(emitter).__name__)


def batch(
    inputs: Source | Sequence[Source],
    cell: Source | None,
    output: Source,
    *,
    config: Source | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    split: str | None = None,
    strategy: str | None = None,
    objective: str | None = None,
    preset: str | None = None,
    emitter: str | None = None,
    model: Source | None = None,
    timeout_s: float | None = None,
    memory_GiB: float | None = None,
    force: bool = False,
    prune: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    **reading: Any,  # noqa: ANN401 - as of ``read``
) -> BatchOutcome:
    """Convert many inputs into a folder; a second call redoes only what changed or failed.

    Args:
        inputs: files, folders, globs, ``@LIST``.
        cell: cell file; None where ``config`` names it.
        output: folder of the programs and of ``manifest.json``.
        config: ``batch.toml``, options per input.
        jobs: worker processes; None: one per core.
        dask: address of a Dask cluster to run on instead.
        split: ``region:MM``, ``count:N`` or ``operation``: cut large inputs.
        strategy: as of ``convert``.
        objective: name of a registered objective; workers do not know functions of a script.
        preset: as of ``convert``.
        emitter: name of a registered emitter.
        model: as of ``convert``.
        timeout_s: for each input.
        memory_GiB: for each worker.
        force: redo everything.
        prune: remove outputs whose input is gone.
        progress: called with (done, of how many, how many of them failed).
        reading: how the inputs are read, as of ``read``.

    Returns:
        What was done: ``good``, ``done``, ``kept``, ``bad``, ``document()``.

    Raises:
        DataError: if inputs or options are wrong, or another batch holds the folder.
        UsageError: BAT004 without a cell.
    """
    base = ConvertRequest(
        source="",
        cell="" if cell is None else str(cell),
        emitter=emitter,
        strategy=strategy,
        objective=objective,
        preset=preset,
        model=None if model is None else str(model),
        **reading,
    )
    options = BatchOptions(jobs, dask, force, prune, timeout_s, memory_GiB, split)
    given = [inputs] if isinstance(inputs, Source) else inputs
    called = None if config is None else str(config)
    todo, _ = call_of([str(each) for each in given], base, options, called)
    return run_batch(todo, Path(output), options, progress)


def stiffness(
    part: ToolPath | Source,
    cell: Cell | Source,
    *,
    model: Source | None = None,
    tags: Sequence[str] | None = None,
    step_deg: float | None = None,
    most: int = 24,
) -> SpinStiffness:
    """Return the stiffness of tags over the rotation about the tool axis.

    Args:
        part: a toolpath of ``read``, or a file.
        cell: a cell of ``load_cell``, or a file.
        model: model file whose joint stiffness counts instead of the cell's.
        tags: names; None: key tags.
        step_deg: of the rotation; None: the cell's.
        most: how many key tags.

    Returns:
        ``good``, ``curves``, ``document``, ``report(file)``.

    Raises:
        CellError: PLN208 without joint stiffness.
        DataError: MOD008 if the model has none; STF027 for a tag that is not there.
    """
    known = cell_of(cell)
    return spin_stiffness(
        part if isinstance(part, ToolPath) else read(part, known),
        known,
        model=None if model is None else str(model),
        tags=None if tags is None else ",".join(tags),
        step=None if step_deg is None else step_deg * DEG,
        most=most,
    )


def verify(
    program: Source,
    cell: Cell | Source,
    *,
    against: ToolPath | Source | None = None,
    model: Source | None = None,
    tol_mm: float = 0.01,
    tol_deg: float = 0.005,
    collisions: bool = True,
    progress: Progress | None = None,
) -> VerifyReport:
    """Return what the text of a program does on the robot model.

    Args:
        program: the .src file to start; sub-programs are taken from beside it.
        cell: the cell it is to run in.
        against: the toolpath or CAM file it was made from: every point, axis, arc, feed, hole,
            dwell and event of it must be found.
        model: model file of the arm: where the real, loaded tool lands is what counts.
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
    known = cell_of(cell)
    if model is not None and against is None:
        raise UsageError("VER002", "a model needs a CAM file: the real tool is compared with it")
    toolpath = against
    if toolpath is not None and not isinstance(toolpath, ToolPath):
        toolpath = read(toolpath, known)
    tolerances = Tolerances(_positive("tol_mm", tol_mm) * MM, _positive("tol_deg", tol_deg) * DEG)
    arm = None if model is None else load_model(model)
    return verify_part(program, known, toolpath, tolerances, collisions, progress, arm)


def lint(
    *programs: Source, config: Sequence[Source] = (), options: LintOptions | None = None
) -> tuple[Finding, ...]:
    """Return what a controller would refuse or silently change in programs.

    Args:
        programs: .src and .dat files, or folders with all modules in them.
        config: data lists whose names are known, such as ``$config.dat``.
        options: the controller, and what else is there.

    Returns:
        Findings in the order of files and lines.

    Raises:
        KrlError: if a file is no KRL.
        ReadError: if a file is missing.
    """
    return lint_programs(programs, options, config)[0]


def diff(old: Source, new: Source, *, tol_mm: float = 0.001, tol_deg: float = 0.001) -> DiffReport:
    """Return what the robot would do differently with the new program or folder.

    Args:
        old: a .src file with the sub-programs beside it, or a folder.
        new: likewise.
        tol_mm: shift that counts as the same [mm].
        tol_deg: rotation that counts as the same [deg].

    Returns:
        Differences in the order of the old program.

    Raises:
        KrlError: if a file is no KRL.
        ReadError: if a file is missing.
        UsageError: VER003 if a tolerance is negative or not finite.
    """
    tolerance = DiffTolerance(
        _positive("tol_mm", tol_mm, or_zero=True), _positive("tol_deg", tol_deg, or_zero=True)
    )
    return diff_programs(str(old), str(new), tolerance)


def _positive(name: str, value: float, *, or_zero: bool = False) -> float:
    """Return a tolerance that differences can be held against: against NaN, none is too large."""
    is_number = isinstance(value, int | float) and math.isfinite(value)
    if is_number and (value > 0.0 or (or_zero and value == 0.0)):
        return value
    expected = "a finite number, 0 or above" if or_zero else "a finite number above 0"
    raise UsageError("VER003", f"{name} is {value!r}, expected {expected}")
