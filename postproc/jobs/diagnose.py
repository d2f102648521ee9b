"""Diagnose a campaign: rows in; verdict, model, page and what to measure next out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from postproc.cell import Cell
from postproc.compensation import split
from postproc.gap import (
    Along,
    Diagnosis,
    Kept,
    along,
    calibrated_urdf,
    certificate,
    document,
    effect_of,
    kept,
    model_file,
    pose_problem,
    summary,
)
from postproc.gap import diagnose as diagnose_problem
from postproc.jobs.given import Source, cell_of, model_of, part_of
from postproc.jobs.measure_next import files as next_files
from postproc.jobs.measure_next import keep_readings, measure_next
from postproc.jobs.paged import Paged, written
from postproc.jobs.readings import readings
from postproc.jobs.self_check import reliability, self_check
from postproc.kinematics import build
from postproc.model import ModelFile, ToolPath, save_model
from postproc.progress import Progress


class DiagnosisJob(Paged):
    """The answer to a campaign. Nothing is on disk before ``write``.

    ``given``: what the simulation knew before; ``path``: where the rows lie on a program;
    ``promise``: what came of the diagnosis of an earlier campaign; ``checked``: the self-check.
    """

    def __init__(
        self,
        diagnosis: Diagnosis,
        cell: Cell,
        given: ModelFile | None,
        path: Along | None,
        promise: Kept | None = None,
        checked: list[dict[str, Any]] | None = None,
    ) -> None:
        self.diagnosis = diagnosis
        self.cell = cell
        self.given = given
        self.path = path
        self.promise = promise
        self.checked = checked
        self.accepted: tuple[str, ...] = ()
        self.following = measure_next(diagnosis, cell)

    def accept(self, names: Sequence[str]) -> None:
        """Let the model hold effects although the instrument may have caused the same.

        Args:
            names: of effects.

        Raises:
            DataError: GAP002 if no effect has such a name.
        """
        self.accepted = tuple(effect_of(name).name for name in names)

    @property
    def verdict(self) -> str:
        """``explained``, ``no_gap`` or ``unexplained``."""
        return self.diagnosis.verdict

    @property
    def adopted(self) -> tuple[str, ...]:
        """The effects that cause the gap, in order of how much of it they remove."""
        return self.diagnosis.adopted

    @cached_property
    def document(self) -> dict[str, Any]:
        """The ``postproc.diagnosis/1`` document, as ``diagnose --json`` prints it."""
        told = document(
            self.diagnosis, self.following.poses, self.path, self.promise, self.accepted
        )
        told |= {"certificate": certificate(self.diagnosis, self.cell)}
        return told if self.checked is None else told | {"self_check": self.checked}

    @property
    def summary(self) -> Sequence[str]:
        """The answer in words, line by line."""
        told = summary(self.document) + (reliability(self.checked) if self.checked else [])
        return told if self.promise is None else [self.promise.line(), *told]

    @property
    def model(self) -> ModelFile:
        """The given model plus what was adopted."""
        found = self._at_rest
        given = {} if self.given is None else self.given.effects
        return replace(found, effects={**given, **found.effects})

    @property
    def _at_rest(self) -> ModelFile:
        """The model without what a recorded path has shown."""
        given = None if self.given is None else split(self.given)[0]
        return model_file(self.diagnosis, given, self.cell.tool, self.accepted)

    def page(self) -> bytes:
        """Return the page: one HTML file that opens offline."""
        from postproc.jobs.drawing import drawing_of
        from postproc.report.pages.diagnosis import diagnosis_page

        drawing = drawing_of(self.cell)
        return diagnosis_page(self.diagnosis, self.document, drawing, self.path)

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write page, ``model.toml``, ``calibrated.urdf`` and what to measure next.

        Args:
            folder: made where it is missing.

        Returns:
            Paths of the files.

        Raises:
            DataError: if the folder holds readings that were filled in by hand.
            ReadError: if the folder cannot be written.
        """
        keep_readings(Path(folder))
        files = {"report.html": self.page(), "model.toml": save_model(self.model)}
        arm = calibrated_urdf(build(self.cell.robot), self.cell, self._at_rest)
        files["calibrated.urdf"] = arm
        return written(folder, files | next_files(self.following, self.diagnosis, self.cell))

    def __repr__(self) -> str:
        """Return verdict and adopted effects on one line."""
        return f"<DiagnosisJob {self.verdict}: {', '.join(self.adopted) or 'no effect adopted'}>"


def diagnose(
    measurements: Source | Sequence[Source],
    cell: Cell | Source,
    *,
    model: ModelFile | Source | None = None,
    register: bool = False,
    program: ToolPath | Source | None = None,
    before: Source | Sequence[Source] = (),
    self_check_trials: int = 0,
    tool: int | None = None,
    progress: Progress | None = None,
) -> DiagnosisJob:
    """Return where a robot misses its model, which effect causes it and how far that shrinks it.

    Args:
        measurements: CSV of a campaign, or several files of one.
        cell: the cell it was measured in, or its file.
        model: what the simulation knows already; what it says of motions along a path waits.
        register: the measured frame and the reflector's place on the tool are unknown: fit them.
        program: toolpath or CAM file; tells where along it the gap lies.
        before: the campaign before the compensation, whose diagnosis knew nothing: promised
            against measured, by row ids.
        self_check_trials: arms of each effect and size that are put into the rows; 0: none.
        tool: TOOL number of the one on the flange, in a cell with several.
        progress: called with (done, total, what).

    Returns:
        The job: verdict, adopted effects, document, model.

    Raises:
        CellError: CEL015 if the cell has several tools and none is named.
        DataError: if a file is wrong or lacks a column, or the campaigns share no rows (GAP008).
    """
    cell = cell_of(cell).for_tool(tool)
    kinematics, given = build(cell.robot), model_of(model)
    known = None if given is None else split(given)[0]
    toolpath = None if program is None else part_of(program, cell)
    files, earlier = _files(measurements), _files(before)
    whole = bool(earlier) or self_check_trials > 0
    rows = readings(files, kinematics, cell, known, register, any_reading=not whole)
    promise = None
    if earlier:
        old = readings(earlier, kinematics, cell, None, register)
        told = diagnose_problem(pose_problem(old, kinematics, cell, None, register), progress)
        promise = kept(told, rows)
    problem = pose_problem(rows, kinematics, cell, known, register)
    diagnosis = diagnose_problem(problem, progress)
    path = None if toolpath is None else along(diagnosis, toolpath, cell)
    checked = None
    if self_check_trials:
        checked = self_check(diagnosis, cell, known, self_check_trials, progress)
    return DiagnosisJob(diagnosis, cell, given, path, promise, checked)


def _files(source: Source | Sequence[Source]) -> list[Source]:
    return [source] if isinstance(source, Source) else list(source)
