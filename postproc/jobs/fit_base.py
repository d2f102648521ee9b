"""Where a part stands on its fixture: the base from datum points, as cell and as BASE_DATA."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import XYZ_DIGITS, Cell, base_location, edited_cell, frame_document
from postproc.errors import CellError, Finding, Severity, SourceRef
from postproc.geometry import kuka_from_transform
from postproc.jobs.given import Source, cell_of, part_of
from postproc.krl import Pose, value_text
from postproc.measurement import BaseFit, DatumPoints, read_datum_points
from postproc.measurement import fit_base as fitted
from postproc.model import MotionKind, ToolPath
from postproc.process import as_served, assign
from postproc.records import dataclass
from postproc.units import DEG, MM


@dataclass(frozen=True, slots=True)
class BaseJob:
    """A fitted base: points, fit, the base of the cell at ``index``, ``holes`` (m, 3) in it [m]."""

    points: DatumPoints
    fit: BaseFit
    cell: Cell
    index: int
    holes: FloatArray

    @property
    def good(self) -> bool:
        """Whether what is left of the points that count looks like noise."""
        return self.fit.agree

    @property
    def frame(self) -> dict[str, list[float]]:
        """``xyz_mm`` and ``abc_deg`` of the base in the robot root."""
        return frame_document(self.fit.T_robroot_base)

    @property
    def base_data(self) -> str:
        """The line of ``$config.dat``: KUKA counts a base from $WORLD."""
        T = self.cell.robot.T_world_robroot @ self.fit.T_robroot_base
        xyz, abc = kuka_from_transform(T)
        x, y, z, a, b, c = (float(v) for v in (*xyz, *abc))
        pose = Pose(x, y, z, a, b, c)
        return f"BASE_DATA[{self.cell.bases[self.index].number}]={value_text(pose)}"

    def cell_file(self, output: str | Path) -> bytes:
        """Write the cell with this frame.

        Args:
            output: the path at which it will be saved; files that it names are given from there.

        Returns:
            The text of the cell file.
        """
        return cell_with_frame(self.cell, self.index, self.fit.T_robroot_base, output)

    @property
    def findings(self) -> Iterator[Finding]:
        """What to know about the fit."""
        fit, points = self.fit, self.points
        for row in fit.outliers.tolist():
            off = np.linalg.norm(fit.residuals[row]) / MM
            text = f"point {points.ids[row]} lies {off:.3f} mm off the fit of the others: left out"
            yield Finding(Severity.WARNING, "MEA017", text, source=points.source)
        if not fit.agree:
            text = "the points contradict each other, and it cannot be decided which is wrong"
            hint = "measure them again, and more of them"
            yield Finding(Severity.ERROR, "MEA018", text, source=points.source, hint=hint)
        up, was = (T[:3, 2] for T in (fit.T_robroot_base, self._before))
        if float(up @ was) < 0.0:
            text = (
                "z of this base points the other way than in the cell: points in one plane "
                "fit a mirrored part as well as a turned one"
            )
            yield Finding(Severity.WARNING, "MEA019", text, source=points.source)
        if self.cell.external_axes:
            names = ", ".join(axis.name for axis in self.cell.external_axes)
            text = f"the points count as measured with the external axes at 0: {names}"
            yield Finding(Severity.WARNING, "MEA020", text, source=points.source)

    @property
    def _before(self) -> FloatArray:
        return self.cell.bases[self.index].T_robroot_base

    @property
    def document(self) -> dict[str, Any]:
        """The ``postproc.base/1`` document."""
        fit, points = self.fit, self.points
        sizes = np.linalg.norm(fit.residuals, axis=1) / MM
        u95 = fit.u95(points.nominal) / MM
        holes = fit.u95(self.holes) / MM if len(self.holes) else None
        before = self._before
        turn = before[:3, :3].T @ fit.T_robroot_base[:3, :3]
        return {
            "schema": "postproc.base/1",
            "good": self.good,
            "base": self.cell.bases[self.index].number,
            "frame": self.frame,
            "base_data": self.base_data,
            "rms_mm": _rounded(fit.rms / MM),
            "residuals_mm": [_rounded(v) for v in sizes],
            "outliers": [points.ids[row] for row in fit.outliers],
            "u95_mm": _rounded(max(u95.max(), 0.0 if holes is None else holes.max())),
            "u95_holes_mm": None if holes is None else _rounded(holes.max()),
            "moved": {
                "mm": _rounded(float(np.linalg.norm((fit.T_robroot_base - before)[:3, 3])) / MM),
                "deg": _rounded(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)) / DEG),
            },
            "points": [
                {
                    "id": name,
                    "residual_mm": [_rounded(v) for v in fit.residuals[row] / MM],
                    "u95_mm": _rounded(u95[row]),
                    "counts": row not in fit.outliers,
                }
                for row, name in enumerate(points.ids)
            ],
        }


def fit_base(
    points: Source,
    cell: Cell | Source,
    *,
    base: int | None = None,
    part: ToolPath | Source | None = None,
) -> BaseJob:
    """Return the base that fits datum points: nominal on the part, measured in the robot root.

    Args:
        points: CSV ``id,x_mm,y_mm,z_mm,mx_mm,my_mm,mz_mm`` and, where known, ``sigma_mm``.
        cell: a cell of ``load_cell``, or a file.
        base: BASE number, in a cell with several.
        part: whose holes are asked how sure they are, or its tags where it has none.

    Returns:
        ``good``, ``frame``, ``findings``, ``document``, ``base_data``, ``cell_file(output)``.

    Raises:
        CellError: CEL041 for a base that the cell does not have, or none named among several.
        DataError: if the file holds no points, or they give no frame.
    """
    cell = cell_of(cell)
    index = base_index(cell, base)
    found = read_datum_points(points)
    holes = np.zeros((0, 3))
    if part is not None:
        assigned = assign(as_served(part_of(part, cell), cell), cell)
        known = (assigned.base == index) & np.isfinite(assigned.toolpath.points).all(axis=1)
        drilled = known & (np.asarray(assigned.toolpath.kind) == MotionKind.HOLE)
        holes = np.asarray(assigned.toolpath.points)[drilled if drilled.any() else known]
    return BaseJob(found, fitted(found), cell, index, holes)


def base_index(cell: Cell, number: int | None) -> int:
    """Return the setup of a cell that a KUKA BASE number means; errors as ``fit_base``."""
    numbers = [base.number for base in cell.bases]
    if number in numbers:
        return numbers.index(number)
    if number is None and len(numbers) == 1:
        return 0
    what = "the cell has several bases" if number is None else f"the cell has no base {number}"
    known = ", ".join(map(str, numbers))
    hint = f"say one of {known} with --base N"
    raise CellError("CEL041", f"{what}, expected one of {known}", SourceRef(cell.path), hint)


def cell_with_frame(cell: Cell, index: int, T: FloatArray, output: str | Path) -> bytes:
    """Return the text of a cell with the frame T_robroot_base (4, 4) of a setup changed."""
    location = (*base_location(cell, index), "frame")
    return edited_cell(cell, {location: frame_document(T)}, output)


def _rounded(value: float) -> float:
    return round(float(value), XYZ_DIGITS)
