"""Findings of one reading: errors with their line, warnings once each, fixes of ``--recover``."""

from __future__ import annotations

from dataclasses import replace

from postproc.errors import Finding, ReadError, Severity, SourceRef
from postproc.records import dataclass

_SHOWN = 60


@dataclass(slots=True)
class _Kept:
    """A finding and how often it came."""

    finding: Finding
    count: int = 1


class Faults:
    """Collects what a reader finds in one file; ``recover``: fix what has one possible meaning."""

    def __init__(self, path: str, recover: bool) -> None:
        self.path = path
        self.recover = recover
        self._warnings: dict[tuple[str, str], _Kept] = {}
        self._fixes: dict[tuple[str, str], _Kept] = {}

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Warnings in the order of their first lines, repeated ones counted."""
        return tuple(replace(kept.finding, count=kept.count) for kept in self._warnings.values())

    @property
    def fixes(self) -> tuple[Finding, ...]:
        """Fixes in the order of their first lines, repeated ones counted."""
        return tuple(replace(kept.finding, count=kept.count) for kept in self._fixes.values())

    def error(
        self, code: str, message: str, line: int, text: str = "", hint: str = ""
    ) -> ReadError:
        """Return an error at a line, to be raised; ``text`` is what stands there."""
        shown = f": {shortened(text)}" if text else ""
        return ReadError(code, message + shown, SourceRef(self.path, line, text), hint)

    def warn(self, code: str, message: str, line: int) -> None:
        """Keep a warning; the same again only counts."""
        self._keep(self._warnings, code, message, line)

    def fix(self, code: str, message: str, done: str, line: int, text: str = "") -> None:
        """Record a fault that has one possible meaning, or raise it; ``done``: how it is read."""
        if not self.recover:
            raise self.error(code, message, line, text, f"--recover reads it so: {done}")
        self._keep(self._fixes, code, f"{message}; {done}", line)

    def _keep(
        self, store: dict[tuple[str, str], _Kept], code: str, message: str, line: int
    ) -> None:
        known = store.get((code, message))
        if known is None:
            source = SourceRef(self.path, line)
            store[code, message] = _Kept(Finding(Severity.WARNING, code, message, source=source))
        else:
            known.count += 1


def shortened(text: str) -> str:
    """Return printable ASCII text of at most 60 characters."""
    clean = "".join(c if " " <= c <= "~" else "?" for c in text)
    return clean if len(clean) <= _SHOWN else clean[: _SHOWN - 3] + "..."
