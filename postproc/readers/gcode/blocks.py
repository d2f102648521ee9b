"""Lines of G-code to blocks of words."""

from __future__ import annotations

import re
from typing import NamedTuple

from postproc.readers.text import LARGEST, Faults
from postproc.records import dataclass

_WORD = re.compile(r"([A-DF-Z])([-+]?(?:\d+\.?\d*|\.\d+))")
_COMMENT = re.compile(r"\(([^()]*)\)|;(.*)$")
_MACRO = re.compile(r"[#\[\]=<>]|\b(?:IF|WHILE|GOTO|DO\d|END\d)\b|^O\s*<", re.IGNORECASE)
_OTHER = (
    (re.compile(r"^(?:\d+\s+)?BEGIN PGM\b", re.IGNORECASE), "Heidenhain conversational"),
    (re.compile(r"^%_N_|^;\$PATH=|\bCYCLE\d+\s*\(", re.IGNORECASE), "Sinumerik"),
)


class Word(NamedTuple):
    """A letter and its number; ``whole``: written without a decimal point."""

    letter: str
    value: float
    whole: bool

    @property
    def code(self) -> str:
        """The word as codes are called: ``G1``, ``G54.1``."""
        return f"{self.letter}{self.value:g}"


@dataclass(frozen=True, slots=True)
class Block:
    """One line: its words in order, ``comment`` the last remark in it, ``skip`` behind a slash."""

    line: int
    words: tuple[Word, ...]
    comment: str = ""
    skip: bool = False


def block_of(text: str, line: int, faults: Faults) -> Block:
    """Return the block of a line; macros and other languages are errors."""
    for pattern, name in _OTHER:
        if pattern.search(text):
            raise faults.error(
                "GCD013", f"a {name} program, expected G-code (ISO); post it as G-code or APT", line
            )
    remarks = [first or second for first, second in _COMMENT.findall(text)]
    bare = _COMMENT.sub(" ", text).strip().upper()
    if not bare or bare == "%":
        return Block(line, (), remarks[-1].strip() if remarks else "")
    if _MACRO.search(bare):
        message = "a macro or expression, expected numbers; post the file without macros"
        raise faults.error("GCD002", message, line, bare)
    skip, bare = bare.startswith("/"), re.sub(r"[\s]+", "", bare.removeprefix("/"))
    found = _WORD.findall(bare)
    if sum(len(letter) + len(number) for letter, number in found) != len(bare):
        raise faults.error("GCD001", "no block of letters with numbers", line, bare)
    words = tuple(Word(letter, float(number), "." not in number) for letter, number in found)
    large = next((word for word in words if abs(word.value) > LARGEST), None)
    if large is not None:
        raise faults.error("GCD001", f"{large.letter} is too large a number", line, bare)
    return Block(line, words, remarks[-1].strip() if remarks else "", skip)
