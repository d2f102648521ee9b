"""The main job: CAM toolpath in, checked program out.

Nothing is written while one finding is an error, and the text that is written has been read back,
run on the robot model and compared with the CAM path first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, shared_cell
from postproc.emitters import Against, Program, ReadBack, emit, emitter_of, former_parts, read_back
from postproc.errors import CellError, DataError, Finding, PostprocError, Severity, SourceRef, fold
from postproc.files import remove_files, write_files
from postproc.jobs.arm_doubts import place_findings, size_findings, warned_doubts
from postproc.jobs.causes import Cause, causes
from postproc.jobs.given import read
from postproc.jobs.trade import Outcome, lost_percent, outcomes
from postproc.kinematics import build
from postproc.krl import legal_name
from postproc.model import AlongPath, ModelFile, Plan, ToolPath, load_model
from postproc.planning import (
    PlanOptions,
    grade_counts,
    near_solids,
    repairs_tried,
    settle,
    tag_clearances,
)
from postproc.planning import plan as plan_toolpath
from postproc.process import (
    as_served,
    assign,
    assumptions,
    driven,
    feed_findings,
    from_below,
    looks,
    machining_findings,
    restart_notes,
    start_findings,
    stationary,
    unit_findings,
    word_findings,
    words_settled,
)
from postproc.progress import Clock, Progress
from postproc.readers import read_pins
from postproc.records import dataclass
from postproc.units import DEG, MM, N_PER_MM

if TYPE_CHECKING:
    from postproc.jobs.kept import Kept

NEAR_SURFACE = 1.0 * MM
"""Up to this distance [m] the workpiece's normal is one to hold that of a hole against."""
REASONS = {
    "PLN101": "unreachable",
    "PLN102": "joint_limit",
    "PLN103": "singular",
    "PLN104": "collision",
    "PLN105": "speed",
    "PLN205": "speed",
    "PLN206": "unreachable",
}
"""Finding code of a failing tag to the reason of the JSON document. A tag without a feed has no
speed, one without a Cartesian target no place to reach. Findings about the whole program, and not
about a tag, have the reason ``check``."""


@dataclass(frozen=True, slots=True)
class ConvertRequest:
    """What to convert, with what in place of keys of the cell, and what no cell can say."""

    source: str
    cell: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    """Keys of the cell that the call gives, as of ``call_keys``."""
    name: str | None = None
    recover: bool = False
    model: str | None = None
    pins: str | None = None
    keep: str | None = None
    """A program, folder or manifest, of which poses are kept where that costs little."""
    partial: bool = False
    trade: bool = False
    """Plan with the other presets too, to compare."""

    def cell_with_keys(self, cell: Cell | None = None) -> Cell:
        """Return the cell, that of the file where none is given, with the keys of the call."""
        return (cell or shared_cell(self.cell)).with_keys(self.keys)


@dataclass(frozen=True, slots=True)
class Conversion:
    """A finished conversion: the plan, the program files by name, findings and times.

    ``cell``: with the emitter, the strategy and the objective of the call, and what a model knows
    of the arm. ``read``: what the program text says, None where none was written. ``trade``: what
    each preset would make of it, where that was asked. ``causes``: why tags fail, and what cures
    it. ``kept``: how much of an old program, where that was asked.
    """

    cell: Cell
    toolpath: ToolPath
    plan: Plan
    files: Mapping[str, bytes]
    name: str
    findings: tuple[Finding, ...]
    timing: Mapping[str, float] = field(default_factory=dict)
    read: ReadBack | None = None
    trade: tuple[Outcome, ...] = ()
    causes: tuple[Cause, ...] = ()
    kept: Kept | None = None

    @property
    def good(self) -> bool:
        """Whether every tag can be run and every check passed."""
        return not any(finding.is_error for finding in self.findings)


