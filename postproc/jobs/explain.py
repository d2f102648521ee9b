"""What a finding code, a kind of violation, an effect or a word that commands print means."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from postproc.codes import Entry, find, nearest
from postproc.errors import UsageError
from postproc.jobs.measures import entry_of
from postproc.resources import glossary_file

_ROW = re.compile(r"\| \*\*(?P<words>.+?)\*\* \| (?P<meaning>.+) \|")
_LINK = re.compile(r"\[([^]]+)\]\([^)]+\)")


def explain(code: str) -> Entry:
    """Return what a finding code, a kind of violation, an effect of a diagnosis or a word means.

    Args:
        code: such as ``PLN101``, ``joint_limit``, the name of an effect.

    Returns:
        ``title``, ``cause``, ``remedy``, ``severity``.

    Raises:
        UsageError: CLI014 if nothing has this name.
    """
    code = code.strip()
    word = " ".join(code.lower().replace("_", " ").split())
    entry = find(code.upper()) or find(code.lower()) or entry_of(code) or _effect(code.lower())
    entry = entry or glossary().get(word) or glossary().get(word.removesuffix("s"))
    if entry is None:
        near = ", ".join(nearest(code.upper()))
        raise UsageError(
            "CLI014",
            f"no finding or word is called {code!r}"
            + (f", the nearest are {near}" if near else ""),
            hint="postproc explain lists all codes",
        )
    return entry


@cache
def glossary() -> dict[str, Entry]:
    """Return the words of the glossary: its row is the title, there is nothing to remedy."""
    found = {}
    for line in glossary_file().read_text(encoding="utf-8").splitlines():
        if row := _ROW.fullmatch(line):
            meaning = _LINK.sub(r"\1", row["meaning"]).replace("`", "")
            for word in row["words"].split(", "):
                found[word.lower().replace("_", " ")] = Entry(word, meaning, "", "")
    return found


def _effect(name: str) -> Entry | None:
    """Return what an effect of a diagnosis is, as an entry; None if none has this name."""
    from postproc.gap import EFFECTS

    if name not in EFFECTS:
        return None
    effect = EFFECTS.get(name)
    return Entry(
        name, effect.title, f"an effect that diagnose tries: {effect.source}", effect.action
    )


def explain_document(entry: Entry) -> dict[str, Any]:
    """Return the ``postproc.explain/1`` document of one entry."""
    return {
        "schema": "postproc.explain/1",
        "code": entry.code,
        "severity": entry.severity,
        "title": entry.title,
        "cause": entry.cause,
        "remedy": entry.remedy,
    }
