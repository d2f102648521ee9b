"""What verify says of real programs, in a cell made of the backup that they are in."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from postproc.cell import Cell, parse_cell
from postproc.errors import Finding, PostprocError
from postproc.jobs.new_cell import OPTIONS, draft_from_backup
from postproc.jobs.verify import verify
from postproc.verification.coverage import NOT_KNOWN, Coverage

_MOVES = re.compile(rb"^\s*S?(PTP|LIN|CIRC)(_REL)?\b|^\s*SPLINE\b", re.IGNORECASE | re.MULTILINE)
_OF_THE_MAKER = {"tp", "system", "steu"}
"""Folders of KUKA's own packages."""
JUDGED, REFUSED, UNKNOWN, UNREAD = "good", "refused", "not known", "not read"


MOTIONS = ("judged", "refused of these", "not known", "never run")


@dataclass(frozen=True, slots=True)
class Answer:
    """What verify says of a program: in a word, why (code and words, the first last), how much."""

    name: str
    reasons: list[tuple[str, str]]
    coverage: Coverage | None = None


@dataclass(slots=True)
class Table:
    """Programs by answer; reasons with the number of programs that they stand in.

    ``motions`` of their texts: judged, refused of these, unknown, never run.
    """

    answers: Counter[str] = field(default_factory=Counter)
    motions: Counter[str] = field(default_factory=Counter)
    programs: list[str] = field(default_factory=list)
    reasons: Counter[tuple[str, str]] = field(default_factory=Counter)
    examples: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, name: str, answer: Answer) -> None:
        """Count a program with its reasons: code and an example in words."""
        self.answers[answer.name] += 1
        found = answer.coverage
        counts = (0, 0, 0, 0)
        if found is not None:
            counts = (found.judged, found.refused, len(found.unknown), found.never_run)
        self.motions.update(dict(zip(MOTIONS, counts, strict=True)))
        first = answer.reasons[-1][1] if answer.reasons else ""
        self.programs.append(
            f"| {name} | {answer.name} | {' | '.join(map(str, counts))} | {first} |"
        )
        for code, example in dict(answer.reasons).items():
            self.reasons[answer.name, code] += 1
            self.examples.setdefault((answer.name, code), example)


def table_of(folders: Iterable[Path]) -> Table:
    """Return what verify says of every program with motions in backups."""
    table = Table()
    for folder in folders:
        try:
            cell = _cell_of(folder)
        except PostprocError as problem:
            print(f"{folder.name}: left out: {problem}")
            continue
        for path in sorted(folder.rglob("*"), key=lambda path: path.as_posix().lower()):
            is_own = not _OF_THE_MAKER.intersection(part.lower() for part in path.parts)
            if is_own and path.suffix.lower() == ".src" and _MOVES.search(path.read_bytes()):
                table.add(f"{folder.name}: {path.name}", answer(path, cell))
    return table


def _cell_of(folder: Path) -> Cell:
    """Return the cell of a backup; which axis of a tool works matters to no program by itself."""
    made = draft_from_backup(folder, {**OPTIONS, "name": folder.name}, Path("cell.toml"))
    cell = parse_cell(made.text.encode("utf-8"), "cell.toml")
    tools = [replace(tool, known_axis=np.array([0.0, 0.0, 1.0])) for tool in cell.tools]
    return replace(cell, tools=tuple(tools))


def answer(path: Path, cell: Cell) -> Answer:
    """Return what verify says of a program, and why."""
    try:
        report = verify(path, cell, collisions=False)
    except PostprocError as problem:
        return Answer(UNREAD, [(problem.code, str(problem))])
    found: tuple[Finding, ...] = report.violations
    unknown = any(item.code in NOT_KNOWN for item in found)
    name = UNKNOWN if unknown else REFUSED if found else JUDGED
    reasons = [(str(item.code), f"{_line(item)}{item.message}") for item in found[::-1]]
    return Answer(name, reasons, report.coverage)


def _line(finding: Finding) -> str:
    file, line = finding.place
    return f"{Path(file).name}:{line}: "


def lines_of(table: Table) -> Iterator[str]:
    """Yield the table as Markdown."""
    total = max(table.answers.total(), 1)
    yield "| answer | programs | share |"
    yield "| --- | --: | --: |"
    for name in (JUDGED, REFUSED, UNKNOWN, UNREAD):
        yield f"| {name} | {table.answers[name]} | {table.answers[name] / total:.0%} |"
    yield ""
    total = max(sum(table.motions[name] for name in MOTIONS if name != MOTIONS[1]), 1)
    yield "| motions of their texts | number | share |"
    yield "| --- | --: | --: |"
    for name in MOTIONS:
        yield f"| {name} | {table.motions[name]} | {table.motions[name] / total:.0%} |"
    yield ""
    yield f"| program | answer | {' | '.join(MOTIONS)} | the first reason |"
    yield "| --- | --- | --: | --: | --: | --: | --- |"
    yield from table.programs
    yield ""
    yield "| answer | reason | programs | for example |"
    yield "| --- | --- | --: | --- |"
    for (name, code), count in sorted(table.reasons.items(), key=lambda item: (-item[1], item[0])):
        yield f"| {name} | `{code}` | {count} | {table.examples[name, code]} |"
