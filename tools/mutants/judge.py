"""Who notices a mutant: the reader, lint, verify."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from postproc.cell import Cell
from postproc.errors import KrlError, Severity
from postproc.krl import lint, parse_files
from postproc.model import ToolPath
from postproc.verification import verify
from tools.mutants.rules import Mutant, harmless, mutants


@dataclass(slots=True)
class Judgement:
    """How many mutants were caught and by what, which were missed, and which of them do no harm."""

    caught: Counter[str] = field(default_factory=Counter)
    excused: Counter[str] = field(default_factory=Counter)
    missed: list[Mutant] = field(default_factory=list)

    @property
    def total(self) -> int:
        """How many there were."""
        return self.caught.total() + self.excused.total() + len(self.missed)


def noticed(
    files: Mapping[str, bytes], cell: Cell, toolpath: ToolPath | None, *, collisions: bool
) -> set[str]:
    """Return the codes of what stands against a program."""
    try:
        modules = parse_files(files)
        found = {i.code for i in lint(modules) if i.severity is Severity.ERROR}
        report = verify(modules, modules[0].name, cell, toolpath, collisions=collisions)
    except KrlError as error:
        return {error.code}
    return found | {violation.code for violation in report.violations}


def judge(
    files: Mapping[str, bytes],
    cell: Cell,
    toolpath: ToolPath | None,
    every: int = 1,
    *,
    collisions: bool = False,
) -> Judgement:
    """Judge the mutants of a program.

    Raises:
        ValueError: if the program itself is not good.
    """
    own = noticed(files, cell, toolpath, collisions=collisions)
    if own:
        raise ValueError(f"the program itself is not good: {sorted(own)}")
    result = Judgement()
    for mutant in mutants(files, every):
        codes = noticed(mutant.files, cell, toolpath, collisions=collisions)
        if codes:
            result.caught[min(codes)] += 1
        elif reason := harmless(mutant):
            result.excused[f"{mutant.rule}: {reason}"] += 1
        else:
            result.missed.append(mutant)
    return result
