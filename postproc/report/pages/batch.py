"""The page of a batch: every input with what became of it, those that failed first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from postproc.report.parts import Page, table

_SHOWN = 3
"""So many errors of an input stand in the table; the manifest has all."""


def batch_page(document: Mapping[str, Any], links: Mapping[str, str] | None = None) -> bytes:
    """Return the page of a batch; ``links``: addresses of the inputs' own pages where there are."""
    entries: Mapping[str, Mapping[str, Any]] = document["entries"]
    failed = [key for key, entry in entries.items() if entry["status"] != "ok"]
    good = [key for key in entries if key not in set(failed)]
    count = f"{len(good)} of {len(entries)} inputs have a program that passed every check"
    lead = [f"{count}, {len(failed)} failed." if failed else f"{count}."]
    page = Page("Batch", lead, good=not failed)
    if failed:
        rows = [(key, _errors(entries[key])) for key in failed]
        page.section("Failed", table(("input", "why"), rows, links or {}))
    rows_good = [_row(key, entries[key]) for key in good]
    head = ("input", "program", "tags", "cycle time [s]", "warnings")
    body = table(head, rows_good, links or {}) if good else "<p>none</p>"
    page.section("Programs", body)
    return page.render()


def _errors(entry: Mapping[str, Any]) -> str:
    errors, left = entry["errors"][:_SHOWN], len(entry["errors"]) - _SHOWN
    return "; ".join([*errors, f"and {left} more"] if left > 0 else errors)


def _row(key: str, entry: Mapping[str, Any]) -> tuple[object, ...]:
    time = entry.get("cycle_time_s")
    return (
        key,
        entry.get("program") or "",
        entry.get("tags", ""),
        "" if time is None else f"{time:.1f}",
        len(entry.get("warnings", ())),
    )
