"""Whether a CAM file asks for what a program does not do: its words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from postproc.errors import Finding, RunKind, Severity, SourceRef, listed
from postproc.model import ToolPath, WordUse


def word_findings(toolpath: ToolPath) -> tuple[Finding, ...]:
    """Return one finding for each word that is not carried out as it stands, with its lines.

    A refused one is an error WRD001, those left out for the same reason are one note WRD003.
    """
    refused = [_refused(toolpath, use) for use in toolpath.word_uses if use.refused]
    return (*refused, *_notes(toolpath))


def refusals(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return those that forbid a program, of the kind ``word``."""
    return tuple(
        Finding(Severity.ERROR, RunKind.WORD, item.message, source=item.source, hint=item.hint)
        for item in findings
        if item.is_error
    )


def _lines_text(lines: Sequence[int]) -> str:
    """Return ``line 7``, or ``lines 7, 9 and 3 more`` with at most a dozen numbers."""
    return f"{'line' if len(lines) == 1 else 'lines'} {listed(lines)}"


def _refused(toolpath: ToolPath, use: WordUse) -> Finding:
    others = use.lines[1:]
    also = f" (also in {_lines_text(others)})" if others else ""
    accept = (
        f"if you know it to be harmless: --accept-words {_quoted(use.word)}, "
        f'or [import] accept_words = ["{use.word}"] in the cell'
    )
    return Finding(
        Severity.ERROR,
        "WRD001",
        f"{use.word} ({use.word_class}): {use.reason}{also}",
        source=SourceRef(toolpath.path, use.lines[0]),
        hint=f"{use.hint}; {accept}" if use.hint else accept,
    )


def _notes(toolpath: ToolPath) -> list[Finding]:
    groups: dict[tuple[str, str], list[WordUse]] = {}
    for use in toolpath.word_uses:
        if not use.refused:
            groups.setdefault((use.reason, use.hint), []).append(use)
    return [
        Finding(
            Severity.NOTE,
            "WRD003",
            f"{', '.join(use.word for use in uses)}: {reason}",
            source=SourceRef(toolpath.path, uses[0].lines[0]),
            hint=hint,
        )
        for (reason, hint), uses in groups.items()
    ]


def _quoted(word: str) -> str:
    return f'"{word}"' if not word.replace("/", "").replace("-", "").isalnum() else word
