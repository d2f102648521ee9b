"""What a finding code, a kind of violation or an effect of a diagnosis means."""

from __future__ import annotations

from typing import Any

from postproc.codes import Entry, find, nearest
from postproc.errors import UsageError
from postproc.jobs.measures import entry_of


def explained(code: str) -> Entry:
    """Return what a finding code, a kind of violation or an effect of a diagnosis means.

    Raises:
        UsageError: CLI014 if nothing has this name.
    """
    code = code.strip()
    entry = find(code.upper()) or find(code.lower()) or entry_of(code) or _effect(code.lower())
    if entry is None:
        near = ", ".join(nearest(code.upper()))
        raise UsageError(
            "CLI014",
            f"no finding has the code {code!r}" + (f", the nearest are {near}" if near else ""),
            hint="postproc explain lists all",
        )
    return entry


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
