"""Where the real tool goes: the executed path shifted by what a model of the arm expects.

A load acts where the tool works. That is a question of the CAM file: the tags of a cut or a hole
are met with the wrench of their operation, rapid tags with none. Each load case is one set of
paths; in it a motion works if it is a path motion about as fast as the feeds of the case or slower.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.model import ToolPath
from postproc.paths import Displacement, Paths, Shift, moments_of
from postproc.process import feeds_of, load_cases
from postproc.records import dataclass

FAR = 1e9
"""Where a motion ends that cannot serve a tag [m]."""
FASTER = 1.5
"""A motion faster than the fastest feed by this factor does not cut; a wrong feed is one below."""


@dataclass(frozen=True, slots=True)
class RealPaths:
    """Paths of the real tool, one set for each load case; ``case`` (n,) of every tag."""

    paths: tuple[Paths, ...]
    case: IntArray
    commanded: Paths

    @classmethod
    def nominal(cls, paths: Paths, n: int) -> RealPaths:
        """Return the commanded paths as the only case of n tags."""
        return cls((paths,), np.zeros(n, dtype=np.int32), paths)

    def of(self, tag: int) -> Paths:
        """Return the paths under the load of a tag."""
        return self.paths[int(self.case[tag])]

    def rows(self, tags: AnyIntArray) -> RealPaths:
        """Return the paths for some tags (k,)."""
        return replace(self, case=self.case[tags])

    @property
    def visited(self) -> FloatArray:
        """(cases, m, 3) [m] where motions end, far away where that is not known."""
        points = self.end_point
        return np.where(np.isfinite(points), points, FAR)

    @property
    def end_point(self) -> FloatArray:
        """(cases, m, 3) [m] where motions end, in the part."""
        return np.stack([paths.end_point for paths in self.paths])


def real_paths(
    paths: Paths, cell: Cell, toolpath: ToolPath, displacement: Displacement | None
) -> RealPaths:
    """Return the paths of the real tool under every load of a CAM file, or those commanded.

    ``displacement``: real minus nominal tool point; None: there is none.
    """
    if displacement is None:
        return RealPaths.nominal(paths, len(toolpath))
    wrenches, case = load_cases(toolpath, cell)
    ends, samples = moments_of(paths, cell, displacement.lost)
    idle = _in_part(paths, displacement.of(ends.idle()), displacement.of(samples.idle()))
    nothing = np.zeros(len(paths), dtype=np.bool_)
    sets = [_moved(paths, idle, idle, nothing)]
    more = None if displacement.along is None else displacement.along(paths)
    feed = feeds_of(toolpath, cell)
    speed = paths.trace.column("speed")
    for number, wrench in enumerate(wrenches, 1):
        known = feed[(case == number) & np.isfinite(feed)]
        works = paths.trace.is_cp & (speed <= FASTER * float(known.max(initial=0.0)))
        works |= paths.stands & np.r_[False, works[:-1]]
        at_ends, inner = (displacement.of(part.under(wrench)) for part in (ends, samples))
        if more is not None:
            at_ends, inner = at_ends + more[: len(paths)], inner + more[len(paths) :]
        loaded = _in_part(paths, at_ends, inner)
        sets.append(_moved(paths, idle, loaded, works))
    return RealPaths(tuple(sets), case, paths)


def _in_part(paths: Paths, at_ends: FloatArray, at_samples: FloatArray) -> FloatArray:
    """Return shifts at ends, then samples (m + s, 3), turned from robroot to the part."""
    external = np.concatenate(
        [paths.external, paths.curves.external_at(paths.row, paths.share, paths.external)]
    )
    row = np.concatenate([np.arange(len(paths)), paths.row])
    return paths.station.turned_to_part(np.concatenate([at_ends, at_samples]), external, row)


def _moved(paths: Paths, idle: FloatArray, loaded: FloatArray, works: BoolArray) -> Paths:
    """Return the paths shifted by ``loaded`` (m + s, 3) where the tool works, by ``idle`` else."""
    m = len(paths)
    ends = np.where(works[:, None], loaded[:m], idle[:m])
    inner = np.where(works[paths.row][:, None], loaded[m:], idle[m:])
    before = np.maximum(np.arange(m) - 1, 0)
    starts = np.where(works[:, None], loaded[before], idle[before])
    place = np.concatenate([2.0 * np.arange(m), 2.0 * paths.row + paths.share])
    order = np.argsort(place, kind="stable")
    shift = Shift(place[order], np.concatenate([starts, inner])[order])
    return replace(paths, end_point=paths.end_point + ends, point=paths.point + inner, shift=shift)
