"""Where along a program the gap lies: measured rows found again on the CAM path."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.errors import DataError, SourceRef
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.answers.shrinkage import rms
from postproc.geometry import apply, arc_points, inverse, onto_line
from postproc.model import MotionKind, ToolPath
from postproc.planning import arc_length
from postproc.process import assign, carried
from postproc.records import dataclass
from postproc.units import MM

REACH = 5.0 * MM
"""How far a commanded point may be off the path: a compensated program shifts its points."""
_NAMED_REACH = 50.0 * MM
"""The same for a row that has the name of a tag."""
_STEP = 2.0 * MM
_STRETCHES = 20
_NEAREST = 4


@dataclass(frozen=True, slots=True)
class Along:
    """Rows on a path.

    way: (n,) [m] from the start of the path, NaN for a row that is not on it; tag: (n,) tag that
    the motion at the row leads to, -1 off the path.
    """

    toolpath: ToolPath
    way: FloatArray
    tag: IntArray

    @property
    def on(self) -> BoolArray:
        """(n,) rows on the path."""
        return np.asarray(self.tag >= 0)


def along(diagnosis: Diagnosis, toolpath: ToolPath, cell: Cell) -> Along:
    """Return where the rows of a diagnosis lie on a CAM path.

    A row lies where its commanded joints bring the nominal tool point; a row that has the name of
    a tag lies there. Where the path comes by twice, cuts count before rapids.

    Raises:
        DataError: GAP006 if no row lies on the path.
    """
    samples = diagnosis.problem.samples
    T_part_robroot = inverse(cell.workpiece.T_robroot_base)
    T_part_flange = T_part_robroot @ samples.arm.kinematics.fk(samples.q)
    points = apply(T_part_flange, cell.tool.T_flange_tcp[:3, 3])
    if len(cell.bases) > 1:
        toolpath = _in_work(toolpath, cell)
    pieces = _Pieces.of(toolpath)
    way, tag, distance = pieces.nearest(points)
    far = distance > REACH
    way, tag = np.where(far, np.nan, way), np.where(far, -1, tag).astype(np.int32)
    names = {name: k for k, name in enumerate(toolpath.names or ())}
    lengths = arc_length(toolpath)
    for row, name in enumerate(diagnosis.problem.measurements.ids):
        k = names.get(name, -1)
        if k >= 0 and float(np.linalg.norm(points[row] - toolpath.points[k])) < _NAMED_REACH:
            way[row], tag[row] = lengths[k], k
    if not np.any(tag >= 0):
        raise DataError(
            "GAP006",
            f"no measured row lies on this path, the nearest {distance.min() / MM:.0f} mm off",
            SourceRef(toolpath.path, 1),
            hint="check the workpiece frame of the cell, or leave --program out",
        )
    return Along(toolpath, way, tag)


def _in_work(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the tags that have a base, all in the one in work."""
    assigned = assign(toolpath, cell)
    rows = np.flatnonzero(assigned.base >= 0)
    T = inverse(cell.workpiece.T_robroot_base) @ np.array([b.T_robroot_base for b in cell.bases])
    return carried(assigned.toolpath.rows(rows), T[assigned.base[rows]])


