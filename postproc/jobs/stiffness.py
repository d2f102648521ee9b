"""Stiffness over the rotation about the tool axis: key tags, joint stiffness, curves, document."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import DataError, Finding, SourceRef
from postproc.geometry import apply
from postproc.jobs.given import Source, cell_of, part_of
from postproc.jobs.paged import Paged
from postproc.kinematics import build
from postproc.model import ToolPath, load_model
from postproc.planning import INDICES, SpinCurves, spin_curves, spin_degrees
from postproc.process import assign, word_findings
from postproc.records import dataclass
from postproc.stiffness import describe
from postproc.units import DEG, N_PER_MM


@dataclass(frozen=True)
class SpinStiffness(Paged):
    """Curves of a toolpath's tags, what joint stiffness they rest on in words, and findings."""

    toolpath: ToolPath
    cell: Cell
    curves: SpinCurves
    words: str
    findings: tuple[Finding, ...]

    @property
    def good(self) -> bool:
        """Whether every tag can be run at some rotation, and nothing forbids the toolpath."""
        can = bool((self.curves.best("axial") >= 0).all())
        return can and not any(finding.is_error for finding in self.findings)

    @property
    def document(self) -> dict[str, Any]:
        """The ``postproc.stiffness/1`` document, as ``stiffness --json`` prints it."""
        curves = self.curves
        degrees = spin_degrees(curves)
        tags = []
        for row, name in enumerate(curves.names):
            best: dict[str, Any] = {}
            values: dict[str, Any] = {}
            for index in INDICES:
                at = int(curves.best(index)[row])
                k = curves.values[index][row] / N_PER_MM
                best[index] = (
                    None if at < 0 else {"spin_deg": float(degrees[at]), "N_per_mm": float(k[at])}
                )
                values[index] = [float(v) if np.isfinite(v) else None for v in k]
            tags.append(
                {
                    "tag": int(curves.tags[row]),
                    "name": name,
                    "tool": curves.tools[row],
                    "branch": int(curves.branch[row]),
                    "best": best,
                    "N_per_mm": values,
                    "can_be_run": (
                        np.isfinite(curves.values["axial"][row]) & ~curves.blocked[row]
                    ).tolist(),
                }
            )
        return {
            "schema": "postproc.stiffness/1",
            "joint_stiffness": self.words,
            "coaxial": bool(curves.coaxial.all()),
            "spins_deg": degrees.tolist(),
            "tags": tags,
        }

    def page(self) -> bytes:
        """Return the page with the curves: one HTML file that opens offline."""
        from postproc.jobs.drawing import drawing_of
        from postproc.report.pages.stiffness import stiffness_page

        drawing = drawing_of(self.cell)
        return stiffness_page(self.curves, self._places(), self.toolpath.name, self.words, drawing)

    def _places(self) -> FloatArray:
        """Return the tags (t, 3) [m] in the robot root: where a pose has the tool, if any."""
        curves, cell = self.curves, self.cell
        at = curves.best("axial")
        frames = build(cell.robot).fk(curves.q[np.arange(len(at)), np.maximum(at, 0)])
        tips = {tool.number: tool.T_flange_tcp for tool in cell.tools}
        tools = np.array([tips.get(number, np.eye(4)) for number in curves.tools])
        points = apply(cell.T_robroot_base, self.toolpath.points[curves.tags])
        return np.where((at >= 0)[:, None], (frames @ tools)[:, :3, 3], points)


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
    cell = cell_of(cell)
    toolpath = part_of(part, cell)
    words = "constant joint stiffness of the cell"
    if model is not None:
        cell, words = _with_model(str(model), cell)
    step = None if step_deg is None else step_deg * DEG
    curves = spin_curves(toolpath, cell, _tags(tags, toolpath), step, most)
    assigned = assign(toolpath, cell)
    findings = (*word_findings(assigned.toolpath), *assigned.findings)
    return SpinStiffness(toolpath, cell, curves, words, findings)


def _with_model(path: str, cell: Cell) -> tuple[Cell, str]:
    from postproc.compensation import cell_with_model
    from postproc.gap import stiffness_of

    model = load_model(path)
    field = stiffness_of(model)
    if field is None:
        raise DataError("MOD008", "the model has no joint stiffness", SourceRef(path))
    return cell_with_model(cell, model), f"joint stiffness of {Path(path).name}: {describe(field)}"


def _tags(wanted: Sequence[str] | None, toolpath: ToolPath) -> IndexArray | None:
    if wanted is None:
        return None
    names = {toolpath.tag_name(i): i for i in range(len(toolpath))}
    unknown = [name for name in wanted if name not in names]
    if unknown or not wanted:
        text = f"no tag is named {unknown[0] if unknown else ''!r}"
        hint = f"the first ones are {', '.join(list(names)[:5])}"
        raise DataError("STF027", text, SourceRef(toolpath.path), hint=hint)
    return np.array([names[name] for name in wanted])
