"""Words that nothing carries out: refused, noted or kept as the table of words says."""

from __future__ import annotations

from postproc.model import EventKind, WordClass
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement
from postproc.readers.apt.word_classes import WORDS, Action
from postproc.readers.text import shortened

_NEAR_LENGTH = 4
_SLASHED = ("GOTO", "CIRCLE", "FEDRAT", "CYCLE", "LOADTL", "SPINDL")
"""Words that are nothing without their numbers: without a slash they are a slip of the pen."""


def unhandled(state: AptState, statement: Statement, line: int) -> None:
    """Take a statement that no handler knows.

    Raises:
        ReadError: APT003 for numbers without a word; APT005 for a word of motion without its
            slash, or a misspelt end of the file.
    """
    word = statement.word
    if not word or word[0] in "+-.0123456789":
        raise state.faults.error(
            "APT003", "numbers without a word; is a $ missing on the line before?", line,
            statement.text,
        )  # fmt: skip
    rule = WORDS.get(word)
    if rule is None:
        _unknown(state, statement, line)
    elif rule.action is Action.NOTE:
        state.uses.note(word, rule.word_class, line, rule.reason)
    elif rule.action is not Action.KEEP:
        refuse(state, statement, line, rule.word_class, rule.reason)


def refuse(
    state: AptState,
    statement: Statement,
    line: int,
    word_class: WordClass,
    reason: str,
    minor: str = "",
) -> None:
    """Refuse a word, or one form of it, and keep its text.

    Args:
        state: takes it.
        statement: the whole statement.
        line: its line.
        word_class: what it can change.
        reason: why it is refused.
        minor: the minor word that makes the form.
    """
    word = shortened(f"{statement.word}/{minor}" if minor else statement.word)
    state.uses.refuse(word, word_class, line, reason)
    keep_unknown(state, statement, line)


def keep_unknown(state: AptState, statement: Statement, line: int) -> None:
    """Count a word that is not carried out, and keep its text as an event."""
    shown = shortened(statement.word)
    state.unknown[shown] = state.unknown.get(shown, 0) + 1
    state.add_event(EventKind.UNKNOWN, line, 0.0, statement.text)


def _unknown(state: AptState, statement: Statement, line: int) -> None:
    """Refuse a word that stands in no table."""
    first = statement.word.split(" ")[0].split(",")[0]
    ends = state.dialect.ends
    slip = first in _SLASHED or any(_is_near(first, end) for end in ends)
    near = next((known for known in (*sorted(ends), *WORDS) if _is_near(first, known)), None)
    if slip:
        raise state.faults.error(
            "APT005", f"{statement.word[:30]!r} is no word; is it {near}?", line, statement.text
        )
    reason = "stands in no table of words" + (f"; is it {near}?" if near else "")
    state.uses.refuse(shortened(first), WordClass.UNKNOWN, line, reason)
    keep_unknown(state, statement, line)


def _is_near(word: str, known: str) -> bool:
    """Return whether ``word`` is ``known`` with one letter changed, missing, doubled or swapped."""
    if len(known) < _NEAR_LENGTH or abs(len(word) - len(known)) > 1:
        return False
    same = 0
    while same < min(len(word), len(known)) and word[same] == known[same]:
        same += 1
    rest, other = word[same:], known[same:]
    if len(word) == len(known):
        return rest[1:] == other[1:] or (rest[:2] == other[1::-1] and rest[2:] == other[2:])
    return rest[1:] == other if len(word) > len(known) else rest == other[1:]
