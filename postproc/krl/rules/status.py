"""Row 12, as far as the text shows it: status and turn."""

from __future__ import annotations

from postproc.krl.rules.part import Part
from postproc.krl.rules.subject import ERROR, WARNING, Subject
from postproc.krl.text import Axes, Pose

_TURNS_OF_ROBOT = 1 << 6
_TURNS = 1 << 12


def status_and_turn(subject: Subject) -> None:
    """Row 12: S and T are possible and agree about A5; S stays the same on a path."""
    for path, line, point in subject.points_at(subject.points.more):
        if isinstance(point, Pose):
            _one(subject, path, line, point)
    for part in subject.parts:
        _chain(subject, part)


def _one(subject: Subject, path: str, line: int, pose: Pose) -> None:
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


def _chain(subject: Subject, part: Part) -> None:
    """A path motion keeps the status: another S in its target is ignored by the controller."""
    status: int | None = None
    for step in part.steps:
        target = step.target
        if step.move.word.is_axis_motion or isinstance(target, Axes):
            status = target.status if isinstance(target, Pose) else None
            continue
        here = target.status if isinstance(target, Pose) else None
        if here is None:
            continue
        if status is not None and here & 0b111 != status & 0b111:
            message = f"S {here} on a path that began with S {status}: a path keeps its status"
            subject.add(12, ERROR, part.path, step.move.line, message)
        status = here if status is None else status
