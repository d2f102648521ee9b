"""What the controller can take: points per second, motions planned ahead, memory. Estimates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.errors import RunKind, Severity
from postproc.paths import chains, motion_times
from postproc.units import MEGABYTE, MM, MM_PER_MIN, MS
from postproc.verification.report import Remark, Said
from postproc.verification.run import Run

_HELD = 0.98
"""A speed that is held up to this share is held."""


def check_capacity(run: Run) -> Iterator[Said]:
    """Warn where the program asks more of the controller than ``[krl]`` says it can do.

    A block of splines is planned as one motion; single ones and motions that stop count no rate.
    """
    cell = run.cell
    size = sum(
        facts.size
        for module in run.modules
        for facts in (module.src_facts, module.dat_facts)
        if facts is not None
    )
    if size > cell.krl.memory:
        yield Remark(
            RunKind.MEMORY,
            0,
            f"the files take {size / MEGABYTE:.1f} MB, memory for programs is about "
            f"{cell.krl.memory / MEGABYTE:g} MB",
            Severity.WARNING,
        )
    trace = run.paths.trace
    rows = np.flatnonzero(trace.is_cp & (trace.block < 0) & (trace.column("advance") > 0))
    if len(rows):
        ahead = int(trace.column("advance")[rows].max())
        chain = chains(run.paths)
        yield from _check_rate(run, rows[_followed(rows, chain, ahead - 1)], ahead)
        yield from _check_look_ahead(run, rows[_followed(rows, chain, ahead + 1)], ahead)


def _followed(rows: AnyIntArray, chain: AnyIntArray, count: int) -> BoolArray:
    """Return which of motions (k,) so many others of them follow without a stop between."""
    result = np.zeros(len(rows), dtype=np.bool_)
    end = len(rows) - count
    if end > 0:
        apart = rows[count:] - rows[:end] == count
        result[:end] = apart & (chain[rows[:end]] == chain[rows[count:]])
    return result


def _check_rate(run: Run, rows: AnyIntArray, ahead: int) -> Iterator[Said]:
    """Warn where as many motions as are planned ahead take less time than planning them does."""
    cell = run.cell
    total = _summed(motion_times(run.paths))
    times = total[rows + ahead] - total[rows]
    fast = np.flatnonzero(times < ahead * cell.krl.block_time * _HELD)
    if not len(fast):
        return
    worst = int(fast[np.argmin(times[fast])])
    yield Remark(
        RunKind.BLOCK_RATE,
        int(rows[worst]),
        f"{ahead / max(times[worst], 1e-9):.0f} points per second, the controller plans about "
        f"{1.0 / cell.krl.block_time:.0f} ({cell.krl.block_time / MS:g} ms each), at "
        f"{len(fast)} points",
        Severity.WARNING,
    )


def _check_look_ahead(run: Run, rows: AnyIntArray, ahead: int) -> Iterator[Said]:
    """Warn where the motions planned ahead are shorter than the way in which the robot stops."""
    trace, total = run.paths.trace, _summed(run.paths.curves.length)
    planned = total[rows + 1 + ahead] - total[rows + 1]
    speed, push = trace.column("speed")[rows], trace.column("acceleration")[rows]
    most = np.sqrt(2.0 * push * planned)
    short = np.flatnonzero(most < _HELD * speed)
    if not len(short):
        return
    worst = int(short[np.argmin((most / speed)[short])])
    yield Remark(
        RunKind.LOOK_AHEAD,
        int(rows[worst]),
        f"{ahead} motions planned ahead are {planned[worst] / MM:.2f} mm: {most[worst]:.3f} m/s "
        f"({most[worst] / MM_PER_MIN:.0f} mm/min) can be held, {speed[worst]:g} m/s is programmed, "
        f"at {len(short)} points",
        Severity.WARNING,
    )


def _summed(values: FloatArray) -> FloatArray:
    """Return sums (m + 1,) of the first so many values, unknown ones as 0."""
    return np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])
