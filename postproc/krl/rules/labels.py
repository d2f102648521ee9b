"""Row 29: a GOTO has its label, once and in the same routine."""

from __future__ import annotations

from postproc.krl.rules.subject import ERROR, Subject
from postproc.krl.text import Control


def labels(subject: Subject) -> None:
    """Row 29: every GOTO has its label in the routine, and no label stands there twice."""
    for part in subject.parts:
        controls = part.of(Control)
        lines: dict[str, int] = {}
        for label in controls:
            name = label.text.upper()
            if label.word != "LABEL":
                continue
            if name in lines:
                message = f"label {label.text} stands in line {lines[name]} already"
                subject.add(29, ERROR, part.path, label.line, message)
            lines.setdefault(name, label.line)
        for jump in controls:
            if jump.word == "GOTO" and jump.text.upper() not in lines:
                message = f"GOTO {jump.text}: {part.routine.name} has no such label"
                subject.add(29, ERROR, part.path, jump.line, message)
