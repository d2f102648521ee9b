"""Rows 24, 25: circles that are circles, external axes."""

from __future__ import annotations

import numpy as np

from postproc.arrays import TINY, FloatArray
from postproc.krl.rules.part import Part, number, position_of
from postproc.krl.rules.subject import ERROR, WARNING, Subject
from postproc.krl.text import Statement

_LARGEST = 50_000.0
"""Radius [mm] from which on a circle is a straight line badly written."""


def circles(subject: Subject) -> None:
    """Row 24: three points apart and not on a line, a sane radius and arc angle."""
    for part in subject.parts:
        for place, step in enumerate(part.steps):
            if step.move.word.is_circular:
                start = part.positions[place - 1] if place else np.full(3, np.nan)
                _circle(subject, part, place, start)


def _circle(subject: Subject, part: Part, place: int, start: FloatArray) -> None:
    step = part.steps[place]
    line = step.move.line
    if step.move.auxiliary is None:
        subject.add(24, ERROR, part.path, line, "a circle without an auxiliary point")
        return
    angle = number(step.move.angle_deg)
    if step.move.angle_deg is not None and angle is not None and not 0.0 < abs(angle) <= 1e4:
        subject.add(24, ERROR, part.path, line, f"an arc angle of {angle:g} deg")
    if step.move.word.is_relative:
        return
    point = subject.point(step.move.auxiliary, part.module)
    middle = np.array(position_of(point), dtype=np.float64)
    end = part.positions[place]
    if not np.isfinite(np.concatenate([middle, end])).all():
        return
    if np.linalg.norm(end - middle) < TINY:
        subject.add(24, ERROR, part.path, line, "auxiliary point and end are the same")
    elif np.isfinite(start).all():
        _three_points(subject, part, line, start, middle, end)


def _three_points(
    subject: Subject, part: Part, line: int, start: FloatArray, middle: FloatArray, end: FloatArray
) -> None:
    a, b = middle - start, end - start
    area = float(np.linalg.norm(np.cross(a, b)))
    sides = [float(np.linalg.norm(v)) for v in (a, b, b - a)]
    if min(sides[:2]) < TINY:
        message = "the start is the auxiliary point or the end: no circle through them"
        subject.add(24, ERROR, part.path, line, message, hint="two arcs, or CA 360")
    elif area < 1e-6 * sides[0] * sides[1]:
        message = "start, auxiliary point and end lie on a line"
        subject.add(24, ERROR, part.path, line, message)
    elif sides[0] * sides[1] * sides[2] / (2.0 * area) > _LARGEST:
        message = "the circle has a radius of more than 50 m"
        subject.add(24, WARNING, part.path, line, message)


# ------------------------------------------------------------------------------- external axes


def external_axes(subject: Subject) -> None:
    """Row 25: external axes where the controller has them, none where it has none."""
    count = subject.options.externals
    if not (count or subject.points.more.any()):
        return  # there are none, neither here nor there
    with_any = without = 0
    first_without: tuple[str, int] | None = None
    for part in subject.parts:
        for step in part.steps:
            target = step.target
            if target is None or step.move.word.is_relative:
                continue
            if target.external:
                with_any += any(target.external)
                _values(subject, part.path, step.move, target.external, count)
            elif target.is_complete:
                without += 1
                first_without = first_without or (part.path, step.move.line)
    if first_without is None:
        return
    if count:
        message = f"{without} points without external axes, the controller has {count}"
        subject.add(25, WARNING, *first_without, message)
    elif count is None and with_any:
        message = f"{without} points without external axes, {with_any} move them"
        subject.add(25, WARNING, *first_without, message)


def _values(
    subject: Subject, path: str, move: Statement, external: tuple[float, ...], count: int | None
) -> None:
    if count is None:
        return
    beyond = [i for i, value in enumerate(external, 1) if i > count and value != 0.0]
    if beyond:
        message = f"E{beyond[0]} is not 0, the controller has {count} external axes"
        subject.add(25, WARNING, path, move.line, message)
    elif len(external) < count:
        message = f"E1 to E{len(external)} only, the controller has {count} external axes"
        subject.add(25, WARNING, path, move.line, message)
