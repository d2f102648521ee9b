"""Whether motions keep to what the CAM file says of their ends and of the speeds of axes."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.controller import Blend
from postproc.errors import RunKind
from postproc.model import ToolPath
from postproc.units import MM, PERCENT
from postproc.verification.cam.comparison import Comparison
from postproc.verification.cam.feeds import AT_MOST
from postproc.verification.report import Result

_SAME = 1e-3
"""Shares may differ by this share of them."""
_DIGITS = 1e-4 * MM
"""By so much [m] the digits of a text may lengthen an approximation."""


def check_profiles(result: Result, toolpath: ToolPath, comparison: Comparison) -> None:
    """Compare approximation, exact stops and the speeds of joint motions with the file.

    The file may be kept to at the first or at the last motion that may be meant by a tag.

    Args:
        result: the program; collects the findings.
        toolpath: what was asked for.
        comparison: which motions serve its tags.
    """
    _approximation(result, toolpath, comparison)
    _joint_speeds(result, toolpath, comparison)


def _approximation(result: Result, toolpath: ToolPath, comparison: Comparison) -> None:
    trace = result.paths.trace
    reach = np.where(trace.blend == Blend.DISTANCE, trace.column("cdis"), np.inf)
    reach = np.where(trace.blend == Blend.THROUGH, _DIGITS, reach)
    reach = np.where(trace.blend == Blend.EXACT, 0.0, reach)
    allowed = np.asarray(toolpath.largest_blend)
    rows = np.flatnonzero(np.isfinite(allowed) & (comparison.served >= 0))
    ends = comparison.served[rows], comparison.latest[rows]
    least = np.minimum(reach[ends[0]], reach[ends[1]])
    most = np.where(allowed[rows] > 0.0, allowed[rows] * (1.0 + _SAME) + _DIGITS, 0.0)
    bad = np.flatnonzero(least > most)
    for place in bad[:AT_MOST].tolist():
        row, motion = int(rows[place]), int(ends[0][place])
        limit = f"{allowed[row] / MM:g} mm at most" if allowed[row] else "an exact stop"
        text = f"{_way(float(least[place]))}, the CAM file asks for {limit}"
        _tell(result, toolpath, RunKind.APPROXIMATION, row, motion, text, len(bad))


def _way(reach: float) -> str:
    if np.isinf(reach):
        return "approximated by nobody knows how much"
    return "passed without a stop" if reach == _DIGITS else f"approximated by {reach / MM:g} mm"


def _joint_speeds(result: Result, toolpath: ToolPath, comparison: Comparison) -> None:
    trace = result.paths.trace
    moves = ~trace.is_cp & ~result.paths.stands
    share = np.array([max(item.ptp) for item in trace.settings] or [0.0])[trace.setting]
    asked = np.asarray(toolpath.joint_fraction)
    rows = np.flatnonzero(np.isfinite(asked) & (comparison.served >= 0))
    before = np.append(-1, np.maximum.accumulate(comparison.latest))[rows]
    bad = []
    for row, last in zip(rows.tolist(), before.tolist(), strict=True):
        motion = _fastest(share, moves, last + 1, comparison.served[row])
        if motion >= 0 and share[motion] > asked[row] * (1.0 + _SAME):
            bad.append((row, motion))
    for row, motion in bad[:AT_MOST]:
        text = (
            f"a joint motion at {share[motion] / PERCENT:g} %, the CAM file asks for "
            f"{asked[row] / PERCENT:g} % at most"
        )
        _tell(result, toolpath, RunKind.SPEED, row, motion, text, len(bad))


def _fastest(share: FloatArray, moves: BoolArray, first: int, last: int) -> int:
    """Return the fastest of the joint motions ``first`` to ``last``, -1 if there is none."""
    own = first + np.flatnonzero(moves[first : last + 1])
    return int(own[share[own].argmax()]) if len(own) else -1


def _tell(
    result: Result,
    toolpath: ToolPath,
    kind: RunKind,
    row: int,
    motion: int,
    text: str,
    count: int,
) -> None:
    more = f", {count} such tags" if count > AT_MOST else ""
    name = f"tag {toolpath.tag_name(row)} (line {int(toolpath.line[row])})"
    result.finding(kind, motion, f"{name}: {text}{more}")
