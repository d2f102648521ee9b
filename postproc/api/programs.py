"""Programs from Python: read a part, convert it, verify, lint and compare what was written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from postproc.api.job import Job
from postproc.cell import Cell, shared_cell
from postproc.comparison import DiffReport, DiffTolerance
from postproc.comparison import diff as diff_programs
from postproc.errors import Finding, UsageError
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.jobs.convert import convert as convert_part
from postproc.jobs.lint import lint as lint_programs
from postproc.jobs.verify import verify as verify_part
from postproc.krl import LintOptions
from postproc.model import ModelFile, ToolPath
from postproc.model import load_model as load_model_file
from postproc.progress import Progress
from postproc.units import DEG, MM
from postproc.verification import Tolerances, VerifyReport

Source = str | Path
"""A path, as text or as ``Path``."""


def load_cell(path: Source) -> Cell:
    """Return the cell of a ``cell.toml``; the same object until one of its files changes.

    Args:
        path: the cell file.

    Returns:
        The cell, read-only.

    Raises:
        CellError: if the file or something that it names is wrong.
        ReadError: if the file is missing.
    """
    return shared_cell(str(path))


def load_model(path: Source) -> ModelFile:
    """Return what a ``model.toml`` knows of an arm beyond its nominal geometry.

    Args:
        path: the model file.

    Returns:
        Its effects and its registration.

    Raises:
        DataError: if the file is wrong.
    """
    return load_model_file(str(path))


def read(
    path: Source,
    cell: Cell,
    *,
    format: str | None = None,
    dialect: str | None = None,
    units: str | None = None,
    columns: str | None = None,
    cycle_words: str | None = None,
    feed_units: str | None = None,
    arc_sense: str | None = None,
    task: str | None = None,
    accept_words: Sequence[str] | str = (),
    recover: bool = False,
) -> ToolPath:
    """Return the toolpath of a CAM file, in the CAM file's own coordinates.

    What is left open is read as ``[import]`` of the cell says.

    Args:
        path: APT/CL, CSV or DELMIA file, or whatever a registered reader reads.
        cell: tells the tool axis, and the surface where a CSV gives no normals.
        format: ``auto`` or the name of a reader; None: the cell's, else ``auto``.
        dialect: APT dialect: ``nx``, ``solidworks``, ``creo``, ``catia``, ``camworks``, ``fusion``,
            ``hsmworks``, ``mfgsuite``, ``camplete``, ``manusnc``, ``postworks``, ``surfcam``,
            ``apt``.
        units: ``mm`` or ``inch`` where the file names none.
        columns: columns of a CSV, such as ``id,x,y,z,i,j,k,-,depth``.
        cycle_words: meaning of the numbers of a positional drill cycle: ``depth,clearance,feed``.
        feed_units: ``mm`` or ``inch`` per minute where FEDRAT and UNITS contradict each other.
        arc_sense: ``ccw`` or ``cw`` about their vector, for arcs whose records leave it open.
        task: DELMIA task to read instead of all that no other one calls.
        accept_words: words of the file that are harmless, besides those that the cell accepts; a
            text has commas between.
        recover: mend faults that have one possible meaning; each is listed in ``recovered``.

    Returns:
        Tags with their source lines, in SI.

    Raises:
        ReadError: if the file cannot be read as its format.
        UsageError: if an option is wrong.
    """
    request = ConvertRequest(
        source=str(path),
        cell=cell.path,
        format=format,
        dialect=dialect,
        units=units,
        columns=columns,
        cycle_words=cycle_words,
        feed_units=feed_units,
        arc_sense=arc_sense,
        task=task,
        accept_words=accept_words if isinstance(accept_words, str) else tuple(accept_words),
        recover=recover,
    )
    return read_toolpath(request, cell)


def convert(
    part: ToolPath | Source,
    cell: Cell | Source,
    *,
    name: str | None = None,
    strategy: str | None = None,
    objective: str | None = None,
    preset: str | None = None,
    emitter: str | None = None,
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
        objective: name of a registered objective; None: the cell's.
        preset: ``stiffest``, ``balanced`` or ``fastest``; None: the cell's.
        emitter: name of a registered emitter; None: the cell's.
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
    known = cell if isinstance(cell, Cell) else load_cell(cell)
    toolpath = part if isinstance(part, ToolPath) else read(part, known)
    request = ConvertRequest(
        source=toolpath.path,
        cell=known.path,
        name=name,
        emitter=emitter,
        strategy=strategy,
        objective=objective,
        preset=preset,
        model=None if model is None else str(model),
        pins=None if pins is None else str(pins),
        partial=partial,
        trade=trade,
    )
    return Job(convert_part(request, progress, toolpath, known))


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
    known = cell if isinstance(cell, Cell) else load_cell(cell)
    if model is not None and against is None:
        raise UsageError("VER002", "a model needs a CAM file: the real tool is compared with it")
    toolpath = against
    if toolpath is not None and not isinstance(toolpath, ToolPath):
        toolpath = read(toolpath, known)
    tolerances = Tolerances(_positive("tol_mm", tol_mm) * MM, _positive("tol_deg", tol_deg) * DEG)
    arm = None if model is None else load_model(model)
    return verify_part(program, known, toolpath, tolerances, collisions, progress, arm)


def lint(
    *programs: Source,
    config: Sequence[Source] = (),
    options: LintOptions | None = None,
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
