"""A comparison of two programs as Markdown: a pull request's comment, however long the programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from postproc.comparison import DiffReport

_GROUPS, _SINGLE = 20, 25
_WIDTH = 300
"""So many characters of a line are shown."""


def diff_markdown(report: DiffReport) -> bytes:
    """Return what changed in at most 60 lines: the verdict, groups, the first differences."""
    lines = [f"### {_safe(report.old)} against {_safe(report.new)}", "", _safe(report.headline())]
    groups = report.groups()
    if groups:
        lines += ["", "| what | how many | |", "| --- | --- | --- |"]
        lines += [f"| {g.kind} | {g.count} | {_safe(g.text)} |" for g in groups[:_GROUPS]]
        lines += _more(len(groups) - _GROUPS, "kinds of changes")
    if report.differences:
        lines += ["", "<details><summary>single differences</summary>", ""]
        lines += [f"- {_safe(str(item))}" for item in report.differences[:_SINGLE]]
        lines += _more(len(report.differences) - _SINGLE, "differences")
        lines += ["", "</details>"]
    return ("\n".join(lines) + "\n").encode()


def _more(left: int, what: str) -> list[str]:
    return ["", f"and {left} more {what}"] if left > 0 else []


def _safe(text: str) -> str:
    """Return text of a program in one line that means nothing to Markdown."""
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())[:_WIDTH]
    for mark in "\\`*_|<>[]#":
        plain = plain.replace(mark, f"\\{mark}")
    return plain
