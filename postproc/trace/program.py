"""The programmed path beside the command: which line a row belongs to, and how far it is off.

Only geometry is used: no line needs to be logged, and no common zero of time exists. The match may
go forward only; a path that crosses itself or comes back is not mistaken.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.controller import Blend
from postproc.errors import DataError, SourceRef
from postproc.geometry import apply, onto_line
from postproc.kinematics import Kinematics
from postproc.krl import KrlModule
from postproc.model import MotionKind, ToolPath
from postproc.paths import joint_paths, run_in_cell
from postproc.records import dataclass
from postproc.trace.scene import Scene, carried
from postproc.units import DEG, MM

FINE = 0.5 * MM
"""Distance of the places of the path among which the nearest is sought."""
FAR = 60.0 * MM
"""A row farther off is on no line: rounding beyond is not in use."""
BACK = 5.0 * MM
"""How far the match may go back: nearest places jitter in a corner."""
AHEAD = 150.0 * MM
"""How far the match looks forward from row to row."""
MATCHED = 20_000
"""Most rows that are matched; between them the place is interpolated."""
TURN = 8.0 * DEG
"""Least turn from one motion to the next that is a corner."""


@dataclass(frozen=True, slots=True, eq=False)
class Programmed:
    """A path of straight pieces.

    Args:
        path: of the file.
        points: (k, 3) [m] robroot; motion: (k,) motion that leads to the point; way: (k,) [m].
        line: (m,) of each motion; feed: (m,) [m/s], NaN for joint motions and rapids.
        cdis: (m,) distance [m] from the end of a motion at which approximation may begin.
    """

    path: str
    points: FloatArray
    motion: AnyIntArray
    way: FloatArray
    line: AnyIntArray
    feed: FloatArray
    cdis: FloatArray

    @property
    def ends(self) -> AnyIntArray:
        """(m,) the last point of each motion, -1 for one that goes nowhere."""
        ends = np.full(len(self.line), -1)
        ends[self.motion] = np.arange(len(self.motion))
        return ends


def of_program(
    modules: Sequence[KrlModule], cell: Cell, kinematics: Kinematics, tool: FloatArray
) -> Programmed:
    """Return the path of a KRL program as our controller runs it, without approximation."""
    trace = run_in_cell(modules, modules[0].name, cell, kinematics)
    paths = joint_paths(trace, cell, kinematics, 2.0 * MM)
    poses = paths.in_order()
    good = np.isfinite(poses.q).all(axis=1)
    points = carried(kinematics, poses.q[good], tool)
    feed = np.where(trace.is_cp, trace.column("speed"), np.nan)
    cdis = np.where(trace.blend == Blend.DISTANCE, trace.column("cdis"), 0.0)
    motion = np.asarray(poses.row[good], dtype=np.int64)
    return _programmed(modules[0].name, points, motion, np.asarray(trace.line), feed, cdis)


def of_toolpath(toolpath: ToolPath, cell: Cell) -> Programmed:
    """Return the path of a CAM file in the base in work; arcs as their chords between tags."""
    points = apply(cell.workpiece.T_robroot_base, np.asarray(toolpath.points))
    fast = np.isin(toolpath.kind, (MotionKind.RAPID, MotionKind.JOINT))
    feed = np.where(fast, np.nan, toolpath.feed)
    blend = np.zeros(len(points))
    number = np.arange(len(points))
    return _programmed(toolpath.path, points, number, np.asarray(toolpath.line), feed, blend)


def _programmed(
    path: str,
    points: FloatArray,
    motion: AnyIntArray,
    line: AnyIntArray,
    feed: FloatArray,
    cdis: FloatArray,
) -> Programmed:
    if len(points) < 2:
        raise DataError("TRC007", "the program moves nowhere", SourceRef(path))
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    keep = np.concatenate([[True], step > 1e-9])
    way = np.concatenate([[0.0], np.cumsum(step)])
    return Programmed(path, points[keep], motion[keep], way[keep], line, feed, cdis)


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """Where the rows of a recording are on a program.

    Args:
        program: the path; way: (n,) [m] along it, NaN off it; motion: (n,), -1 off it.
        off: (n, 3) command less the nearest place of the program [m], 0 off it.
    """

    program: Programmed
    way: FloatArray
    motion: AnyIntArray
    off: FloatArray

    @property
    def on(self) -> BoolArray:
        """(n,) rows on the program."""
        return np.asarray(self.motion >= 0)


def matched(scene: Scene, program: Programmed) -> Match:
    """Return where the rows of a scene are on a program.

    Raises:
        DataError: TRC007 if hardly a row is near it.
    """
    even = np.append(np.arange(0.0, program.way[-1], FINE), program.way[-1])
    places = _at(program, even)
    n = len(scene.time)
    way = np.full(n, np.nan)
    every = max(1, n // MATCHED)
    for rows in scene.stretches:
        some = np.unique(np.append(np.arange(rows.start, rows.stop, every), rows.stop - 1))
        found = _along(scene.points[some], places, even)
        good = np.isfinite(found)
        if good.sum() < 2:
            continue
        whole = np.arange(rows.start, rows.stop)
        way[rows] = np.interp(whole, some[good], found[good], np.nan, np.nan)
        near = np.interp(whole, some, good.astype(float))
        way[rows] = np.where(near > 0.99, way[rows], np.nan)
    on = np.isfinite(way)
    if on.mean() < 0.1:
        raise DataError(
            "TRC007",
            f"{on.mean():.0%} of the rows are within {FAR / MM:.0f} mm of the program",
            SourceRef(program.path),
            hint="is it the program that was run, in the base and with the tool of the cell?",
        )
    way[on] = _refined(scene.points[on], program, way[on])
    off = np.zeros((n, 3))
    off[on] = scene.points[on] - _at(program, way[on])
    place = np.searchsorted(program.way, np.nan_to_num(way), side="left")
    motion = program.motion[np.clip(place, 0, len(program.motion) - 1)]
    return Match(program, way, np.where(on, motion, -1), off)


def _at(program: Programmed, way: FloatArray) -> FloatArray:
    parts = [np.interp(way, program.way, p) for p in program.points.T]
    return np.stack(parts, axis=1)


def _along(points: FloatArray, places: FloatArray, even: FloatArray) -> FloatArray:
    """Return the way (k,) of points (k, 3), forward only; NaN where none is near."""
    way = np.full(len(points), np.nan)
    back, ahead = int(BACK / FINE), int(AHEAD / FINE)
    now = -1
    for row, point in enumerate(points):
        low, high = (0, len(places)) if now < 0 else (max(0, now - back), now + ahead)
        squares = np.sum((places[low:high] - point) ** 2, axis=1)
        best = int(np.argmin(squares))
        if now < 0:
            # where the path comes by twice, it begins at the first
            near = np.flatnonzero(squares <= squares[best] + (2.0 * FINE) ** 2)
            best = int(near[0])
        if squares[best] > FAR**2:
            now = -1
            continue
        now = low + best
        way[row] = even[now]
    return way


def _refined(points: FloatArray, program: Programmed, way: FloatArray) -> FloatArray:
    """Return the way (n,) of the nearest place on the two or three pieces around each."""
    piece = np.clip(np.searchsorted(program.way, way) - 1, 0, len(program.way) - 2)
    best, found = np.full(len(way), np.inf), way.copy()
    for shift in (-1, 0, 1):
        k = np.clip(piece + shift, 0, len(program.way) - 2)
        share, off = onto_line(points, program.points[k], program.points[k + 1])
        place = program.way[k] + share * (program.way[k + 1] - program.way[k])
        closer = off < best
        best, found = np.where(closer, off, best), np.where(closer, place, found)
    return found


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner of a program: its way [m], half the angle between both directions [rad], legs [m].

    before, after: (3,) unit directions; motion: that ends there.
    """

    way: float
    half: float
    reach: float
    before: FloatArray
    after: FloatArray
    motion: int


def corners_of(program: Programmed) -> list[Corner]:
    """Return the corners between path motions."""
    ends = program.ends
    found = []
    for motion, following in pairwise(np.flatnonzero(ends >= 0).tolist()):
        at = int(ends[motion])
        if at < 1 or at + 1 >= len(program.points) or np.isnan(program.feed[following]):
            continue
        if np.isnan(program.feed[motion]):
            continue
        before = program.points[at] - program.points[at - 1]
        after = program.points[at + 1] - program.points[at]
        u, w = before / np.linalg.norm(before), after / np.linalg.norm(after)
        angle = float(np.arccos(np.clip(u @ w, -1.0, 1.0)))
        if angle < TURN or angle > np.pi - TURN:
            continue
        first = program.way[at] - program.way[np.flatnonzero(program.motion == motion)[0] - 1]
        last = program.way[int(ends[following])] - program.way[at]
        reach = 0.5 * float(min(first, last))
        found.append(Corner(float(program.way[at]), 0.5 * angle, reach, u, w, motion))
    return found
