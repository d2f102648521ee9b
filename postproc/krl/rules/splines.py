"""Row 31: what may stand in a spline block."""

from __future__ import annotations

from postproc.krl.rules.part import Part
from postproc.krl.rules.subject import ERROR, Subject
from postproc.krl.text import (
    Assign,
    Blank,
    Call,
    Comment,
    Control,
    FoldBegin,
    FoldEnd,
    Move,
    Raw,
    SplineBegin,
    SplineEnd,
    Statement,
    Trigger,
)

_QUIET = (Comment, Blank, FoldBegin, FoldEnd, Trigger)
_BLOCK_WORDS = frozenset({"TIME_BLOCK", "CONST_VEL", "STOP"})
_SEGMENTS = {"SPLINE": ("SPL", "SLIN", "SCIRC"), "PTP_SPLINE": ("SPTP",)}


def spline_blocks(subject: Subject) -> None:
    """Row 31: only its segments, triggers and times in a spline block, SPL nowhere else."""
    for part in subject.parts:
        if part.in_block or part.of(SplineBegin) or any(s.move.word == "SPL" for s in part.steps):
            _blocks(subject, part)


def _blocks(subject: Subject, part: Part) -> None:
    word = ""
    for statement in part.routine.statements:
        if isinstance(statement, SplineBegin):
            word = statement.word
        elif isinstance(statement, SplineEnd):
            word = ""
        elif isinstance(statement, Move):
            name = statement.word.value.removesuffix("_REL")
            if name not in _SEGMENTS[word] if word else name == "SPL":
                where = f"in a {word} block" if word else "outside a spline block"
                message = f"{statement.word.value} {where}"
                subject.add(31, ERROR, part.path, statement.line, message)
        elif word and not _is_allowed(statement):
            message = f"{_shown(statement)} in a {word} block: only its segments stand there"
            hint = "set it WITH a segment or the block, or by a TRIGGER"
            subject.add(31, ERROR, part.path, statement.line, message, hint)


def _is_allowed(statement: Statement) -> bool:
    if isinstance(statement, Raw):
        return statement.word in _BLOCK_WORDS
    return isinstance(statement, _QUIET)


def _shown(statement: Statement) -> str:
    if isinstance(statement, Assign):
        return f"{statement.target}="
    if isinstance(statement, Call):
        return f"{statement.name}( )"
    if isinstance(statement, Control | Raw):
        return statement.word
    return type(statement).__name__.upper().removesuffix("SEC").removesuffix("FOR")
