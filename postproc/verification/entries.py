"""Joint and rapid motions that end in contact, or too low above a point of a cut.

A cut begins where the CAM file leads into it, or where the tool has come down along its axis with
the feed from as high as it backs off. All else may run through the part, whether the cell has
solids or not. Without a CAM file the speeds tell what cuts, and the highest place from which the
tool has come down into a cut tells how high the part is.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import RunKind, Severity
from postproc.paths import Paths
from postproc.process import ALONG_AXIS, back_off, machining_speeds
from postproc.records import dataclass
from postproc.units import MM
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Cuts, Run

_SLACK = 0.05 * MM
_STILL = 1e-6
"""A motion shorter than this [m] goes nowhere."""


def check_entries(run: Run) -> Iterator[Said]:
    """Yield the motions by which the tool comes into a cut too fast or from too low."""
    paths, cell, cuts, led = run.paths, run.cell, run.cuts, run.cuts.led
    steps = _Steps.of(paths, cell)
    begins = _begins(paths, cuts)
    if led is None:
        lows = _too_low(steps, begins)
    else:
        lows = _not_led(steps, begins, led | (cuts.number >= 0), cell)
    for motion in islice(lows, AT_MOST):
        is_joint = not paths.trace.is_cp[motion]
        what = "a joint motion" if is_joint else "a rapid"
        text = f"{what} ends in a cut or too low above it, expected a feed down the tool axis"
        severity = Severity.ERROR if is_joint or run.has_file else Severity.WARNING
        yield Remark(RunKind.ENTRY, motion, text, severity)


@dataclass(frozen=True, slots=True)
class _Steps:
    """Motions (m,): length [m], how far each goes into the part along the tool axis [m], kinds."""

    paths: Paths
    length: FloatArray
    down: FloatArray
    is_still: BoolArray
    is_fast: BoolArray

    @classmethod
    def of(cls, paths: Paths, cell: Cell) -> _Steps:
        way = np.diff(paths.end_point, axis=0, prepend=paths.end_point[:1])
        length = np.linalg.norm(way, axis=1)
        speed = paths.trace.column("speed")
        is_fast = ~paths.trace.is_cp | ~machining_speeds(speed, cell)
        down = np.einsum("ij,ij->i", way, paths.end_axis)
        is_still = paths.stands | (length < _STILL)
        is_still[:1] = False
        return cls(paths, length, down, is_still, is_fast)

    def is_along(self, motion: int) -> bool:
        """Return whether a path motion goes into the part along the tool axis."""
        on_path = bool(self.paths.trace.is_cp[motion])
        return on_path and bool(self.down[motion] >= ALONG_AXIS * self.length[motion])

    def before(self, motion: int) -> Iterator[int]:
        """Yield the motions before one that go anywhere, the last first."""
        yield from (number for number in range(motion - 1, -1, -1) if not self.is_still[number])


def _begins(paths: Paths, cuts: Cuts) -> AnyIntArray:
    """Return the motions with which lines and arcs of cuts begin."""
    is_cut = cuts.number == 0
    return np.flatnonzero(is_cut & ~np.r_[False, is_cut[:-1]])


def _not_led(steps: _Steps, begins: AnyIntArray, led: BoolArray, cell: Cell) -> Iterator[int]:
    """Yield motions that come into a cut other than the file leads there, or from high above."""
    enough = back_off(cell) - _SLACK
    for first in begins.tolist():
        height = float(steps.down[first]) if steps.is_along(first) else 0.0
        for motion in steps.before(first):
            if led[motion] or height >= enough:
                break
            along = steps.is_along(motion)
            if steps.is_fast[motion] and not (along and height > 0.0):
                yield motion
                break
            height += float(steps.down[motion])


def _too_low(steps: _Steps, begins: AnyIntArray) -> Iterator[int]:
    """Yield motions that end deeper than where the tool came down into a cut before, and go on."""
    paths, station = steps.paths, steps.paths.station
    above: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}
    for first in begins.tolist():
        key = int(station.tool[first]), int(station.base[first])
        motion = next(steps.before(first), 0)
        if steps.is_along(first):
            above[key] = paths.end_point[motion], paths.end_axis[motion]
        elif key in above and steps.is_fast[motion]:
            point, axis = above[key]
            deeper = (paths.end_point[motion] - point) @ np.stack([axis, paths.end_axis[motion]]).T
            if deeper.max() > _SLACK:
                yield motion
