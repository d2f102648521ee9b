"""The catalogue of finding codes: what each means, why it matters, what the user does about it.

One TOML file per prefix (``apt.toml`` holds APT001, APT003, ...); ``ver.toml`` also has the kinds
that name what a verification finds. ``about`` names the field of the prefix; each table is one
code. ``severity`` is left out where a code has several. ``modules`` says in how many modules a code
is raised when it is more than one: a second module is where a second meaning would creep in, so it
has to be put down here.
"""

from __future__ import annotations

import difflib
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from postproc.errors import RunKind, Severity
from postproc.records import dataclass

_FOLDER = Path(__file__).parent
_SHOWN = 3
_KINDS, _OF_KINDS = frozenset(RunKind), "VER"


@dataclass(frozen=True, slots=True)
class Entry:
    """What one code or kind means; ``severity`` None: it depends on the case."""

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
    """Return the entry of ``APT012`` or ``joint_limit``, None if there is no such code."""
    prefix = _OF_KINDS if code in _KINDS else code.rstrip("0123456789")
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
        known = [e.code for e in _group(prefix).entries if e.code.startswith(prefix)]
        number = int(code[len(prefix) :][:9] or 0)
        return tuple(sorted(known, key=lambda k: abs(int(k[len(prefix) :]) - number))[:_SHOWN])
    codes = {entry.code.lower(): entry.code for group in groups() for entry in group.entries}
    return tuple(codes[k] for k in difflib.get_close_matches(code.lower(), codes, _SHOWN))


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
