"""Words that are not carried out as they stand: kept with their lines, not raised.

Whether a refused word stops a program is for those to say who make one; a reader lists it.
"""

from __future__ import annotations

from collections.abc import Sequence

from postproc.errors import ReadError
from postproc.model import WordClass, WordUse
from postproc.readers.text import Faults
from postproc.records import dataclass

Key = tuple[str, WordClass, str, bool, str]
"""Word, class, reason, refused, hint."""


@dataclass(slots=True)
class WordUses:
    """All such words of one file; the same word for the same reason is one entry."""

    log: list[Key]
    """What was kept, in order, once for each time."""
    _lines: dict[Key, list[int]]

    def __init__(self) -> None:
        self.log, self._lines = [], {}

    def repeat(self, said: Sequence[Key], line: int) -> None:
        """Keep again what was kept before, at another line."""
        for key in said:
            self.log.append(key)
            self._lines.setdefault(key, []).append(line)

    def refuse(
        self, word: str, word_class: WordClass, line: int, reason: str, hint: str = ""
    ) -> None:
        """Keep a word that forbids a program until the user accepts it."""
        self.repeat([(word, word_class, reason, True, hint)], line)

    def note(
        self, word: str, word_class: WordClass, line: int, reason: str, hint: str = ""
    ) -> None:
        """Keep a word that is harmless, or how it was read."""
        self.repeat([(word, word_class, reason, False, hint)], line)

    def all(self) -> tuple[WordUse, ...]:
        """Return the words in the order of their first lines."""
        found = [
            WordUse(word, word_class, tuple(lines), reason, refused, hint)
            for (word, word_class, reason, refused, hint), lines in self._lines.items()
        ]
        return tuple(sorted(found, key=lambda use: use.lines[0]))


class AtLine:
    """Says what is wrong with the line at hand of a file that is read.

    ``line``, ``text``: of the statement at hand; what stands there is shown with an error.
    """

    def __init__(self, faults: Faults, uses: WordUses | None = None) -> None:
        self.faults, self.uses = faults, uses or WordUses()
        self.line, self.text = 0, ""

    def error(self, code: str, message: str, hint: str = "") -> ReadError:
        """Return an error, to be raised."""
        return self.faults.error(code, message, self.line, self.text, hint)

    def warn(self, code: str, message: str) -> None:
        """Keep a warning."""
        self.faults.warn(code, message, self.line)

    def fix(self, code: str, message: str, done: str) -> None:
        """Record a fault that has one possible meaning, or raise it, see ``Faults.fix``."""
        self.faults.fix(code, message, done, self.line, self.text)

    def refuse(self, word: str, word_class: WordClass, reason: str, hint: str = "") -> None:
        """Keep a word that forbids a program until the user accepts it."""
        self.uses.refuse(word, word_class, self.line, reason, hint)

    def note(self, word: str, word_class: WordClass, reason: str, hint: str = "") -> None:
        """Keep a word that is harmless, or how it was read."""
        self.uses.note(word, word_class, self.line, reason, hint)