def convert(
    request: ConvertRequest,
    progress: Progress | None = None,
    toolpath: ToolPath | None = None,
    cell: Cell | None = None,
) -> Conversion:
    """Convert one CAM file; pure but for reading files.

    Args:
        request: input, cell and options.
        progress: called with (done, total, what).
        toolpath: what was read before; None reads the input.
        cell: what was loaded before; None loads it.

    Returns:
        The conversion; ``files`` is empty when a tag fails (unless ``partial``) or a check fails.

    Raises:
        PostprocError: if the input, the cell or an option is wrong.
    """
    clock = Clock("read", progress)
    cell = request.cell_with_keys(cell)
    settle(cell)
    emitter_of(cell)  # before hours of work
    if toolpath is None:
        toolpath = read_toolpath(request, cell)
    if request.pins:
        cell = with_pins(cell, toolpath, request.pins)
    model = None
    if request.model:
        from postproc.compensation import cell_with_model

        model = load_model(request.model)
        cell = cell_with_model(cell, model)
    served = as_served(toolpath, cell)
    words = (
        *size_findings(cell, build(cell.robot)),
        *place_findings(served, cell),
        *warned_doubts(cell),
        *word_findings(words_settled(toolpath, cell)),
        *looks(toolpath, _outward(toolpath, cell)),
        *from_below(toolpath, cell),
        *start_findings(served, cell),
        *machining_findings(driven(served, cell), cell),
        *unit_findings(toolpath, cell),
        *feed_findings(toolpath, cell),
        *restart_notes(toolpath, cell),
    )
    clock.begin("plan")
    kept: Kept | None = None
    if any(finding.is_error for finding in words):
        plan = Plan.nothing(toolpath, request.name or toolpath.name, words)
    else:
        make = partial(make_plan, cell=cell, request=request, progress=progress, model=model)
        if request.keep is None:
            plan = make(toolpath)
        else:
            plan, kept = _kept(toolpath, cell, request, make)
        plan = replace(plan, findings=(*words, *plan.findings))
    clock.begin("emit")
    program, findings, read = _emit_checked(plan, cell, request, clock, model)
    trade: tuple[Outcome, ...] = ()
    if request.trade and not any(finding.is_error for finding in words):
        clock.begin("trade")
        trade = outcomes(
            plan, cell, lambda here: make_plan(toolpath, here, request, progress, model)
        )
    files, name = program.files, program.name
    times = clock.total()
    return Conversion(cell, toolpath, plan, files, name, findings, times, read, trade, kept=kept)


def explained(
    conversion: Conversion, request: ConvertRequest, progress: Progress | None = None
) -> Conversion:
    """Return a conversion that failed with its causes; each cure is one that was converted with."""
    if conversion.good or request.model:
        return conversion
    now = conversion.cell
    again = replace(request, keys={}, pins=None, keep=None, trade=False, partial=False)

    def read_with(cell: Cell) -> ToolPath:
        axes = [
            tool.known_axis is old.known_axis
            for tool, old in zip(cell.tools, now.tools, strict=True)
        ]
        same = cell.reading == now.reading and all(axes)
        return conversion.toolpath if same else read_toolpath(again, cell)

    def is_good(cell: Cell) -> bool:
        try:
            return convert(again, None, read_with(cell), cell).good
        except PostprocError:
            return False

    errors = conversion.plan.errors
    found = causes(conversion.toolpath, now, errors, is_good, read_with, progress)
    return replace(conversion, causes=found)


def read_toolpath(request: ConvertRequest, cell: Cell) -> ToolPath:
    """Return what a request reads, with what the cell knows; errors as ``read``."""
    return read(request.source, request.cell_with_keys(cell), recover=request.recover)


def with_pins(cell: Cell, toolpath: ToolPath, path: str) -> Cell:
    """Return the cell with the pins of a file added to its own; those of the file count first."""
    pins = read_pins(path)
    names = {toolpath.tag_name(tag) for tag in range(len(toolpath))}
    for pin in pins:
        if pin.tag not in names:
            near = get_close_matches(pin.tag, sorted(names), 1)
            raise DataError(
                "PIN007",
                f"no tag of {toolpath.path} is named {pin.tag!r}",
                pin.source,
                hint=f"the nearest is {near[0]}" if near else "inspect --json counts the tags",
            )
    merged = {**cell.optimize.pins, **{pin.tag: pin.spin_deg * DEG for pin in pins}}
    return replace(cell, optimize=replace(cell.optimize, pins=merged))


def _outward(toolpath: ToolPath, cell: Cell) -> FloatArray | None:
    """Return the outward normals (n, 3) of the workpiece where the tool stands, NaN elsewhere."""
    if not any(base.meshes for base in cell.bases):
        return None
    from postproc.collision import Scene

    served, kinematics = assign(toolpath, cell), build(cell.robot)
    normals = np.full((len(toolpath), 3), np.nan)
    for index, base in enumerate(cell.bases):
        rows = np.flatnonzero(stationary(toolpath) & (served.base == index)) if base.meshes else ()
        if len(rows):
            scene = Scene.shared(cell.with_tool(cell.tool_index, index), kinematics)
            found = scene.nearest_surface(served.toolpath.points[rows])
            near = found.distance <= NEAR_SURFACE
            normals[rows[near]] = found.normal[near]
    return normals


def _kept(
    toolpath: ToolPath, cell: Cell, request: ConvertRequest, make: Callable[[ToolPath], Plan]
) -> tuple[Plan, Kept]:
    """Return the plan that ``make`` returns by poses of an old program, and what it keeps of it."""
    from postproc.jobs.kept import old_program, plan_kept, poses_of

    name = legal_name(request.name or toolpath.name)
    program = old_program(str(request.keep), name)
    old = None if program is None else poses_of(program, cell)
    return plan_kept(toolpath, cell, old, make)


