"""Whether the tool is tilted against the axis of the CAM file no more than the cell allows.

Lead and side tilt of ``model.tilt``, found from the CAM file and the executed path alone. At a tag
both must lie in their ranges; the error is the angle to the nearest allowed axis. Between two tags
the range holds with a little more, against the CAM axis and the feed direction in between:
turning evenly from tag to tag, going round with an arc.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray
from postproc.cell import Cell, TiltRange
from postproc.geometry import angle_between, rotation_about, turned_between
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.process import PLUNGING, SHARPEST, repeats
from postproc.records import dataclass
from postproc.verification.cam.elements import Arc, Line, element_to


@dataclass(frozen=True, slots=True)
class Tilts:
    """What tilt is allowed where.

    ``holder`` (n, 3): CAM axes from the tip to the holder; ``feed`` (n, 3): unit feed directions
    across them, zero at tags that must not tilt.
    """

    allowed: TiltRange
    holder: FloatArray
    feed: FloatArray

    @classmethod
    def of(cls, toolpath: ToolPath, cell: Cell) -> Tilts:
        """Return what a cell allows along a toolpath."""
        allowed, holder = cell.optimize.tilt, np.asarray(toolpath.axes)
        if not allowed:
            return cls(allowed, holder, np.zeros_like(holder))
        again = repeats(toolpath)
        feed = _feeds(replace(toolpath, events=()).rows(np.flatnonzero(~again)))
        return cls(allowed, holder, feed[np.cumsum(~again) - 1])

    def rows(self, tags: AnyIntArray) -> Tilts:
        """Return what is allowed at some tags (k,)."""
        return Tilts(self.allowed, self.holder[tags], self.feed[tags])

    def judge(self, tags: AnyIntArray, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the error and the allowed tilt (m,) [rad] of tool axes (m, 3), into the part."""
        holder, feed = self.holder[tags], self.feed[tags]
        low, high = self._limits(feed)
        angles = np.clip(_angles(-axis, holder, feed), low, high)
        nearest = _tilted(holder, feed, angles)
        upright = np.flatnonzero((angles == 0.0).all(axis=1))
        nearest[upright] = holder[upright]
        return angle_between(-axis, nearest), angle_between(nearest, holder)

    def _limits(self, feed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest lead and side (m, 2) each."""
        may = np.any(feed, axis=1, keepdims=True)
        low, high = np.array([self.allowed.lead, self.allowed.side]).T
        return np.where(may, low, 0.0), np.where(may, high, 0.0)

    def beyond(self, row: int, share: FloatArray, axis: FloatArray, arc: Arc | None) -> FloatArray:
        """Return by how much (k,) [rad] tool axes on the way to a tag leave the ranges.

        ``share`` (k,) of the way, a line or ``arc``, from the tag before; ``axis`` (k, 3), into the
        part.
        """
        start, end = self.feed[row - 1], self.feed[row]
        if arc is not None:
            end = rotation_about(arc.normal, -arc.sweep) @ end
        start, end = start if start.any() else end, end if end.any() else start
        feed = turned_between(start, end, share)
        if arc is not None:
            turns = rotation_about(arc.normal, arc.sweep * share)
            feed = np.einsum("kij,kj->ki", turns, feed)
        holder = turned_between(self.holder[row - 1], self.holder[row], share)
        ahead = _unit(feed - np.einsum("ij,ij->i", feed, holder)[:, None] * holder)
        if not start.any():
            return angle_between(-axis, holder)
        angles = _angles(-axis, holder, ahead)
        low, high = self._limits(ahead)
        return np.asarray(np.maximum(low - angles, angles - high).max(axis=1))


def _angles(axis: FloatArray, holder: FloatArray, feed: FloatArray) -> FloatArray:
    """Return lead and side tilt (m, 2) [rad] of axes (m, 3) to the holder; 0 without feed."""
    right = np.cross(feed, holder)
    upward = np.einsum("ij,ij->i", axis, holder)
    lead = np.arctan2(np.einsum("ij,ij->i", axis, feed), upward)
    side = np.arcsin(np.clip(np.einsum("ij,ij->i", axis, right), -1.0, 1.0))
    may = np.any(feed, axis=1, keepdims=True)
    return np.where(may, np.stack([lead, side], axis=1), 0.0)


def _tilted(holder: FloatArray, feed: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the axes (m, 3) to the holder with lead and side tilt (m, 2) [rad]."""
    lead, side = angles[:, :1], angles[:, 1:]
    forward = np.cos(lead) * holder + np.sin(lead) * feed
    tilted: FloatArray = np.cos(side) * forward + np.sin(side) * np.cross(feed, holder)
    return tilted


def _unit(vectors: FloatArray) -> FloatArray:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(size > 0.0, size, 1.0))


def _feeds(toolpath: ToolPath) -> FloatArray:
    """Return the feed directions (n, 3) at all tags, unit, across the CAM axis; zero for none."""
    kind, holder = np.asarray(toolpath.kind), np.asarray(toolpath.axes)
    feed = np.zeros((len(toolpath), 3))
    leaving = _flat(_leaving(toolpath, 1), holder[0]) if len(toolpath) > 1 else np.zeros(3)
    arriving = np.zeros(3)
    for tag in range(len(toolpath)):
        if kind[tag] in (MotionKind.RAPID, *CUTS):
            meets = arriving.any() and leaving.any()
            if not meets or float(angle_between(arriving, leaving)) <= SHARPEST + 1e-9:
                feed[tag] = _unit(arriving + leaving)
        if tag + 1 < len(toolpath):
            arriving = _flat(_arriving(toolpath, tag + 1), holder[tag + 1])
        if tag + 2 < len(toolpath):
            leaving = _flat(_leaving(toolpath, tag + 2), holder[tag + 1])
        else:
            leaving = np.zeros(3)
    return feed


def _flat(way: FloatArray, holder: FloatArray) -> FloatArray:
    """Return the unit part of a way across an axis, zero where the way (nearly) runs along it."""
    across = way - float(way @ holder) * holder
    length, size = float(np.linalg.norm(way)), float(np.linalg.norm(across))
    if length <= 1e-9 or size < (PLUNGING - 1e-9) * length or not np.isfinite(size):
        return np.zeros(3)
    return np.asarray(across / size)


def _leaving(toolpath: ToolPath, row: int) -> FloatArray:
    """Return the direction in which the cut to a tag leaves the tag before; zero for no cut."""
    if toolpath.kind[row] not in CUTS:
        return np.zeros(3)
    element = element_to(toolpath, row)
    if isinstance(element, Line):
        return np.asarray(element.end - element.start)
    radius = element.start - element.centre
    rise = float((element.end - element.start) @ element.normal)
    return np.asarray(element.sweep * np.cross(element.normal, radius) + rise * element.normal)


def _arriving(toolpath: ToolPath, row: int) -> FloatArray:
    """Return the direction in which the cut to a tag reaches it; zero for no cut."""
    way = _leaving(toolpath, row)
    element = element_to(toolpath, row) if way.any() else None
    if isinstance(element, Arc):
        return np.asarray(rotation_about(element.normal, element.sweep) @ way)
    return way
