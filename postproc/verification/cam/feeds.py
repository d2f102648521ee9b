"""Whether every motion that cuts has the feed of the CAM file."""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import RunKind, Severity
from postproc.model import ToolPath
from postproc.paths import feed_shares
from postproc.process import LOWERED_FROM, LOWERED_TO, TAPS, feeds_of
from postproc.units import MM_PER_MIN
from postproc.verification.report import Result

FEED_TOLERANCE = 1e-3
"""Share by which a feed may differ from the file's."""
AT_MOST = 20
"""So many findings of one kind are listed one by one."""


class Feeds:
    """Collects which feed each motion should have, and compares."""

    def __init__(self, result: Result, toolpath: ToolPath, cell: Cell) -> None:
        self._result = result
        self._cell = cell
        self._feed = feeds_of(toolpath, cell)
        self._speed = result.paths.trace.column("speed")
        taps = np.array([*(cycle.kind in TAPS for cycle in toolpath.cycles), False])
        self._is_bound = taps[np.asarray(toolpath.cycle)]
        self._bound: list[BoolArray] = []
        self._motions: list[AnyIntArray] = []
        self._wanted: list[FloatArray] = []

    def expect_rows(self, rows: AnyIntArray, motions: AnyIntArray) -> None:
        """Expect the feed of each tag (r,) at one motion (r,)."""
        self._motions.append(np.asarray(motions, dtype=np.int32))
        self._wanted.append(self._feed[rows])
        self._bound.append(self._is_bound[rows])

    def expect(self, row: int, motions: tuple[int, ...]) -> None:
        """Expect the feed of a tag at all these motions."""
        if motions:
            self.expect_rows(np.full(len(motions), row), np.array(motions, dtype=np.int32))

    def report(self) -> None:
        """Compare and report the worst; the feed of a tap is bound to its spindle."""
        if not self._motions:
            return
        motions, wanted = np.concatenate(self._motions), np.concatenate(self._wanted)
        known = np.isfinite(wanted) & (wanted > 0.0)
        motions, wanted = motions[known], wanted[known]
        bound = np.concatenate(self._bound)[known]
        if not len(motions):
            return
        have = self._speed[motions]
        error = np.abs(have / wanted - 1.0)
        row = int(error.argmax())
        self._result.measure("feed", float(error[row] * 100.0), "%", int(motions[row]))
        bad = np.flatnonzero(error > FEED_TOLERANCE)
        share = have[bad] / wanted[bad]
        forced = self._forced(motions[bad], share) & ~bound[bad]
        forced &= share >= self._cell.process.least_feed * (1.0 - FEED_TOLERANCE)
        self._list(motions, have, wanted, bad[forced], Severity.WARNING)
        self._list(motions, have, wanted, bad[~forced], Severity.ERROR)

    def _forced(self, motions: AnyIntArray, share: FloatArray) -> BoolArray:
        """Return which motions (b,) are slow because an axis could not follow the asked feed.

        Args:
            motions: (b,) motions.
            share: (b,) programmed feed over asked feed.
        """
        paths = self._result.paths
        needed = np.zeros(len(paths))
        if len(motions) and len(paths.row):
            np.maximum.at(needed, paths.row, feed_shares(paths, self._cell).max(axis=1))
        now = needed[motions]
        return (share < 1.0) & (now > LOWERED_FROM * share) & (now > LOWERED_TO)

    def _list(
        self,
        motions: AnyIntArray,
        have: FloatArray,
        wanted: FloatArray,
        bad: AnyIntArray,
        severity: Severity,
    ) -> None:
        why = "" if severity is Severity.ERROR else ": an axis could not follow"
        error = np.abs(have / wanted - 1.0)
        for place in bad[np.argsort(-error[bad], kind="stable")][:AT_MOST].tolist():
            more = f", {len(bad)} such motions" if len(bad) > AT_MOST else ""
            self._result.finding(
                RunKind.FEED,
                int(motions[place]),
                f"{have[place] / MM_PER_MIN:.2f} mm/min, the CAM file asks for "
                f"{wanted[place] / MM_PER_MIN:.2f} mm/min{more}{why}",
                severity,
            )
