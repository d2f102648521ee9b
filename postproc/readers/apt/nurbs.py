"""NX's NURBS motions: a clamped B-spline from the point before, discretised to a chord tolerance.

The record gives the interior knots and the last one, and all control points but the first, which
is where the tool stands. So m control points and k knots make a spline of degree m - k + 1; all
files seen have degree 3.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.readers.apt.state import AptState, SplineDraft, SplineRecord
from postproc.readers.apt.statement import Statement

MOST_SEGMENTS = 100_000
_HIGHEST_DEGREE = 9


def open_spline(state: AptState, statement: Statement) -> None:
    """Handle NURBS/: KNOT and CNTRL lines follow."""
    R, t = state.frames[int(state.frame.value)]
    state.spline = SplineDraft(
        state.line, state.tag, R, t, state.feed.value, int(state.operation.value)
    )


def knot_statement(state: AptState, statement: Statement) -> None:
    """Handle KNOT/: one or more knots."""
    _draft(state).knots += _numbers(state, statement)


def control_statement(state: AptState, statement: Statement) -> None:
    """Handle CNTRL/x,y,z: one control point."""
    numbers = _numbers(state, statement)
    if len(numbers) != 3:
        raise state.error("APT081", "CNTRL needs 3 numbers")
    _draft(state).points.append(numbers)


def close_spline(state: AptState) -> None:
    """End the spline at hand, if any: its place is before the next point."""
    draft, state.spline = state.spline, None
    if draft is None:
        return
    degree = len(draft.points) - len(draft.knots) + 1
    knots = np.array([0.0, *draft.knots])
    if not 1 <= degree <= _HIGHEST_DEGREE or (np.diff(knots) < 0.0).any() or knots[-1] <= 0.0:
        text = f"{len(draft.knots)} knots and {len(draft.points)} control points make no NURBS"
        raise state.faults.error("APT082", text, draft.line)
    points = np.array(draft.points) * state.scale @ draft.R.T + draft.t
    state.splines.append(
        SplineRecord(draft.tag, draft.line, tuple(draft.knots), points, draft.feed, draft.operation)
    )
    state.last_point = None


def discretised(record: SplineRecord, start: FloatArray, tolerance: float) -> FloatArray | None:
    """Return points (n, 3) [m] of the spline, without the start, with chords within tolerance [m].

    None where that takes more than ``MOST_SEGMENTS``. Each knot span is cut into equal parts; a
    part of parameter length h leaves its chord by at most h^2/8 times the largest second
    derivative, which the control polygon bounds. ``start`` (3,): where the tool stands [m].
    """
    control = np.vstack([start, record.points])
    degree = len(record.points) - len(record.knots) + 1
    last = record.knots[-1]
    knots = np.array([0.0] * (degree + 1) + list(record.knots[:-1]) + [last] * (degree + 1))
    spans = np.unique(knots)
    bound = _second_derivative(control, knots, degree)
    steps = np.diff(spans) * np.sqrt(bound / (8.0 * tolerance))
    if not steps.sum() <= MOST_SEGMENTS:
        return None
    counts = np.maximum(np.ceil(steps), 1.0).astype(np.int64)
    parameters = np.concatenate(
        [
            np.linspace(a, b, n + 1)[1:]
            for a, b, n in zip(spans[:-1], spans[1:], counts, strict=True)
        ]
    )
    return de_boor(control, knots, degree, parameters)


def de_boor(
    control: FloatArray, knots: FloatArray, degree: int, parameters: FloatArray
) -> FloatArray:
    """Return points (n, d) of a B-spline with these control points (m, d) and full knot vector."""
    span = np.searchsorted(knots, parameters, side="right") - 1
    span = np.clip(span, degree, len(control) - 1)
    points = control[span[:, None] + np.arange(-degree, 1)]
    for level in range(1, degree + 1):
        index = span[:, None] + np.arange(level - degree, 1)
        low, high = knots[index], knots[index + degree + 1 - level]
        width = high - low
        share = np.where(
            width > 0.0, (parameters[:, None] - low) / np.where(width > 0, width, 1.0), 0.0
        )
        points = (1.0 - share)[..., None] * points[:, :-1] + share[..., None] * points[:, 1:]
    result: FloatArray = points[:, 0]
    return result


def _second_derivative(control: FloatArray, knots: FloatArray, degree: int) -> float:
    """Return a bound of the second derivative's length: that of its control points."""
    points, p = control, degree
    inner = knots
    for _ in range(2):
        if p < 1 or len(points) < 2:
            return 0.0
        width = inner[p + 1 : p + len(points)] - inner[1 : len(points)]
        points = p * np.diff(points, axis=0) / np.where(width > 0, width, np.inf)[:, None]
        inner = inner[1:-1]
        p -= 1
    return float(np.linalg.norm(points, axis=1).max(initial=0.0))


def _draft(state: AptState) -> SplineDraft:
    if state.spline is None or state.spline.tag != state.tag:
        raise state.faults.error("APT080", "KNOT or CNTRL without NURBS before it", state.line)
    return state.spline


def _numbers(state: AptState, statement: Statement) -> list[float]:
    numbers = [value for value in statement.numbers() if value is not None]
    if len(numbers) != len(statement.args) or not numbers:
        raise state.error("APT081", f"{statement.word} needs numbers only")
    return numbers
