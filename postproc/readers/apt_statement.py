"""One APT statement as data: word and arguments, and the reading of its numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass

from postproc.readers.decimals import LARGEST, parse_number

FREE_TEXT = ("PARTNO", "PPRINT", "TPRINT", "INSERT")
"""Words after which everything to the end of the line is text, commas and slashes included."""
_FREE_TEXT = re.compile(r"(PARTNO|PPRINT|TPRINT|INSERT)(?=[\s/]|$)", re.IGNORECASE)
_BLANKS = re.compile(r"\s+")


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement: ``word`` in upper case, ``args`` stripped, ``text`` as it stands in the file."""

    word: str
    args: tuple[str, ...]
    text: str

    @property
    def upper(self) -> tuple[str, ...]:
        """The arguments in upper case."""
        return tuple(arg.upper() for arg in self.args)

    @property
    def free_text(self) -> str:
        """What stands after the slash, else after the word."""
        _, slash, rest = self.text.partition("/")
        return (rest if slash else self.text[len(self.word) :]).strip()

    def numbers(self) -> list[float | None]:
        """Return the arguments as numbers, None where one is a word, empty or out of range."""
        return [bounded(arg) for arg in self.args]


def bounded(text: str) -> float | None:
    """Return a number of believable size, else None."""
    value = parse_number(text)
    return value if value is not None and abs(value) <= LARGEST else None


def is_free_text(text: str) -> bool:
    """Return whether a line is a word followed by free text."""
    return _FREE_TEXT.match(text) is not None


def parse_statement(text: str) -> Statement:
    """Return the statement of a joined line (continuations appended, comment lines excluded)."""
    text = text.strip()
    match = _FREE_TEXT.match(text)
    if match:
        word = match.group(1).upper()
        rest = text[match.end() :].strip().removeprefix("/").strip()
        return Statement(word, (rest,) if rest else (), text)
    body = text.partition("$$")[0]
    head, slash, rest = body.partition("/")
    word = _BLANKS.sub(" ", head.strip()).upper()
    args = tuple(part.strip() for part in rest.split(",")) if slash and rest.strip() else ()
    return Statement(word, args, text)
