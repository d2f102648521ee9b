"""One APT statement as data: word and arguments, and the reading of its numbers."""

from __future__ import annotations

import re

from postproc.readers.text import LARGEST, parse_number
from postproc.records import dataclass

FREE_TEXT = ("PARTNO", "PPRINT", "TPRINT", "INSERT")
"""Words after which everything to the end of the line is text, commas and slashes included."""
_FREE_TEXT = re.compile(r"(PARTNO|PPRINT|TPRINT|INSERT)(?=[\s/]|$)", re.IGNORECASE)
_SIEMENS_CALL = re.compile(r"\s*(?:MCALL\s+)?(CYCLE8\d)\s*\((.*)\)\s*$", re.IGNORECASE)
_BLANKS = re.compile(r"\s+")


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement: ``word`` in upper case, ``args`` stripped, ``text`` as it stands in the file.

    ``upper``: the arguments in upper case.
    """

    word: str
    args: tuple[str, ...]
    text: str
    upper: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Fill in ``upper``."""
        object.__setattr__(self, "upper", tuple(arg.upper() for arg in self.args))

    @property
    def free_text(self) -> str:
        """What stands after the slash, else after the word."""
        if self.word in FREE_TEXT:
            return self.args[0] if self.args else ""
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
    call = _SIEMENS_CALL.match(body)
    if call:
        return Statement(call.group(1).upper(), _arguments(call.group(2)), text)
    head, slash, rest = body.partition("/")
    word = _BLANKS.sub(" ", head.strip()).upper()
    return Statement(word, _arguments(rest) if slash else (), text)


def _arguments(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",")) if text.strip() else ()
