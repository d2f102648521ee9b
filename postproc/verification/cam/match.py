"""What a program and its CAM file have to do with each other: which motions serve what of the file.

Every point of the file (the bottom of a hole, else the tag itself) must be an end point of a
motion, in the file's order, within the tolerance. What is found here is only paired and measured,
by motions and tags; the checks judge it.

With a model of the arm all this is asked of the real tool: the commanded points may be off the file
by what the arm is expected to give way (see ``real``).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import DataError
from postproc.model import ToolPath
from postproc.paths import Displacement, Paths
from postproc.process import Assignment, assign, only, reordered
from postproc.records import dataclass
from postproc.verification.cam.calls import Calls, calls_of
from postproc.verification.cam.drilled import Again, Hole, holes_of, program_order
from postproc.verification.cam.elements import Ways, ways_of
from postproc.verification.cam.matching import Served, visits_of, wanted_of
from postproc.verification.cam.real import RealPaths, real_paths
from postproc.verification.cam.thinned import Passed, passed_of
from postproc.verification.cam.tilt import Tilts
from postproc.verification.report import Expectation, Tolerances


@dataclass(frozen=True, slots=True)
class Off:
    """How far the program is off each tag (n,).

    ``motion``: that serves the tag or, where none does, comes nearest, -1 for none; ``position``
    [m], infinite without a motion; ``axis`` [rad] beyond the allowed tilt; ``tilt`` [rad] used of
    it; ``commanded`` [m] of the commanded point.
    """

    motion: IndexArray
    position: FloatArray
    axis: FloatArray
    tilt: FloatArray
    commanded: FloatArray

    def spread(self, kept: IndexArray, passed: Passed) -> Off:
        """Return the same of all tags, where these are ``kept`` and the others are passed."""
        if not len(passed.tag):
            return self
        both = np.concatenate([kept, passed.tag])
        of_passed = passed.motion, passed.chord, passed.axis_error, passed.tilt, passed.chord
        mine = (getattr(self, name) for name in Off.__slots__)
        columns = (np.concatenate(pair) for pair in zip(mine, of_passed, strict=True))
        return Off(*(column[np.argsort(both)] for column in columns))


@dataclass(frozen=True, slots=True)
class Uses:
    """What each motion (m,) is for.

    ``milled``: it serves lines and arcs; ``on_axis``: row of the hole along whose axis it runs, -1
    for none; ``is_cut``: it cuts; ``cut_of``: number of the cut that it belongs to, the way back of
    a hole with it, 0 for lines and arcs, -1 for none; ``is_judged``: what the file asks for, and
    what is on a way that is judged as wrong.
    """

    milled: BoolArray
    on_axis: IndexArray
    is_cut: BoolArray
    cut_of: IndexArray
    is_judged: BoolArray


@dataclass(frozen=True, slots=True)
class Match:
    """A program and its CAM file, tags in the order of the program.

    ``tags``: those that it goes to, ``off`` how near; ``every``: these and the ``passed`` ones;
    ``order``: place in the file of each of them; ``path_tolerance`` [m] beside lines and arcs;
    ``is_real``: with a model of the arm, of which ``real`` are the paths; ``may_slow``: it has
    effects that a lower feed makes less; ``again``: holes drilled too often; ``ways``, ``holes``,
    ``uses``: how cuts and holes are run; ``calls``: the process.
    """

    cell: Cell
    tolerances: Tolerances
    path_tolerance: float
    is_real: bool
    may_slow: bool
    real: RealPaths
    tilts: Tilts
    order: IndexArray
    again: tuple[Again, ...]
    every: Served
    tags: Served
    passed: Passed
    allowed_off: float
    off: Off
    off_every: Off
    ways: Ways
    holes: Mapping[int, Hole]
    uses: Uses
    calls: Calls

    @property
    def assigned(self) -> Assignment:
        """The tool and the base of each of ``tags``."""
        return assign(self.tags.toolpath, self.cell)

    @property
    def shift(self) -> float:
        """How far [m] commands are at most off where the real tool works, 0 without a model."""
        served = self.tags.first >= 0
        return float(self.off.commanded[served].max(initial=0.0)) if self.is_real else 0.0

    @property
    def expectation(self) -> Expectation | None:
        """The deviations of the real and of the commanded tool, None without a model."""
        off = self.off_every
        known = np.isfinite(off.position) & (off.motion >= 0)
        real, commanded = off.position[known], off.commanded[known]
        worst = [float(v.max(initial=0.0)) for v in (real, commanded)]
        rms = [float(np.sqrt(np.mean(v**2))) if len(v) else 0.0 for v in (real, commanded)]
        return Expectation(worst[0], rms[0], worst[1], rms[1]) if self.is_real else None


def match_of(
    paths: Paths,
    cell: Cell,
    toolpath: ToolPath,
    tolerances: Tolerances,
    displacement: Displacement | None = None,
) -> Match:
    """Return what a program and its CAM file have to do with each other.

    ``displacement``: of the real tool point against the commanded one; None: as commanded. VER001
    if a tag has no point, only the joint angles of some robot.
    """
    _require_points(toolpath)
    left = 0.0 if displacement is None else displacement.left
    path_tolerance = cell.motion.chord if tolerances.path is None else tolerances.path
    path_tolerance += tolerances.position
    real = real_paths(paths, cell, toolpath, displacement)
    order, again = program_order(cell, toolpath, real, tolerances.position)
    if (order[1:] < order[:-1]).any():
        toolpath, real = reordered(toolpath, order), real.rows(order)
    every_tilts = Tilts.of(toolpath, cell)
    passed = passed_of(cell, toolpath, real, every_tilts, (tolerances.position, left))
    kept = np.setdiff1d(np.arange(len(toolpath)), passed.tag)
    fewer = toolpath if len(kept) == len(toolpath) else only(toolpath, kept)
    tilts, real = every_tilts.rows(kept), real.rows(kept)
    wanted = wanted_of(fewer)
    visits = visits_of(real, wanted, assign(fewer, cell), tolerances.position, left)
    tags = Served(fewer, wanted, visits.first, visits.last)
    every = tags.spread(toolpath, kept, passed.tag, passed.motion)
    ways = ways_of(fewer, wanted, tags.first, real, path_tolerance)
    holes = holes_of(real, wanted, tags.first, tolerances.position)
    uses = _uses(paths, tags, ways, holes, path_tolerance)
    off = _off(real, tags, tilts)
    return Match(
        cell=cell,
        tolerances=tolerances,
        path_tolerance=path_tolerance,
        is_real=displacement is not None,
        may_slow=displacement is not None and displacement.along is not None,
        real=real,
        tilts=tilts,
        order=order,
        again=again,
        every=every,
        tags=tags,
        passed=passed,
        allowed_off=tolerances.position + left if displacement is not None else 0.0,
        off=off,
        off_every=off.spread(kept, passed),
        ways=ways,
        holes=holes,
        uses=uses,
        calls=calls_of(paths, cell, every),
    )


def _require_points(toolpath: ToolPath) -> None:
    missing = np.flatnonzero(~np.isfinite(toolpath.points).all(axis=1))
    if len(missing):
        row = int(missing[0])
        text = f"tag {toolpath.tag_name(row)} gives joint angles only, no point to compare with"
        raise DataError("VER001", text, toolpath.source(row))


def _off(real: RealPaths, tags: Served, tilts: Tilts) -> Off:
    """Return how far the program is off each tag; at a missed one, between its neighbours."""
    paths, wanted, first = real.commanded, tags.wanted, tags.first
    motion = first.astype(np.int64)
    before = np.maximum.accumulate(first)
    behind = np.minimum.accumulate(np.where(first < 0, len(paths), first)[::-1])[::-1]
    visited = real.visited
    for row in np.flatnonzero(first < 0).tolist():
        low, high = max(int(before[row]), 0), min(int(behind[row]) + 1, len(paths))
        gap = np.linalg.norm(visited[real.case[row], low:high] - wanted.point[row], axis=1)
        motion[row] = low + int(gap.argmin()) if len(gap) else -1
    n = len(first)
    position, commanded, axis, tilt = np.full(n, np.inf), np.zeros(n), np.zeros(n), np.zeros(n)
    some = np.flatnonzero(motion >= 0)
    if len(some):
        at = motion[some]
        position[some] = np.linalg.norm(visited[real.case[some], at] - wanted.point[some], axis=1)
        commanded[some] = np.linalg.norm(paths.end_point[at] - wanted.point[some], axis=1)
        axis[some], tilt[some] = tilts.judge(some, paths.end_axis[at])
    return Off(motion, position, axis, np.where(first >= 0, tilt, 0.0), commanded)


def _uses(
    paths: Paths, tags: Served, ways: Ways, holes: Mapping[int, Hole], tolerance: float
) -> Uses:
    m, is_cp = len(paths), paths.trace.is_cp
    milled = np.zeros(m, dtype=np.bool_)
    milled[ways.is_cut] = True
    on_axis, cut_of = np.full(m, -1), np.where(milled, 0, -1)
    is_cut, moves = milled.copy(), is_cp | paths.stands
    for row, hole in holes.items():
        is_cut[list(hole.drilled)] = True
        on_axis[[motion for motion in hole.on_axis if moves[motion]]] = row
        cut_of[hole.begin : hole.left + 1] = row + 1
    judged = is_cut | (on_axis >= 0)
    for first, last in ways.judged(tolerance):
        judged[first : last + 1] = True
    served = tags.first >= 0
    judged[tags.first[served]] = True
    latest = tags.last[served]
    judged[latest] |= is_cp[latest]  # a joint motion serves a point once
    return Uses(milled, on_axis, is_cut, cut_of, judged)
