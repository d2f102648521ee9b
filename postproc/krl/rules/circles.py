"""Rows 12, 24, 25, 31: status and turn as the text shows them, circles, external axes, splines."""

from __future__ import annotations

import numpy as np

from postproc.arrays import TINY, FloatArray
from postproc.krl import text as krl
from postproc.krl.rules.part import Part, number, position_of
from postproc.krl.rules.subject import ERROR, WARNING, Subject

_LARGEST = 50_000.0
"""Radius [mm] from which on a circle is a straight line badly written."""


def circles(subject: Subject) -> None:
    """Row 24: three points apart and not on a line, a sane radius and arc angle."""
    for part in subject.parts:
        for place, step in enumerate(part.steps):
            if step.move.word.is_circular:
                start = part.positions[place - 1] if place else np.full(3, np.nan)
                _circle(part, place, start)


def _circle(part: Part, place: int, start: FloatArray) -> None:
    step = part.steps[place]
    line = step.move.line
    if step.move.auxiliary is None:
        part.error(24, line, "a circle without an auxiliary point")
        return
    angle = number(step.move.angle_deg)
    if step.move.angle_deg is not None and angle is not None and not 0.0 < abs(angle) <= 1e4:
        part.error(24, line, f"an arc angle of {angle:g} deg")
    if step.move.word.is_relative:
        return
    point = part.subject.point(step.move.auxiliary, part.module)
    middle = np.array(position_of(point), dtype=np.float64)
    end = part.positions[place]
    if not np.isfinite(np.concatenate([middle, end])).all():
        return
    if np.linalg.norm(end - middle) < TINY:
        part.error(24, line, "auxiliary point and end are the same")
    elif np.isfinite(start).all():
        _three_points(part, line, start, middle, end)


def _three_points(
    part: Part, line: int, start: FloatArray, middle: FloatArray, end: FloatArray
) -> None:
    a, b = middle - start, end - start
    area = float(np.linalg.norm(np.cross(a, b)))
    sides = [float(np.linalg.norm(v)) for v in (a, b, b - a)]
    if min(sides[:2]) < TINY:
        message = "the start is the auxiliary point or the end: no circle through them"
        part.error(24, line, message, hint="two arcs, or CA 360")
    elif area < 1e-6 * sides[0] * sides[1]:
        part.error(24, line, "start, auxiliary point and end lie on a line")
    elif sides[0] * sides[1] * sides[2] / (2.0 * area) > _LARGEST:
        part.warn(24, line, "the circle has a radius of more than 50 m")


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
    subject: Subject, path: str, move: krl.Statement, external: tuple[float, ...], count: int | None
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


_QUIET = (krl.Comment, krl.Blank, krl.FoldBegin, krl.FoldEnd, krl.Trigger)
_BLOCK_WORDS = frozenset({"TIME_BLOCK", "CONST_VEL", "STOP"})
_SEGMENTS = {"SPLINE": ("SPL", "SLIN", "SCIRC"), "PTP_SPLINE": ("SPTP",)}


def spline_blocks(subject: Subject) -> None:
    """Row 31: only its segments, triggers and times in a spline block, SPL nowhere else."""
    for part in subject.parts:
        if (
            part.in_block
            or part.of(krl.SplineBegin)
            or any(s.move.word == "SPL" for s in part.steps)
        ):
            _blocks(part)


def _blocks(part: Part) -> None:
    word = ""
    for statement in part.routine.statements:
        if isinstance(statement, krl.SplineBegin):
            word = statement.word
        elif isinstance(statement, krl.SplineEnd):
            word = ""
        elif isinstance(statement, krl.Move):
            name = statement.word.value.removesuffix("_REL")
            if name not in _SEGMENTS[word] if word else name == "SPL":
                where = f"in a {word} block" if word else "outside a spline block"
                part.error(31, statement.line, f"{statement.word.value} {where}")
        elif word and not _is_allowed(statement):
            message = f"{_shown(statement)} in a {word} block: only its segments stand there"
            hint = "set it WITH a segment or the block, or by a TRIGGER"
            part.error(31, statement.line, message, hint)


def _is_allowed(statement: krl.Statement) -> bool:
    if isinstance(statement, krl.Raw):
        return statement.word in _BLOCK_WORDS
    return isinstance(statement, _QUIET)


def _shown(statement: krl.Statement) -> str:
    if isinstance(statement, krl.Assign):
        return f"{statement.target}="
    if isinstance(statement, krl.Call):
        return f"{statement.name}( )"
    if isinstance(statement, krl.Control | krl.Raw):
        return statement.word
    return type(statement).__name__.upper().removesuffix("SEC").removesuffix("FOR")


_TURNS_OF_ROBOT = 1 << 6
_TURNS = 1 << 12


def status_and_turn(subject: Subject) -> None:
    """Row 12: S and T are possible and agree about A5; S stays the same on a path."""
    for path, line, point in subject.points_at(subject.points.more):
        if isinstance(point, krl.Pose):
            _one(subject, path, line, point)
    for part in subject.parts:
        _chain(part)


def _one(subject: Subject, path: str, line: int, pose: krl.Pose) -> None:
    s, t = pose.status, pose.turn
    if s is None and t is None:
        return
    most = _TURNS if pose.external else _TURNS_OF_ROBOT
    if (s is not None and not 0 <= s < 32) or (t is not None and not 0 <= t < most):
        subject.add(12, ERROR, path, line, f"S {s}, T {t}: out of range")
        return
    if s is not None and s & 0b01000:
        subject.add(12, ERROR, path, line, f"S {s}: bit 3 has no meaning on a six-axis robot")
    if s is not None and s & 0b10000:
        message = f"S {s}: bit 4 marks a point taught on an absolutely accurate robot"
        subject.add(12, WARNING, path, line, message)
    if s is not None and t is not None and (s >> 2 & 1) != (t >> 4 & 1):
        message = f"S {s} and T {t} contradict each other about the sign of A5"
        subject.add(12, ERROR, path, line, message)


def _chain(part: Part) -> None:
    """A path motion keeps the status: another S in its target is ignored by the controller."""
    status: int | None = None
    for step in part.steps:
        target = step.target
        if step.move.word.is_axis_motion or isinstance(target, krl.Axes):
            status = target.status if isinstance(target, krl.Pose) else None
            continue
        here = target.status if isinstance(target, krl.Pose) else None
        if here is None:
            continue
        if status is not None and here & 0b111 != status & 0b111:
            message = f"S {here} on a path that began with S {status}: a path keeps its status"
            part.error(12, step.move.line, message)
        status = here if status is None else status