@dataclass(frozen=True, slots=True)
class _Pieces:
    """The path in short straight pieces: from, to (m, 3) [m], way at both ends, tag, rank."""

    start: FloatArray
    end: FloatArray
    way: FloatArray
    tag: IntArray
    rapid: BoolArray

    @classmethod
    def of(cls, toolpath: ToolPath) -> _Pieces:
        """Cut a path; a hole adds its stroke, on which the way stands still."""
        lengths = arc_length(toolpath)
        points, kind = np.asarray(toolpath.points), np.asarray(toolpath.kind)
        parts: list[tuple[FloatArray, FloatArray, int]] = []
        for tag in range(len(points)):
            before = max(tag - 1, 0)
            steps = int(np.ceil((lengths[tag] - lengths[before]) / _STEP)) + 1
            share = np.linspace(0.0, 1.0, steps + 1)
            way = lengths[before] + share * (lengths[tag] - lengths[before])
            parts.append((_motion(toolpath, before, tag, share), way, tag))
            if kind[tag] == MotionKind.HOLE and toolpath.cycle[tag] >= 0:
                cycle = toolpath.cycles[int(toolpath.cycle[tag])]
                top = max(cycle.clearance, cycle.retract)
                count = int(np.ceil((top + cycle.depth) / _STEP)) + 2
                stroke = np.linspace(top, -cycle.depth, count)[:, None] * toolpath.axes[tag]
                parts.append((points[tag] + stroke, np.full(count, lengths[tag]), tag))
        rapid = np.isin(kind, (MotionKind.RAPID, MotionKind.JOINT))
        counts = [len(way) - 1 for _, way, _ in parts]
        tags = np.repeat([tag for _, _, tag in parts], counts).astype(np.int32)
        return cls(
            np.concatenate([p[:-1] for p, _, _ in parts]),
            np.concatenate([p[1:] for p, _, _ in parts]),
            np.concatenate([np.column_stack([w[:-1], w[1:]]) for _, w, _ in parts]),
            tags,
            rapid[tags],
        )

    def nearest(self, points: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Return way (n,) [m], tag (n,) and distance (n,) [m] of the nearest place of the path."""
        from scipy.spatial import cKDTree

        found = []
        for rapid in (False, True):
            rows = np.flatnonzero(self.rapid == rapid)
            if len(rows) == 0:
                continue
            middle = 0.5 * (self.start[rows] + self.end[rows])
            count = min(_NEAREST, len(rows))
            near = rows[cKDTree(middle).query(points, k=count)[1].reshape(len(points), count)]
            share, off = onto_line(points[:, None], self.start[near], self.end[near])
            best = np.argmin(np.round(off, 9), axis=1)[:, None]
            pick = np.take_along_axis(near, best, 1)[:, 0]
            share = np.take_along_axis(share, best, 1)[:, 0]
            way = self.way[pick, 0] + share * (self.way[pick, 1] - self.way[pick, 0])
            found.append((way, self.tag[pick], np.take_along_axis(off, best, 1)[:, 0]))
        if len(found) == 1:
            return found[0]
        later = found[1][2] < found[0][2] - 1e-6
        way, tag, off = (np.where(later, b, a) for a, b in zip(*found, strict=True))
        return way, tag.astype(np.int32), off


def _motion(toolpath: ToolPath, before: int, tag: int, share: FloatArray) -> FloatArray:
    """Return points (k, 3) of the motion to a tag at shares of it."""
    start, end = toolpath.points[before], toolpath.points[tag]
    number = int(toolpath.arc[tag])
    if toolpath.kind[tag] != MotionKind.ARC or number < 0 or before == tag:
        return np.asarray(start + share[:, None] * (end - start))
    k = len(share)
    arcs = toolpath.arcs
    return arc_points(
        np.tile(start, (k, 1)),
        np.tile(end, (k, 1)),
        np.tile(arcs.centre[number], (k, 1)),
        np.tile(arcs.normal[number], (k, 1)),
        np.full(k, arcs.sweep[number]),
        share,
    )


def program(diagnosis: Diagnosis, found: Along) -> dict[str, Any]:
    """Return the ``program`` entry of ``where``: stretches with rows, in the order of the path."""
    size = np.linalg.norm(diagnosis.problem.rest(diagnosis.baseline), axis=1)
    left = np.linalg.norm(diagnosis.residual, axis=1)
    rows = np.flatnonzero(found.on & diagnosis.kept).astype(np.int32)
    lengths = arc_length(found.toolpath)
    number, edges = _stretches(found.toolpath, lengths)
    at = _stretch_of(found, rows, number, edges)
    entries = []
    for k in np.unique(at):
        inside = rows[at == k]
        first = int(inside[np.argmin(found.way[inside])])
        tag = int(found.tag[first])
        operation = int(found.toolpath.operation[tag])
        entries.append(
            {
                "operation": found.toolpath.operations[operation].name if operation >= 0 else None,
                "from_mm": round(float(edges[k, 0]) / MM, 3),
                "to_mm": round(float(edges[k, 1]) / MM, 3),
                "line": int(found.toolpath.line[tag]),
                "n": len(inside),
                "rms_mm": _mm(size[inside]),
                "max_mm": round(float(size[inside].max()) / MM, 5),
                "left_rms_mm": _mm(left[inside]),
            }
        )
    return {
        "name": found.toolpath.name,
        "length_mm": round(float(lengths[-1]) / MM, 3),
        "rows": len(rows),
        "rows_beside": int(np.sum(~found.on & diagnosis.kept)),
        "stretches": entries,
    }


def _stretches(toolpath: ToolPath, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the first stretch (n,) of each tag's operation run, and the edges (k, 2) [m]."""
    operation = np.asarray(toolpath.operation)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(operation)) + 1, [len(operation)]])
    first = np.zeros(len(operation), dtype=np.int32)
    edges: list[FloatArray] = []
    piece = max(float(lengths[-1]) / _STRETCHES, MM)
    for a, b in pairwise(starts):
        low, high = lengths[max(a - 1, 0)], lengths[b - 1]
        parts = max(int(np.ceil((high - low) / piece - 1e-9)), 1)
        cuts = np.linspace(low, high, parts + 1)
        first[a:b] = len(edges)
        edges += list(np.column_stack([cuts[:-1], cuts[1:]]))
    return first, np.array(edges)


def _stretch_of(found: Along, rows: IntArray, first: IntArray, edges: FloatArray) -> IntArray:
    """Return the stretch (k,) of rows: by operation, then by the way."""
    last = np.append(first[1:][np.diff(first) > 0], len(edges))
    runs = np.unique(first)
    out = np.zeros(len(rows), dtype=np.int32)
    for k, row in enumerate(rows):
        run = int(np.searchsorted(runs, first[found.tag[row]]))
        inside = edges[runs[run] : last[run], 1]
        step = int(np.searchsorted(inside, found.way[row] - 1e-9))
        out[k] = runs[run] + min(step, len(inside) - 1)
    return out


def _mm(values: FloatArray) -> float:
    return round(rms(values) / MM, 5)
