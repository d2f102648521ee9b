"""Tilt of the tool axis: where the path allows it, which are tried, where a line leaves its range.

Lead and side tilt are measured against the feed direction at a tag, as ``model.tilt`` says.
"""

from __future__ import annotations

import itertools

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray
from postproc.cell import TiltRange
from postproc.geometry import rotation_from_vector, turned_between
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.process import PLUNGING, SHARPEST
from postproc.units import DEG

UPRIGHT: FloatArray = np.zeros((1, 2))
"""The only tilt (lead, side) of a cell that allows none."""
BETWEEN = 0.4 * DEG
"""By so much [rad] lead and side tilt may leave their range between two tags: the controller turns
the tool about one axis, while the feed direction goes from that of one tag to that of the next."""
REENTRY = "reentry"
"""Extra column of a toolpath: tags that stand where the ones before do, entered anew there."""
MOST_TILTS = 25
FEW_TILTS, WIDE = 9, 20.0 * DEG
"""So many tilts are searched at first where their steps are no wider [rad]: refined, such a grid
gives poses as stiff as one of many, and steps between poses are pairs of tilts."""
MOST_COLUMNS = 2000
"""Most spins times tilts at a tag: 32 arm configurations each must fit into one rung."""
MOST_POSES = 1_000_000
"""Most spins times tilts of all tags that tilt, unless the coarsest grid has more."""


def entered_anew(toolpath: ToolPath) -> BoolArray:
    """Return the tags (n,) by which a cut that was left is entered again."""
    return np.asarray(toolpath.extra.get(REENTRY, np.zeros(len(toolpath))), dtype=np.bool_)


def cut_into(toolpath: ToolPath) -> BoolArray:
    """Return the tags (n,) to which a cut leads from the tag before, if there is one."""
    return np.asarray(np.isin(np.asarray(toolpath.kind), CUTS) & ~entered_anew(toolpath))


def feed_directions(toolpath: ToolPath, axis: FloatArray) -> FloatArray:
    """Return the feed direction (n, 3) across the tool axis, unit, part; NaN where there is none.

    Args:
        toolpath: with a point at every tag.
        axis: (n, 3) unit tool axes, either sense, part.
    """
    n = len(toolpath)
    kind = np.asarray(toolpath.kind)
    before, behind = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    cuts = np.flatnonzero(cut_into(toolpath))
    cuts = cuts[cuts > 0]
    start, end = _ends_of_cuts(toolpath, cuts)
    before[cuts] = _across(end, axis[cuts])
    behind[cuts - 1] = _across(start, axis[cuts - 1])
    has_before, has_behind = np.isfinite(before[:, 0]), np.isfinite(behind[:, 0])
    both = has_before & has_behind
    turns_back = np.einsum("ij,ij->i", before, behind) < np.cos(SHARPEST)
    total = np.where(has_before[:, None], before, 0.0) + np.where(has_behind[:, None], behind, 0.0)
    able = (has_before | has_behind) & ~(both & turns_back)
    able &= np.isin(kind, (MotionKind.RAPID, *CUTS))
    able &= ~entered_anew(toolpath)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(able[:, None], total / np.maximum(size, 1e-12), np.nan)