def make_plan(
    toolpath: ToolPath,
    cell: Cell,
    request: ConvertRequest,
    progress: Progress | None,
    model: ModelFile | None = None,
) -> Plan:
    """Plan the toolpath and compensate it when a model is given."""
    options = PlanOptions(partial=request.partial, name=request.name)
    kept = cell
    if model is not None:
        from postproc.compensation import with_shift_margin

        kept = with_shift_margin(cell)
    result = plan_toolpath(toolpath, kept, options, progress)
    if model is not None and len(result) and (request.partial or not result.errors):
        from postproc.compensation import compensate

        result = compensate(result, cell, model)
    return result


def _emit_checked(
    plan: Plan, cell: Cell, request: ConvertRequest, clock: Clock, model: ModelFile | None
) -> tuple[Program, tuple[Finding, ...], ReadBack | None]:
    """Return the program, all findings and what the text says; no files when the check fails."""
    findings = [*plan.toolpath.warnings, *plan.toolpath.recovered, *plan.findings]
    if len(plan) == 0 or (plan.errors and not request.partial):
        return Program(plan.name, {}), fold(findings), None
    program = emit(plan, cell)
    findings += [
        Finding(Severity.NOTE, "CNV010", f"{wanted!r} was changed to the program name {got}")
        for wanted, got in program.renamed
    ]
    clock.begin("check")
    read = read_back(program, plan, cell, _against(plan, cell, model))
    if any(finding.is_error for finding in read.findings):
        program = replace(program, files={})
    return program, fold([*findings, *read.findings]), read


def _against(plan: Plan, cell: Cell, model: ModelFile | None) -> Against:
    """Return what the text has to do: a compensated one is judged by where the real tool goes."""
    toolpath = None if plan.errors else plan.toolpath
    if model is None:
        return Against(toolpath)
    from postproc.compensation import RealArm, as_planned

    if plan.compensation is None:
        return Against(toolpath)
    real = RealArm.of(cell, model).on_runs
    if plan.shift_along is not None:
        real = replace(real, along=as_planned(plan))
    return Against(toolpath, real)


def failures(conversion: Conversion) -> list[dict[str, Any]]:
    """Return the failing tags as the JSON document lists them."""
    rows = []
    for finding in conversion.findings:
        if finding.severity is not Severity.ERROR:
            continue
        row: dict[str, Any] = {
            "tag": finding.tag_index,
            "line": finding.source.line if finding.source else None,
            "reason": REASONS.get(finding.code, "check"),
            "detail": finding.message,
            "code": finding.code,
        }
        if finding.hint:
            row["hint"] = finding.hint
        rows.append(row)
    return rows


def document(conversion: Conversion) -> dict[str, Any]:
    """Return the ``postproc.convert/1`` document."""
    plan = conversion.plan
    return {
        "schema": "postproc.convert/1",
        "program": conversion.name,
        "files": list(conversion.files),
        "tags": len(conversion.toolpath),
        "assumed": list(assumptions(conversion.toolpath, conversion.cell)),
        "points": len(plan),
        "left_out": _left_out(plan),
        "failures": failures(conversion),
        "causes": [cause.to_dict() for cause in conversion.causes],
        "grades": grade_counts(plan, conversion.cell),
        "clearance": smallest_clearance(conversion),
        "stiffness": _stiffness(conversion),
        **({} if conversion.kept is None else {"kept": conversion.kept.to_dict()}),
        "trade": [outcome.to_dict() for outcome in conversion.trade],
        "compensation": _compensation(conversion),
        "cycle_time_s": round(plan.cycle_time, 3),
        "tried": repairs_tried(plan),
        "warnings": [
            {
                "line": finding.source.line if finding.source else None,
                "text": finding.message,
                "code": finding.code,
                "count": finding.count,
            }
            for finding in conversion.findings
            if finding.severity is Severity.WARNING
        ],
        "timing_s": {stage: round(seconds, 4) for stage, seconds in conversion.timing.items()},
    }


def smallest_clearance(conversion: Conversion) -> dict[str, Any] | None:
    """Return the smallest distance of solids where the tool works, and which; None without any.

    Solids farther apart than what is measured at all are no pair.
    """
    from postproc.collision import Scene

    plan, cell = conversion.plan, conversion.cell
    if not np.isfinite(plan.clearance).any():
        return None
    tag = int(np.nanargmin(plan.clearance))
    value = float(plan.clearance[tag])
    entry: dict[str, Any] = {
        "asked_mm": round(cell.limits.clearance / MM, 6),
        "smallest_mm": round(value / MM, 3),
        "pair": None,
        "tag": None,
        "line": None,
    }
    most = near_solids(cell)
    if value >= most:
        return entry
    here = plan.rows(np.flatnonzero(plan.tag == tag))
    frames = int(here.tool_of_moves[0]), int(here.base_of_moves[0])
    scene = Scene.shared(cell.with_tool(*frames), build(cell.robot))
    pair = int(tag_clearances(here, scene, most)[1][tag])
    names = list(scene.pairs[pair]) if pair >= 0 else None
    line = int(plan.toolpath.line[tag])
    return {**entry, "pair": names, "tag": plan.toolpath.tag_name(tag), "line": line}


