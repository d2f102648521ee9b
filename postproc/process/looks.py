"""What an engineer sees in a cloud of points before any robot moves: one warning for each look."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, runs
from postproc.cell import Cell, PointService
from postproc.errors import Finding, Severity
from postproc.model import BLEND_SHARE, CUTS, LEAST_BLEND, MotionKind, ToolPath
from postproc.process.passing import SAME_POINT
from postproc.units import MM

ONE_PLACE = 0.1 * MM
"""Holes of one tool whose tops are nearer [m] are one hole."""
SMALL = 1.0 * MM
"""No job of a robot is all within less [m]."""
SHALLOW = 0.1 * MM
"""No hole is less deep [m]."""
_AGAINST = -0.5
"""Cosine of two normals that point to opposite sides."""
_NEIGHBOURS = 8
_MOST = 2.0 / 3.0
"""Share of the neighbours against which a normal is turned round."""
_OF_HOLES = re.compile(
    r"hole|bohr|loch|trou|per[c\u00e7]age|grip|klemml|fastener|rivet|niet|bolt|drill|diam|"
    r"\bdia\b|durchm|\u00f8",
    re.IGNORECASE,
)
"""Headers of lists of holes."""
_SHOWN = 6


def stationary(toolpath: ToolPath) -> BoolArray:
    """Return (n,) the tags at which the tool stands: holes, and points of a list without a feed."""
    kind = np.asarray(toolpath.kind)
    touch = (kind == MotionKind.LINEAR) & np.isnan(toolpath.feed) & (toolpath.format == "csv")
    return np.asarray((kind == MotionKind.HOLE) | touch)


def looks(toolpath: ToolPath, outward: FloatArray | None = None) -> tuple[Finding, ...]:
    """Return one warning for each look at a toolpath that shows something wrong.

    ``outward``: normals (n, 3) of the workpiece at the tags, NaN where there are none.
    """
    found = (look(toolpath, outward) for look in LOOKS)
    return tuple(finding for finding in found if finding is not None)


def _doubles(toolpath: ToolPath, _: FloatArray | None) -> Finding | None:
    """One place that one tool serves twice in an operation."""
    rows = _known(toolpath)
    keys = (toolpath.tool, toolpath.operation, toolpath.setup_of_tags)
    key = np.unique(np.stack(keys)[:, rows], axis=1, return_inverse=True)[1].reshape(-1)
    places = np.column_stack([toolpath.points[rows], key])  # of other keys: a metre and more away
    own, first, which = np.unique(places, axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    later = np.flatnonzero(first[which] != np.arange(len(rows)))
    pairs = [np.column_stack([later, first[which[later]]])]
    pairs.append(np.sort(first[_near(own)], axis=1)[:, ::-1])
    twin = np.unique(np.concatenate(pairs), axis=0)
    _, once = np.unique(twin[:, 0], return_index=True)
    if not len(once):
        return None
    listed = [
        f"{_name(toolpath, rows[b])} at the place of {_name(toolpath, rows[a])}"
        for b, a in twin[once][:_SHOWN].tolist()
    ]
    text = f"{len(once)} positions appear twice and are worked twice: {_list(listed, len(once))}"
    return _warning("PTS001", text, toolpath, rows[twin[once, 0]])


def _near(places: FloatArray) -> IndexArray:
    """Return pairs (m, 2) of places (n, 4) that are nearest to each other and one place."""
    rows = _crowded(places)
    if not len(rows):
        return np.zeros((0, 2), dtype=np.int64)
    from scipy.spatial import cKDTree  # slow to load, and seldom needed

    own = places[rows]
    found = cKDTree(own).query(own, k=2, distance_upper_bound=ONE_PLACE)
    distance, near = (np.asarray(column)[:, 1] for column in found)
    at = np.flatnonzero(np.isfinite(distance))
    return np.column_stack([rows[at], rows[near[at].astype(np.int64)]])


def _crowded(places: FloatArray) -> IndexArray:
    """Return rows (k,) of places (n, 4) that share a cell with another: all that are one place."""
    shared = np.zeros(len(places), dtype=np.bool_)
    for shift in np.ndindex(2, 2, 2):
        cell = np.floor(places[:, :3] / (2.0 * ONE_PLACE) + np.array(shift) / 2.0)
        order = np.lexsort((places[:, 3], *cell.T))
        same = (np.diff(cell[order], axis=0) == 0.0).all(axis=1) & (
            np.diff(places[order, 3]) == 0.0
        )
        shared[order[1:][same]] = shared[order[:-1][same]] = True
    return np.flatnonzero(shared)


def _turned(toolpath: ToolPath, outward: FloatArray | None) -> Finding | None:
    """Normals that point opposite to those around them, or into the workpiece."""
    rows = _known(toolpath, all_of_lists=True)
    axes, wrong = toolpath.axes[rows], np.zeros(len(rows), dtype=np.bool_)
    places, first = np.unique(toolpath.points[rows], axis=0, return_index=True)
    count = min(_NEIGHBOURS + 1, len(places))
    mean = axes.sum(axis=0)
    alike = (axes @ mean > 0.5 * np.linalg.norm(mean)).all()  # within 60 deg: none is turned round
    if count > 2 and not alike:
        from scipy.spatial import cKDTree

        near = np.asarray(cKDTree(places).query(places, k=count)[1])[:, 1:]
        cosine = np.einsum("ij,ikj->ik", axes[first], axes[first][near])
        turned = (cosine < _AGAINST).mean(axis=1) >= _MOST
        wrong[first] = turned & (turned.mean() < 0.5)  # more of them are the other side of a part
    inward = np.zeros(len(rows), dtype=np.bool_)
    if outward is not None:
        inward = np.einsum("ij,ij->i", axes, np.nan_to_num(outward[rows])) < _AGAINST
    at = rows[wrong | inward]
    if not len(at):
        return None
    what = "into the workpiece" if inward.any() else "opposite to those around them"
    listed = [_name(toolpath, row) for row in at[:_SHOWN]]
    text = f"{len(at)} normals point {what}, from the tip to the holder: {_list(listed, len(at))}"
    return _warning("PTS002", text, toolpath, at)


def _flips(toolpath: ToolPath, _: FloatArray | None) -> Finding | None:
    """Moves of a cut on which the tool would be swung to the other side of the part."""
    cosine = np.einsum("ij,ij->i", toolpath.axes[1:], toolpath.axes[:-1])
    into = np.isin(toolpath.kind, CUTS)[1:] & (toolpath.format != "csv")
    at = np.flatnonzero(into & (cosine < _AGAINST)) + 1
    if not len(at):
        return None
    lines = [f"{toolpath.line[tag - 1]} to {toolpath.line[tag]}" for tag in at[:_SHOWN]]
    text = f"the tool axis flips within a cut: lines {_list(lines, len(at))}"
    return _warning("PTS002", text, toolpath, at)


def from_below(toolpath: ToolPath, cell: Cell) -> tuple[Finding, ...]:
    """Return a warning where every normal of a list points down, and nothing says it is right.

    With a solid of the part ``looks`` tells; a part that a positioner turns has no side below.
    """
    turns = any(axis.kind != "rail" for axis in cell.external_axes)
    if toolpath.format != "csv" or turns or any(base.meshes for base in cell.bases):
        return ()
    rows = _known(toolpath, all_of_lists=True)
    up = [(cell.robot.T_world_robroot @ base.T_robroot_base)[2, :3] for base in cell.bases]
    if not len(rows) or np.max(toolpath.axes[rows] @ np.transpose(up)) > _AGAINST:
        return ()
    text = (
        f"the tool comes from below at all {len(rows)} points: normals go from the tip to the "
        "holder, and no solid says which side of the part is out"
    )
    return (_warning("PTS006", text, toolpath, rows),)


def _extent(toolpath: ToolPath, _: FloatArray | None) -> Finding | None:
    """All points within less than any job."""
    points = toolpath.points[np.isfinite(toolpath.points).all(axis=1)]
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if not SAME_POINT < size < SMALL:
        return None
    text = f"all points lie within {size / MM:.4g} mm: is the unit of length right?"
    return _warning("PTS003", text, toolpath, np.arange(1))


def _depth(toolpath: ToolPath, _: FloatArray | None) -> Finding | None:
    """Lists of holes that do not say how deep, and holes without depth."""
    kind, holes = np.asarray(toolpath.kind), np.asarray(toolpath.kind) == MotionKind.HOLE
    if toolpath.format == "csv" and (kind == MotionKind.LINEAR).all():
        named = [word for word in toolpath.words if _OF_HOLES.search(word)]
        if named:
            text = (
                f"a list of holes ({', '.join(named[:_SHOWN])}) without a depth: no hole is "
                "drilled, the tool goes to the points only"
            )
            return _warning("PTS004", text, toolpath, np.arange(1))
    depth = np.array([*(cycle.depth for cycle in toolpath.cycles), np.inf])
    flat = np.flatnonzero(holes & (depth[np.asarray(toolpath.cycle)] < SHALLOW))
    if not len(flat):
        return None
    listed = [_name(toolpath, row) for row in flat[:_SHOWN]]
    text = f"{len(flat)} holes are less than 0.1 mm deep: {_list(listed, len(flat))}"
    return _warning("PTS004", text, toolpath, flat)


def _spacing(toolpath: ToolPath, _: FloatArray | None) -> Finding | None:
    """Points of a cut that are too near to each other to be blended."""
    step = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1)
    cuts = np.isin(toolpath.kind, CUTS)
    near = (step > SAME_POINT) & (step < LEAST_BLEND / BLEND_SHARE)
    near &= cuts[:-1] & (np.asarray(toolpath.kind)[1:] == MotionKind.LINEAR)
    tags = np.flatnonzero(near) + 1
    if not len(tags):
        return None
    lines = [
        f"{toolpath.line[low + 1]} to {toolpath.line[high]}"
        if high - low > 1
        else f"{toolpath.line[low + 1]}"
        for low, high in runs(near[None])
        if near[low]
    ]
    text = (
        f"{len(tags)} points of cuts are less than {LEAST_BLEND / BLEND_SHARE / MM:.4f} mm apart: "
        f"too close to blend, an exact stop at each: lines {_list(lines[:_SHOWN], len(lines))}"
    )
    return _warning("PTS005", text, toolpath, tags)


LOOKS: tuple[Callable[[ToolPath, FloatArray | None], Finding | None], ...] = (
    _doubles, _turned, _flips, _extent, _depth, _spacing,
)  # fmt: skip
"""What is looked at, in the order of the warnings."""


def _known(toolpath: ToolPath, *, all_of_lists: bool = False) -> IndexArray:
    """Return the tags where the tool stands at a known place with a known axis."""
    known = np.isfinite(toolpath.points).all(axis=1) & np.isfinite(toolpath.axes).all(axis=1)
    is_listed = all_of_lists and toolpath.format == "csv"
    return np.flatnonzero((stationary(toolpath) | is_listed) & known)


def _name(toolpath: ToolPath, tag: int) -> str:
    line = f"line {toolpath.line[tag]}"
    return line if toolpath.names is None else f"{toolpath.names[tag]} ({line})"


def _list(shown: Sequence[str], count: int) -> str:
    more = f" and {count - len(shown)} more" if count > len(shown) else ""
    return ", ".join(shown) + more


def _warning(code: str, text: str, toolpath: ToolPath, tags: IndexArray) -> Finding:
    return Finding(Severity.WARNING, code, text, int(tags[0]), toolpath.source(int(tags[0])))


def as_served(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath as a robot serves it: points to touch become holes without a cycle.

    A list of points says nothing about the way between them. By ``[motion] points`` = ``touch``
    each is approached along the tool axis and left the same way; ``path`` takes them as a line to
    follow; ``auto`` follows where a feed is given, which only a cut has. Other formats say
    themselves what is a cut: they come back unchanged.
    """
    choice = cell.motion.points
    kind = np.asarray(toolpath.kind)
    touch = kind == MotionKind.LINEAR
    if choice is PointService.AUTO:
        touch = touch & ~np.isfinite(toolpath.feed)
    if toolpath.format != "csv" or choice is PointService.PATH or not touch.any():
        return toolpath
    return replace(toolpath, kind=np.where(touch, MotionKind.HOLE, kind).astype(np.int32))
