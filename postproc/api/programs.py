"""What Python calls otherwise than the command line: objects for names, arrays for files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from postproc.api.cells import Cell, cell_of
from postproc.api.job import Job
from postproc.arrays import FloatArray
from postproc.batch import BatchOptions, BatchOutcome, call_of, run_batch
from postproc.cell import Cell as CellValues
from postproc.cell import call_keys
from postproc.comparison import DiffReport, DiffTolerance
from postproc.comparison import diff as diff_programs
from postproc.emitters import EMITTERS, Emitter
from postproc.errors import Finding
from postproc.gap import Prediction
from postproc.jobs.convert import ConvertRequest
from postproc.jobs.convert import convert as convert_part
from postproc.jobs.given import Source, known_keys, model_of, part_of
from postproc.jobs.lint import lint as lint_programs
from postproc.jobs.readings import predict as predict_rows
from postproc.jobs.verify import at_least
from postproc.krl import LintOptions
from postproc.model import ModelFile, ToolPath
from postproc.planning import OBJECTIVES, Objective, StateContext
from postproc.progress import Progress
from postproc.readers import holes_of


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
    toolpath = part_of(part, known)
    request = ConvertRequest(
        source=toolpath.path,
        cell=known.path,
        keys=call_keys(
            {
                "emitter": _emitter_name(emitter),
                "objective": _objective_name(objective),
                "strategy": strategy,
                "preset": preset,
            }
        ),
        name=name,
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
    model: Source | None = None,
    timeout_s: float | None = None,
    memory_GiB: float | None = None,
    force: bool = False,
    prune: bool = False,
    recover: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    **keys: Any,  # noqa: ANN401 - keys of the cell
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
        model: as of ``convert``.
        timeout_s: for each input.
        memory_GiB: for each worker.
        force: redo everything.
        prune: remove outputs whose input is gone.
        recover: as of ``read``.
        progress: called with (done, of how many, how many of them failed).
        keys: instead of those of the cell, by name: ``strategy``, ``objective``, ``preset``,
            ``emitter`` (workers do not know functions of a script), and those of ``read``.

    Returns:
        What was done: ``good``, ``done``, ``kept``, ``bad``, ``document()``.

    Raises:
        DataError: if inputs or options are wrong, or another batch holds the folder.
        TypeError: for a key that is none of these.
        UsageError: BAT004 without a cell.
    """
    base = ConvertRequest(
        source="",
        cell="" if cell is None else str(cell),
        keys=known_keys(keys),
        model=None if model is None else str(model),
        recover=recover,
    )
    options = BatchOptions(jobs, dask, force, prune, timeout_s, memory_GiB, split)
    given = [inputs] if isinstance(inputs, Source) else inputs
    called = None if config is None else str(config)
    todo, _ = call_of([str(each) for each in given], base, options, called)
    return run_batch(todo, Path(output), options, progress)


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
        at_least("tol_mm", tol_mm, or_zero=True), at_least("tol_deg", tol_deg, or_zero=True)
    )
    return diff_programs(str(old), str(new), tolerance)


def predict(
    measurements: Source,
    cell: CellValues | Source,
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
    return predict_rows(measurements, cell_of(cell).for_tool(tool), model_of(model), register)[0]


def holes(
    xyz_mm: ArrayLike,
    axes: ArrayLike,
    *,
    depth: ArrayLike | None = None,
    feed: ArrayLike | None = None,
    rpm: ArrayLike | None = None,
    peck: ArrayLike | None = None,
    dwell: ArrayLike | None = None,
    diameter: ArrayLike | None = None,
    clearance: ArrayLike | None = None,
    retract: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    name: str = "holes",
) -> ToolPath:
    """Return holes from arrays, as a point list with these columns gives them.

    Args:
        xyz_mm: (n, 3) points on the surface, CAM coordinates.
        axes: (n, 3) from the tip of the tool to its holder.
        depth: of the holes [mm], one number or (n,), as all below; None: points to touch.
        feed: [mm/min]; None: the cell's.
        rpm: spindle speed [1/min], negative: counterclockwise; None: the cell's.
        peck: step of deep holes [mm].
        dwell: at the bottom [s].
        diameter: of the holes [mm].
        clearance: height where the feed starts [mm].
        retract: height where the tool ends [mm].
        names: (n,) ids.
        name: of the part and its program.

    Returns:
        Tags whose source line is their number, for ``convert`` and ``stiffness``.

    Raises:
        ReadError: if a number cannot be, such as a negative depth.
        UsageError: CSV041 for arrays of another shape, or numbers that are not finite.
    """
    columns = {
        "depth": depth, "feed": feed, "spindle": rpm, "peck": peck, "dwell": dwell,
        "diameter": diameter, "clearance": clearance, "retract": retract,
    }  # fmt: skip
    return holes_of(name, xyz_mm, axes, columns, names)
