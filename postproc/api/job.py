"""A finished conversion as Python sees it: verdict, tables with units in their names, files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.api.cells import Cell, cell_of
from postproc.errors import Finding
from postproc.geometry import kuka_from_transform
from postproc.jobs.convert import Conversion, document, land
from postproc.jobs.paged import Paged
from postproc.model import MotionKind, MoveKind, MoveRole, Plan, ToolPath
from postproc.units import DEG, MM, MM_PER_MIN, N_PER_MM

Table = NDArray[np.void]


class Job(Paged):
    """A part converted for a cell.

    Nothing is on disk before ``write``. A job that is not good has no files (unless it was asked to
    be ``partial``) and names every failing tag in ``findings``.
    """

    def __init__(self, conversion: Conversion) -> None:
        self._conversion = conversion

    @property
    def good(self) -> bool:
        """Whether every tag can be run and every check of the written text passed."""
        return self._conversion.good

    @property
    def name(self) -> str:
        """Name of the program, as the controller sees it."""
        return self._conversion.name

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Errors, warnings and notes, equal ones folded."""
        return self._conversion.findings

    @property
    def files(self) -> Mapping[str, bytes]:
        """The program files by name, empty where no program may be written."""
        return self._conversion.files

    @property
    def cell(self) -> Cell:
        """The cell with the choices of this call."""
        return cell_of(self._conversion.cell)

    @property
    def part(self) -> ToolPath:
        """The toolpath that was converted."""
        return self._conversion.toolpath

    @property
    def plan(self) -> Plan:
        """Every motion of the program with its joint angles."""
        return self._conversion.plan

    @cached_property
    def document(self) -> dict[str, Any]:
        """The ``postproc.convert/1`` document, as ``convert --json`` prints it."""
        return document(self._conversion)

    @cached_property
    def tags(self) -> Table:
        """One row per tag of the CAM file, in its order.

        Columns: ``id``, ``line``, ``kind``, ``x_mm y_mm z_mm`` (tool tip, CAM coordinates),
        ``i j k`` (tool axis, from the tip to the holder), ``feed_mm_min``, ``stiffness_N_per_mm``
        and ``stiffness_initial_N_per_mm`` along the objective, ``clearance_mm``; NaN where unknown.
        """
        part, plan = self.part, self.plan
        n = len(part)
        known = len(plan.stiffness) == n
        nothing = np.full(n, np.nan)
        return _table(
            n,
            id=np.array([part.tag_name(tag) for tag in range(n)], dtype=np.str_),
            line=np.asarray(part.line),
            kind=_names(MotionKind, part.kind),
            **_columns(("x_mm", "y_mm", "z_mm"), part.points / MM),
            **_columns(("i", "j", "k"), part.axes),
            feed_mm_min=part.feed / MM_PER_MIN,
            stiffness_N_per_mm=plan.stiffness / N_PER_MM if known else nothing,
            stiffness_initial_N_per_mm=plan.stiffness_initial / N_PER_MM if known else nothing,
            clearance_mm=plan.clearance / MM if known else nothing,
        )

    @cached_property
    def points(self) -> Table:
        """One row per motion of the program, in its order.

        Columns: ``tag`` (row of ``tags``), ``motion`` (ptp, lin, circ), ``role``, ``x_mm y_mm z_mm
        a_deg b_deg c_deg`` (TCP in $BASE), ``q1_deg .. q6_deg``, ``e1 ..`` (external axes [mm or
        deg]), ``spin_deg``, ``speed_m_s`` (NaN for PTP), ``blend_mm``, ``dwell_s``, ``duration_s``.
        """
        plan = self.plan
        m = len(plan)
        frames = [kuka_from_transform(T) for T in plan.T_base_tcp]
        xyz = np.array([xyz for xyz, _ in frames]).reshape(m, 3)
        abc = np.array([abc for _, abc in frames]).reshape(m, 3)
        axes = self.cell.external_axes
        sizes = [MM if axis.kind == "rail" else DEG for axis in axes]
        return _table(
            m,
            tag=np.asarray(plan.tag),
            motion=_names(MoveKind, plan.kind),
            role=_names(MoveRole, plan.role),
            **_columns(("x_mm", "y_mm", "z_mm"), xyz),
            **_columns(("a_deg", "b_deg", "c_deg"), abc),
            **_columns([f"q{axis}_deg" for axis in range(1, 7)], plan.q / DEG),
            **_columns([axis.name.lower() for axis in axes], plan.external / np.array(sizes or 1)),
            spin_deg=plan.spin / DEG,
            speed_m_s=np.asarray(plan.speed),
            blend_mm=plan.blend / MM,
            dwell_s=np.asarray(plan.dwell),
            duration_s=np.asarray(plan.duration),
        )

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the program files whole or not at all, and return their paths.

        Sub-programs that a former, longer program of this name has left there are removed.

        Args:
            folder: made where it is missing.

        Returns:
            Paths of the files; none where the job has no program.

        Raises:
            ReadError: if the folder cannot be written.
        """
        land(self._conversion, Path(folder))
        return tuple(Path(folder) / name for name in self.files)

    def page(self) -> bytes:
        """Return the page of the program: one HTML file that opens offline."""
        from postproc.jobs.pages import page_of_conversion

        return page_of_conversion(self._conversion)

    def __repr__(self) -> str:
        """Return name, sizes and verdict on one line."""
        errors = sum(finding.severity == "error" for finding in self.findings)
        verdict = "good" if self.good else f"errors: {errors}"
        return f"<Job {self.name}: {len(self.part)} tags, {len(self.plan)} motions, {verdict}>"

    def _repr_html_(self) -> str:
        """Return the key facts as a table, for notebooks."""
        content = self.document
        facts = {
            "program": self.name,
            "verdict": "good" if self.good else "no program: see the findings",
            "tags": len(self.part),
            "motions": len(self.plan),
            "cycle time [s]": content["cycle_time_s"],
        }
        rows = "".join(
            f"<tr><th>{escape(k)}</th><td>{escape(str(v))}</td></tr>" for k, v in facts.items()
        )
        told = "".join(f"<li>{escape(str(finding))}</li>" for finding in self.findings[:20])
        return f"<table>{rows}</table><ul>{told}</ul>"


def _columns(names: tuple[str, ...] | list[str], values: Any) -> dict[str, Any]:  # noqa: ANN401 - columns of an array
    return {name: values[:, k] for k, name in enumerate(names)}


def _names(kinds: Any, numbers: Any) -> Any:  # noqa: ANN401 - an enum class and an array
    words = np.array([kind.name.lower() for kind in kinds])
    return words[np.asarray(numbers)] if len(numbers) else np.zeros(0, words.dtype)


def _table(length: int, **columns: Any) -> Table:  # noqa: ANN401 - arrays of any kind
    table = np.zeros(length, dtype=[(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        table[name] = values
    table.flags.writeable = False
    return table