def _left_out(plan: Plan) -> dict[str, Any] | None:
    """Return how many CAM points the program passes only, and how far off at most."""
    left = plan.left_out
    if not left.any():
        return None
    return {
        "points": int(left.sum()),
        "chord_mm": round(float(np.nanmax(np.asarray(plan.off_chord))) / MM, 6),
        "axis_deg": round(float(np.nanmax(np.asarray(plan.off_axis))) / DEG, 6),
    }


def _stiffness(conversion: Conversion) -> dict[str, Any] | None:
    plan = conversion.plan
    values = plan.stiffness[np.isfinite(plan.stiffness)]
    if not len(values):
        return None
    initial = plan.stiffness_initial[np.isfinite(plan.stiffness_initial)]
    objective = conversion.cell.optimize.objective
    return {
        "objective": objective if isinstance(objective, str) else dict(objective),
        "initial_mean_N_per_mm": float(initial.mean() / N_PER_MM) if len(initial) else None,
        "mean_N_per_mm": float(values.mean() / N_PER_MM),
        "min_N_per_mm": float(values.min() / N_PER_MM),
        **lost_percent(plan),
    }


def _compensation(conversion: Conversion) -> dict[str, Any] | None:
    shift = conversion.plan.compensation
    if shift is None:
        return None
    largest = float(np.linalg.norm(shift, axis=1).max(initial=0.0))
    expected = None if conversion.read is None else conversion.read.expectation
    return {
        "note": conversion.plan.compensation_note,
        "max_shift_mm": round(largest / MM, 6),
        **({} if expected is None else expected.to_dict()),
        **_doubt(conversion.plan),
        **_along(conversion.plan.along_path),
    }


def _along(told: AlongPath | None) -> dict[str, Any]:
    """Return how far the tool is expected off the path of the cuts, where a trace has told."""
    if told is None:
        return {}
    own = {"plain_rms_mm": told.plain_rms, "plain_max_mm": told.plain_max}
    own |= {"rms_mm": told.rms, "max_mm": told.max}
    expected = float(np.hypot(told.rms, told.rest_rms))
    plain = float(np.hypot(told.plain_rms, told.rest_rms))
    own |= {"expected_rms_mm": expected, "expected_plain_rms_mm": plain}
    # the check of the text looks past what is left along the path
    off = {"max": told.max, "rms": expected}
    points = {f"expected_{n}_position_error_mm": round(v / MM, 6) for n, v in off.items()}
    rows = {name: round(value / MM, 6) for name, value in own.items()}
    ends = [round(v / MM, 6) if np.isfinite(v) else None for v in (told.low, told.high)]
    path = {"effects": list(told.effects), **rows, "expected_rms_ci_mm": ends}
    path |= {"slowed_moves": told.slowed, "least_feed_percent": round(100.0 * told.least_share)}
    return {**points, "along_path": path}


def _doubt(plan: Plan) -> dict[str, Any]:
    """Return how sure the compensated point of each tag is, where the model says."""
    radius, inside = plan.compensation_u95, plan.compensation_inside
    if radius is None or inside is None:
        return {}
    tags = np.asarray(plan.tag)
    rows = []
    for tag in np.unique(tags[tags >= 0]).tolist():
        own = np.flatnonzero(tags == tag)
        worst = own[np.argmax(radius[own])]
        rows.append(
            {
                "tag": int(tag),
                "name": plan.toolpath.tag_name(tag),
                "compensation_u95_mm": round(float(radius[worst]) / MM, 6),
                "inside": bool(np.all(inside[own])),
            }
        )
    return {"tags": rows}


def land(
    conversion: Conversion, folder: Path, more: Mapping[Path, bytes] | None = None
) -> tuple[tuple[str, ...], tuple[Finding, ...]]:
    """Write the program files and ``more`` whole, and remove the parts that a former one left.

    Returns the names of the files that were removed, and a finding where others stay.
    """
    if folder.exists() and not folder.is_dir():
        raise CellError("CEL902", "the output is not a folder", SourceRef(str(folder)))
    former = former_parts(folder, conversion.name, conversion.files)
    written = {folder / name: content for name, content in conversion.files.items()}
    write_files({**written, **(more or {})})
    remove_files(folder / name for name in former.ours)
    return former.ours, former.findings(folder)
