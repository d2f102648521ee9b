"""The catalogue of finding codes: what each means, why it matters, what the user does about it.

One TOML file per prefix (``apt.toml`` holds APT001, APT003, ...). ``about`` names the field of the
prefix; each table is one code. ``severity`` is left out where a code has several. ``modules`` says
in how many modules a code is raised when it is more than one: a second module is where a second
meaning would creep in, so it has to be put down here.
"""

from __future__ import annotations

import difflib
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from postproc.errors import Severity

__all__ = ["Entry", "Group", "find", "groups", "nearest"]

_FOLDER = Path(__file__).parent
_SHOWN = 3


@dataclass(frozen=True, slots=True)
class Entry:
    """What one code means; ``severity`` None: it depends on the case."""

    code: str
    title: str
    cause: str
    remedy: str
    severity: Severity | None = None
    modules: int = 1


@dataclass(frozen=True, slots=True)
class Group:
    """All codes of one prefix, by number."""

    prefix: str
    about: str
    entries: tuple[Entry, ...]


def find(code: str) -> Entry | None:
    """Return the entry of a code such as ``APT012``, None if there is no such code."""
    prefix = code.rstrip("0123456789")
    if prefix not in _prefixes():
        return None
    return next((entry for entry in _group(prefix).entries if entry.code == code), None)


def groups() -> tuple[Group, ...]:
    """Return the whole catalogue by prefix."""
    return tuple(_group(prefix) for prefix in _prefixes())


def nearest(code: str) -> tuple[str, ...]:
    """Return the known codes that look most like ``code``: by number under a known prefix."""
    prefix = code.rstrip("0123456789")
    if prefix in _prefixes():
        known = [entry.code for entry in _group(prefix).entries]
        number = int(code[len(prefix) :][:9] or 0)
        return tuple(sorted(known, key=lambda k: abs(int(k[len(prefix) :]) - number))[:_SHOWN])
    known = [entry.code for group in groups() for entry in group.entries]
    return tuple(difflib.get_close_matches(code, known, _SHOWN))


@cache
def _prefixes() -> tuple[str, ...]:
    return tuple(sorted(path.stem.upper() for path in _FOLDER.glob("*.toml")))


@cache
def _group(prefix: str) -> Group:
    tables = tomllib.loads((_FOLDER / f"{prefix.lower()}.toml").read_text(encoding="utf-8"))
    about = tables.pop("about")
    return Group(prefix, about, tuple(_entry(code, tables[code]) for code in sorted(tables)))


def _entry(code: str, table: dict[str, Any]) -> Entry:
    severity = Severity(table["severity"]) if "severity" in table else None
    texts = (table["title"], table["cause"], table["remedy"])
    return Entry(code, *texts, severity, table.get("modules", 1))
