"""Motions and spline blocks: one line of code to one statement."""

from __future__ import annotations

import re

from postproc.krl.text.expression import ExpressionParser
from postproc.krl.text.lexer import KrlSyntaxError, TokenKind
from postproc.krl.text.literals import PLAIN_LITERALS
from postproc.krl.text.program import (
    Assign,
    Move,
    MoveWord,
    SplineBegin,
    SplineEnd,
    Statement,
    Value,
)

MOVES = {word.value: word for word in MoveWord}
BLENDS = frozenset({"C_DIS", "C_PTP", "C_ORI", "C_VEL", "C_SPL"})
_PLAIN_WORDS = "PTP|LIN|SPTP|SLIN|SPL"
_PLAIN_LINES = tuple(
    (
        re.compile(
            rf"[ \t]*({_PLAIN_WORDS}) {literal}(?: ({'|'.join(sorted(BLENDS))}))?[ \t]*(?:;(.*))?",
            re.ASCII,
        ),
        kind,
    )
    for literal, kind in PLAIN_LITERALS
)
_ALONE: dict[str | None, tuple[str, ...]] = {None: (), **{word: (word,) for word in BLENDS}}


def plain_move(line: str, number: int) -> Move | None:
    """Return the motion of a whole line written as nearly all are; None: read it in full.

    Its word, a literal of six numbers, at most one approximation, a comment: one pattern reads a
    hundred thousand of them.
    """
    for pattern, kind in _PLAIN_LINES:
        match = pattern.fullmatch(line)
        if match is not None:
            word, blend, comment = match.group(1, 8, 9)
            first, second, third, fourth, fifth, sixth = map(float, match.group(2, 3, 4, 5, 6, 7))
            target = kind(first, second, third, fourth, fifth, sixth)
            return Move(
                MOVES[word], target, blend=_ALONE[blend], comment=comment or "", line=number
            )
    return None


def move(parser: ExpressionParser) -> Statement:
    """Return a motion, its word taken."""
    word = MOVES[parser.tokens[0].text.upper()]
    auxiliary: Value | None = None
    angle: Value | None = None
    target = parser.value()
    if word.is_circular:
        parser.expect(",")
        auxiliary, target = target, parser.value()
    if word.is_circular and parser.accept(","):
        parser.expect("CA")
        angle = parser.value()
    blend, frame, settings = _move_tail(parser)
    return Move(word, target, auxiliary, angle, blend, settings, frame)


def _move_tail(parser: ExpressionParser) -> tuple[tuple[str, ...], str, tuple[Assign, ...]]:
    blend: list[str] = []
    frame = ""
    settings: tuple[Assign, ...] = ()
    while parser.token.kind is not TokenKind.END:
        word = parser.word()
        if word in BLENDS:
            blend.append(parser.take().text.upper())
        elif word == "WITH":
            settings = _settings(parser)
        elif parser.token.text.upper() in ("#BASE", "#TOOL"):
            frame = parser.take().text[1:].upper()
        else:
            break
    return tuple(blend), frame, settings


def _settings(parser: ExpressionParser) -> tuple[Assign, ...]:
    parser.expect("WITH")
    found = []
    while True:
        name = parser.take()
        if name.kind is not TokenKind.NAME:
            raise KrlSyntaxError(f"expected a variable behind WITH, found {name.text!r}")
        parser.selectors()
        target = written(parser.text[name.start : parser.token.start])
        parser.expect("=")
        found.append(Assign(target=target, value=parser.value()))
        if not parser.accept(","):
            return tuple(found)


def spline(parser: ExpressionParser) -> Statement:
    """Return the head of a spline block, its word taken."""
    settings = _settings(parser) if parser.word() == "WITH" else ()
    return SplineBegin(parser.tokens[0].text.upper(), settings)


def end_spline(parser: ExpressionParser) -> Statement:
    """Return the end of a spline block, its word taken."""
    return SplineEnd(_move_tail(parser)[0])


def written(text: str) -> str:
    """Return the left side of an assignment: no blanks, system variables in upper case."""
    compact = "".join(text.split())
    return compact.upper() if compact.startswith("$") else compact
