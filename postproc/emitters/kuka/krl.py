"""KUKA KRL as an emitter: writes with ``emit``, reads back with lint, parser and interpreter."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.controller import MotionType, Trace
from postproc.emitters.base import EMITTERS, Against, Emitter, Program, ReadBack
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.emitters.kuka.template import TemplateSet
from postproc.errors import Finding, RunKind, Severity, SourceRef
from postproc.geometry import inverse
from postproc.kinematics import Kinematics, build
from postproc.krl import Call, KrlModule, NameAllocator, Routine, lint, parse_files
from postproc.model import MoveKind, Plan
from postproc.paths import Displacement, Paths, joint_paths, run_in_cell
from postproc.verification import VerifyReport, verify

_KIND_OF = {MotionType.PTP: MoveKind.PTP, MotionType.CIRC: MoveKind.CIRC}
_KINDS = np.array([_KIND_OF.get(word, MoveKind.LIN) for word in MotionType])
"""Kinds of moves by the numbers of ``MotionType``."""
_REAL = (RunKind.POSITION, RunKind.PATH, RunKind.DEPTH)
"""Violations that may be those of the arm and not of the text."""


class KukaKrl(Emitter):
    """Programs for KUKA controllers KR C4 and KR C5."""

    def emit(self, plan: Plan, cell: Cell) -> Program:
        """Return .src and .dat files; errors as ``kuka.emitter.emit``."""
        names = NameAllocator()
        modules = emit(plan, cell, names=names)
        return Program(modules[0].name, render_files(modules), names.changes)

    def read_back(self, program: Program, cell: Cell, against: Against) -> ReadBack:
        """Judge the text by lint and by the very ``verify`` that users run, collisions included."""
        modules = parse_files(program.files)
        report = verify(
            modules,
            program.name,
            cell,
            toolpath=against.toolpath,
            displacement=against.displacement,
        )
        noticed = [i for i in lint(modules) if i.severity is not Severity.NOTE]
        warned = (item for item in report.warnings if not item.headline)  # the job says these
        templates = TemplateSet(cell.krl.template, SourceRef(cell.path))
        judged = _violations(report, against.displacement)
        findings = (*noticed, *warned, *_blamed(judged, program, templates, cell.krl.hooks))
        return _read_back(report, findings)

    def paths(self, plan: Plan, cell: Cell, kinematics: Kinematics) -> Paths:
        """Return how the joints move, as the interpreter runs the program."""
        modules = emit(plan, cell)
        trace = run_in_cell(modules, modules[0].name, cell, kinematics)
        return joint_paths(trace, cell, kinematics)

    def caller(self, name: str, programs: Sequence[str]) -> Program:
        """Return a program that calls others in order; each sets itself up."""
        routine = Routine(name, tuple(Call(program) for program in programs))
        module = KrlModule(name, (routine,), attributes=("ACCESS RVP", "REL 1"))
        return Program(name, render_files([module]))


EMITTERS.register("kuka_krl")(KukaKrl())


def _violations(report: VerifyReport, displacement: Displacement | None) -> Iterator[Finding]:
    """Yield what the check finds against the text; one warning for small effects within lines."""
    expected = report.expectation
    is_excused = bool(expected and displacement and expected.expected_max < displacement.left)
    left = [violation for violation in report.violations if is_excused and violation.code in _REAL]
    for violation in report.violations:
        if violation not in left:
            yield Finding(
                Severity.ERROR,
                "CNV002",
                f"{_FAILS}{violation.code}: {violation.message}",
                source=violation.source,
                hint="this is a fault of postproc, not of the input; please report it",
            )
    if left:
        text = f"at {len(left)} places effects that follow the motion remain: {left[0].message}"
        hint = "lower the feed, or see verify --model for all of them"
        yield Finding(Severity.WARNING, "CMP006", text, source=left[0].source, hint=hint)


def _blamed(
    findings: Iterable[Finding], program: Program, templates: TemplateSet, hooks: Mapping[str, str]
) -> Iterator[Finding]:
    """Yield findings; those on lines of the cell's own templates as faults of these."""
    if templates.own is None:
        yield from findings
        return
    texts = {name: _lines(content) for name, content in program.files.items()}
    for finding in findings:
        if finding.code != "CNV002":
            yield finding
            continue
        source = finding.source
        rows = texts.get(Path(source.path).name, []) if source else []
        row = rows[source.line - 1] if source and 0 < source.line <= len(rows) else ""
        origin = templates.origin(row) if row.strip() else None
        fault = finding.message.removeprefix(_FAILS)
        silent = [k for k, name in hooks.items() if f" calls of {name}," in fault]
        file = templates.own / f"{silent[0]}.j2" if silent else None
        if file is not None and file.is_file():
            text = f"the template of {silent[0]} does not call {hooks[silent[0]]}: {fault}"
            hint = f"name the routine that it calls: [krl.hooks] {silent[0]} = ..."
            source = templates.file(silent[0])
            yield Finding(Severity.ERROR, "EMT336", text, source=source, hint=hint)
        elif origin is None:
            yield replace(finding, hint=f"the cell's own templates replace built-in ones: {_KEYS}")
        else:
            text = f"the template gives {row.strip()[:60]!r}: {fault}"
            yield Finding(Severity.ERROR, "EMT336", text, source=origin, hint=_KEYS)


_FAILS = "the program text fails its check: "
_KEYS = (
    "[krl.hooks] names the routine of an event, [verify] accept what is harmless; "
    "check CELL --templates tests them"
)


def _lines(content: bytes) -> list[str]:
    """Return the lines of a program file."""
    return content.decode("ascii", "replace").splitlines()


def _read_back(report: VerifyReport, findings: tuple[Finding, ...]) -> ReadBack:
    if report.run is None:
        raise ValueError("a verification without its run")
    paths = report.run.paths
    trace = paths.trace
    aux = np.full((len(trace), 3), np.nan)
    for row, values in trace.auxiliary.items():
        aux[row] = values[:3]
    return ReadBack(
        kind=_KINDS[trace.motion_type],
        q=paths.q,
        aux=aux,
        external=paths.external,
        point=_points(trace, paths),
        file=trace.file,
        line=trace.line,
        files=trace.files,
        findings=findings,
        expectation=report.expectation,
    )


def _points(trace: Trace, paths: Paths) -> FloatArray:
    """Return the TCP (m, 3) [m] at the end of each motion as the text says it, workpiece frame."""
    point = np.array(trace.target[:, :3])
    axes = np.asarray(trace.is_axes)
    if axes.any():
        kinematics = build(paths.station.cell.robot)
        tools = trace.tools[trace.column("tool").astype(np.int64)]
        T_robroot_tcp = kinematics.fk(trace.target[axes]) @ tools[axes]
        bases = trace.bases[trace.column("base").astype(np.int64)]
        point[axes] = (inverse(bases[axes]) @ T_robroot_tcp)[:, :3, 3]
    return point
