"""Words that are not carried out as they stand: kept with their lines, not raised.

Whether a refused word stops a program is for those to say who make one; a reader lists it.
"""

from __future__ import annotations

from dataclasses import dataclass

from postproc.model import WordClass, WordUse


@dataclass(slots=True)
class WordUses:
    """All such words of one file; the same word for the same reason is one entry."""

    _lines: dict[tuple[str, WordClass, str, bool, str], list[int]]

    def __init__(self) -> None:
        self._lines = {}

    def refuse(
        self, word: str, word_class: WordClass, line: int, reason: str, hint: str = ""
    ) -> None:
        """Keep a word that forbids a program until the user accepts it."""
        self._lines.setdefault((word, word_class, reason, True, hint), []).append(line)

    def note(
        self, word: str, word_class: WordClass, line: int, reason: str, hint: str = ""
    ) -> None:
        """Keep a word that is harmless, or how it was read."""
        self._lines.setdefault((word, word_class, reason, False, hint), []).append(line)

    def all(self) -> tuple[WordUse, ...]:
        """Return the words in the order of their first lines."""
        found = [
            WordUse(word, word_class, tuple(lines), reason, refused, hint)
            for (word, word_class, reason, refused, hint), lines in self._lines.items()
        ]
        return tuple(sorted(found, key=lambda use: use.lines[0]))
