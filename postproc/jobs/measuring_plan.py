"""A measuring plan as files: for joint stiffness, or for a diagnosis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from postproc.cell import Cell
from postproc.errors import StiffnessError
from postproc.geometry import rotation_from_abc
from postproc.jobs import sample_diagnosis
from postproc.jobs.drawing import drawing_of
from postproc.jobs.given import Source, cell_of, part_of
from postproc.jobs.paged import written
from postproc.jobs.sample import program_files
from postproc.jobs.sample import sample as sampled
from postproc.model import ToolPath
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.report.pages.diagnosis_plan import diagnosis_plan_page
from postproc.report.pages.sample import sample_page
from postproc.stiffness.sample import (
    Load,
    SampleRequest,
    SamplingRules,
    box_grid,
    csv_text,
    sample_document,
)
from postproc.units import DEG, MM, PERCENT

_USUAL_MASS = 50.0
"""Weight [kg] to hang on where a call names no load."""


@dataclass(frozen=True, slots=True)
class MeasuringPlan:
    """A measuring plan: its document and its files by name. Nothing is on disk before ``write``."""

    document: dict[str, Any]
    files: Mapping[str, bytes]

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write table, program and page whole or not at all.

        Args:
            folder: made where it is missing.

        Returns:
            Paths of the files.

        Raises:
            ReadError: if the folder cannot be written.
        """
        return written(folder, self.files)


def sample(
    cell: Cell | Source,
    box_mm: Sequence[float],
    *,
    grid_mm: float = 150.0,
    name: str = "sample",
    method: str = "grid",
    model: str = "continuous",
    count: int = 64,
    for_diagnosis: bool = False,
    part: ToolPath | Source | None = None,
    axis: str = "y",
    angles_deg: Sequence[float] = (-10.0, 0.0, 10.0),
    orientation_deg: Sequence[float] | None = None,
    load_kg: float | None = None,
    load_at_mm: Sequence[float] | None = None,
    forces_N: Sequence[Sequence[float]] = (),
    wait_s: float = 5.0,
    halt: bool = False,
    speed_percent: float = 30.0,
    tool: int | None = None,
    progress: Progress | None = None,
) -> MeasuringPlan:
    """Return a plan to measure joint stiffness or the gap over a box.

    Args:
        cell: a cell of ``load_cell``, or a file.
        box_mm: (6,) lowest and highest corner in the robot root [mm].
        grid_mm: edge of a cell of the grid.
        name: of the files.
        method: ``grid``: every posture of the grid; ``optimal``: the most telling ones.
        model: what ``optimal`` is to tell: ``constant``, ``grid`` or ``continuous``.
        count: postures of ``optimal`` and of a plan for a diagnosis.
        for_diagnosis: plan for ``diagnose``, and say what it will tell and leave.
        part: a toolpath of ``read``, or a CAM file: plan for ``diagnose`` so that little is left
            where the arm drives in it.
        axis: of the tool frame about which postures turn: ``x``, ``y`` or ``z``.
        angles_deg: by which they turn.
        orientation_deg: (3,) tool A, B, C at angle 0; None: the one that reaches most.
        load_kg: weight to hang on; None: 50 without forces, none for a diagnosis.
        load_at_mm: (3,) its centre of gravity in the flange; None: the tool point.
        forces_N: further loads, each (3,) at the tool point in axes of the robot root.
        wait_s: at a posture.
        halt: wait for the operator instead.
        speed_percent: of the axes.
        tool: TOOL number of the one on the flange, in a cell with several.
        progress: called with (done, total, what).

    Returns:
        ``document``, ``files`` and ``write(folder)``.

    Raises:
        CellError: CEL015 if the cell has several tools and none is named; CEL030 for an arm with
            unknown limits or speeds.
        StiffnessError: STF020 to STF025 if the plan asks for what cannot be.
    """
    whole = cell_of(cell)
    cell = whole.for_tool(tool)
    if not len(angles_deg) or not np.isfinite(angles_deg).all():
        raise StiffnessError("STF025", f"angles {list(angles_deg)}, expected finite numbers")
    box, abc = np.array(box_mm) * MM, orientation_deg
    rules = SamplingRules(
        axis=np.eye(3)["xyz".index(axis)],
        angles=np.array(angles_deg) * DEG,
        R_robroot_tcp=None if abc is None else rotation_from_abc(np.array(abc) * DEG),
    )
    for_diagnosis = for_diagnosis or part is not None
    if load_kg is None and not len(forces_N) and not for_diagnosis:
        load_kg = _USUAL_MASS
    request = SampleRequest(
        grid=box_grid(box[:3], box[3:], grid_mm * MM),
        rules=rules,
        loads=tuple(_loads(load_kg, load_at_mm, forces_N)),
        name=name,
        method=method,
        model=model,
        count=count,
        wait=wait_s,
        halt=halt,
        speed=speed_percent * PERCENT,
    )
    page = f"{name}.html"
    if for_diagnosis:
        plan = sample_diagnosis.plan_diagnosis(
            cell, request, None if part is None else part_of(part, whole), progress
        )
        made = sample_diagnosis.files(plan)
        told = sample_diagnosis.diagnosis_plan_document(plan, sorted([*made, page]))
        names = [plan.name(reading) for reading in range(len(plan.q))]
        drawn = diagnosis_plan_page(told, names, plan.q, plan.points, drawing_of(cell))
        return MeasuringPlan(told, {**made, page: drawn})
    sampling = sampled(cell, request, progress)
    files = dict(program_files(sampling))
    files[f"{name}.csv"] = csv_text(sampling)
    files[page] = sample_page(sampling, drawing_of(sampling.cell))
    return MeasuringPlan(sample_document(sampling, sorted(files)), files)


def _loads(
    mass: float | None, at_mm: Sequence[float] | None, forces: Sequence[Sequence[float]]
) -> Iterator[Load]:
    if mass:
        yield Load(f"{mass:g}kg", mass, None if at_mm is None else np.array(at_mm) * MM)
    for number, force in enumerate(forces, start=1):
        yield Load(f"force{number}", force=np.array(force))
