"""Words that are not carried out as they stand: kept with their lines, not raised.

Whether a refused word stops a program is for those to say who make one; a reader lists it.
"""

from __future__ import annotations

from collections.abc import Sequence

from postproc.model import WordClass, WordUse
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
