"""A measuring plan as files: for joint stiffness, or for a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from postproc.cell import Cell
from postproc.errors import StiffnessError
from postproc.files import write_files
from postproc.geometry import rotation_from_abc
from postproc.jobs import sample_diagnosis
from postproc.jobs.drawing import drawing_of
from postproc.jobs.sample import program_files, sample
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
        written = {Path(folder) / name: content for name, content in self.files.items()}
        write_files(written)
        return tuple(written)


def measuring_plan(
    cell: Cell, options: Mapping[str, Any], progress: Progress | None = None
) -> MeasuringPlan:
    """Plan the measurement that the options of ``sample`` ask for.

    Raises:
        CellError: CEL030 for an arm with unknown limits or speeds.
        StiffnessError: STF020 to STF025.
    """
    request, page = _request(options), f"{options['name']}.html"
    if options["for_diagnosis"]:
        plan = sample_diagnosis.plan_diagnosis(cell, request, progress)
        made = sample_diagnosis.files(plan)
        told = sample_diagnosis.diagnosis_plan_document(plan, sorted([*made, page]))
        names = [plan.name(reading) for reading in range(len(plan.q))]
        drawn = diagnosis_plan_page(told, names, plan.q, plan.points, drawing_of(cell))
        return MeasuringPlan(told, {**made, page: drawn})
    sampling = sample(cell, request, progress)
    files = dict(program_files(sampling))
    files[f"{options['name']}.csv"] = csv_text(sampling)
    files[page] = sample_page(sampling, drawing_of(sampling.cell))
    return MeasuringPlan(sample_document(sampling, sorted(files)), files)


def _request(options: Mapping[str, Any]) -> SampleRequest:
    try:
        angles = [float(text) for text in str(options["angles"]).split(",")]
    except ValueError:
        angles = []
    if not angles or not np.isfinite(angles).all():
        raise StiffnessError(
            "STF025", f"--angles {options['angles']!r}, expected numbers with commas between"
        )
    box = np.array(options["box"]) * MM
    abc = options["orientation"]
    rules = SamplingRules(
        axis=np.eye(3)["xyz".index(options["axis"])],
        angles=np.array(angles) * DEG,
        R_robroot_tcp=None if abc is None else rotation_from_abc(np.array(abc) * DEG),
    )
    return SampleRequest(
        grid=box_grid(box[:3], box[3:], options["grid"] * MM),
        rules=rules,
        loads=_loads(options),
        name=options["name"],
        method=options["method"],
        model=options["model"],
        count=options["count"],
        wait=options["wait"],
        halt=options["halt"],
        speed=options["speed"] * PERCENT,
    )


def _loads(options: Mapping[str, Any]) -> tuple[Load, ...]:
    mass = options["load_kg"]
    if mass is None and not options["force"] and not options["for_diagnosis"]:
        mass = _USUAL_MASS
    loads = []
    if mass:
        at = options["load_at"]
        loads.append(Load(f"{mass:g}kg", mass, None if at is None else np.array(at) * MM))
    for number, force in enumerate(options["force"], start=1):
        loads.append(Load(f"force{number}", force=np.array(force)))
    return tuple(loads)