def _ends_of_cuts(toolpath: ToolPath, cuts: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Return the directions (c, 3) in which cuts leave their start and reach their end."""
    points = np.asarray(toolpath.points)
    start = points[cuts] - points[cuts - 1]
    end = start.copy()
    number = np.asarray(toolpath.arc)[cuts]
    is_arc = np.flatnonzero((np.asarray(toolpath.kind)[cuts] == MotionKind.ARC) & (number >= 0))
    if len(is_arc):
        arcs, which, tags = toolpath.arcs, number[is_arc], cuts[is_arc]
        normal, sweep = arcs.normal[which], arcs.sweep[which]
        rise = np.einsum("ij,ij->i", start[is_arc], normal) / sweep
        climb = rise[:, None] * normal
        start[is_arc] = np.cross(normal, points[tags - 1] - arcs.centre[which]) + climb
        end[is_arc] = np.cross(normal, points[tags] - arcs.centre[which]) + climb
    return start, end


def _across(way: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit directions (m, 3) of ways across axes, NaN where a way has (nearly) none."""
    flat = way - np.einsum("ij,ij->i", way, axis)[:, None] * axis
    size, length = np.linalg.norm(flat, axis=1), np.linalg.norm(way, axis=1)
    good = (length > ROUNDING) & (size > PLUNGING * length)
    return np.where(good[:, None], flat / np.maximum(size, 1e-12)[:, None], np.nan)


def tilt_vectors(holder: FloatArray, feed: FloatArray, tilt: FloatArray) -> FloatArray:
    """Return the rotations (m, 3) [rad], axis times angle, that tilt the tool.

    The smallest that takes the CAM axis to the tilted one; exactly zero without tilt or feed.

    Args:
        holder: (m, 3) unit CAM axes from the tip to the holder.
        feed: (m, 3) unit, across; NaN where there is no tilt.
        tilt: (m, 2) lead and side [rad].
    """
    lead, side = tilt[:, :1], tilt[:, 1:]
    turned = (tilt != 0.0).any(axis=1) & np.isfinite(feed[:, 0])
    feed = np.where(turned[:, None], feed, 0.0)
    right = np.cross(feed, holder)
    tilted = np.cos(side) * (np.cos(lead) * holder + np.sin(lead) * feed) + np.sin(side) * right
    cross = np.cross(holder, tilted)
    size = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(size, np.einsum("ij,ij->i", holder, tilted))
    share = np.where(turned, angle / np.maximum(size, 1e-15), 0.0)
    vectors: FloatArray = share[:, None] * cross
    return vectors


def tilt_frames(
    share: FloatArray,
    holder: tuple[FloatArray, FloatArray],
    feed: tuple[FloatArray, FloatArray],
    around: FloatArray,
) -> FloatArray:
    """Return what lead and side tilt are measured in on the way of cuts (m, k, 3, 3).

    Rows: ahead, to the right, along the CAM axis to the holder.

    Args:
        share: (k,) where.
        holder: (m, 3) CAM axes at the two ends, to the holder.
        feed: (m, 3) feed directions there; where one is NaN that of the other end counts.
        around: (m, 3) by what the feed direction goes round, axis times sweep; 0 for a line.
    """
    last = np.einsum("mij,mj->mi", rotation_from_vector(-around), feed[1])
    starts, ends = (np.where(np.isfinite(a), a, b) for a, b in ((feed[0], last), (last, feed[0])))
    turned = rotation_from_vector(share[:, None] * around[:, None])
    feed_way, up = (
        turned_between(a[:, None], b[:, None], share) for a, b in ((starts, ends), holder)
    )
    right = np.cross(np.einsum("mkij,mkj->mki", turned, feed_way), up)
    right /= np.maximum(np.linalg.norm(right, axis=-1, keepdims=True), 1e-12)
    return np.stack([np.cross(up, right), right, up], axis=-2)


def leaves_tilt_range(
    axis: FloatArray, frames: FloatArray, allowed: TiltRange, beyond: float = BETWEEN
) -> BoolArray:
    """Return (m,) the cuts on whose way the tool axis leaves the allowed tilt.

    Args:
        axis: (m, k, 3) tool axes on the way, to the holder.
        frames: (m or 1, k, 3, 3) as of ``tilt_frames``.
        allowed: lead and side tilt.
        beyond: by how much [rad] it may.
    """
    ahead, right, up = np.moveaxis(np.einsum("...ij,...j->...i", frames, axis), -1, 0)
    found = np.stack([np.arctan2(ahead, up), np.arcsin(np.clip(right, -1.0, 1.0))], axis=-1)
    low = np.array([allowed.lead[0], allowed.side[0]]) - beyond
    high = np.array([allowed.lead[1], allowed.side[1]]) + beyond
    return np.asarray(~((found >= low) & (found <= high)).all(axis=(1, 2)))


def tilt_grid(allowed: TiltRange, spins: int, tags: int, *, few: bool = True) -> FloatArray:
    """Return the tilts (T, 2) [rad] to search, lead and side; the first is none at all.

    Multiples of the step and the ends of the ranges. A step twice, three times, ... as wide is
    taken where there would be more poses than the search can hold (``MOST_TILTS`` at a tag,
    ``MOST_POSES`` in all); the local refinement finds what lies between.

    Args:
        allowed: ranges and step.
        spins: how many spins are searched.
        tags: how many tags may tilt.
        few: whether wider steps are taken for speed, too (``FEW_TILTS``).
    """
    most = min(MOST_TILTS, MOST_COLUMNS // spins, MOST_POSES // max(1, spins * tags))
    if few and most > FEW_TILTS:
        step, grid = _widened(allowed, FEW_TILTS)
        if step <= WIDE:
            return grid
    return _widened(allowed, most)[1]


def _widened(allowed: TiltRange, most: int) -> tuple[float, FloatArray]:
    """Return the narrowest step [rad] that gives no more than so many tilts, and these (T, 2).

    The widest where none does.
    """
    widest = max(high - low for low, high in (allowed.lead, allowed.side))
    for wider in range(1, 2 + int(widest / allowed.step)):
        step = wider * allowed.step
        values = [_values(limits, step) for limits in (allowed.lead, allowed.side)]
        if len(values[0]) * len(values[1]) <= most:
            break
    grid = np.array(list(itertools.product(*values)))
    return step, grid[np.argsort((grid != 0.0).any(axis=1), kind="stable")]


def coarsest(allowed: TiltRange) -> int:
    """Return how many tilts the smallest grid has."""
    return int(np.prod([len(set((low, 0.0, high))) for low, high in (allowed.lead, allowed.side)]))


def _values(limits: tuple[float, float], step: float) -> list[float]:
    low, high = limits
    first, last = int(np.ceil(low / step - ROUNDING)), int(np.floor(high / step + ROUNDING))
    inner = [i * step for i in range(first, last + 1)]
    ends = [end for end in limits if min(abs(end - value) for value in inner) > ROUNDING]
    return sorted([*inner, *ends])


def beside_in_grid(tilts: FloatArray) -> FloatArray:
    """Return (T, T) which tilts of a grid are next to each other, in lead or in side."""
    number = [np.unique(np.round(column, 9), return_inverse=True)[1] for column in tilts.T]
    steps = sum(np.abs(column[:, None] - column[None]) for column in number)
    return np.asarray(steps == 1)
