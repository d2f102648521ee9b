"""Who notices a mutant: the reader, lint, verify."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from postproc.cell import Cell
from postproc.errors import KrlError, Severity
from postproc.krl import lint, parse_files
from postproc.model import ToolPath
from postproc.process import MACHINING_SPEED
from postproc.verification import verify
from tools.mutants.effect import Effect
from tools.mutants.rules import Mutant, mutants


@dataclass(slots=True)
class Judgement:
    """How many mutants were caught and by what, which do no harm and why, which were missed."""

    caught: Counter[str] = field(default_factory=Counter)
    harmless: Counter[str] = field(default_factory=Counter)
    missed: list[Mutant] = field(default_factory=list)

    @property
    def total(self) -> int:
        """How many there were."""
        return self.caught.total() + self.harmless.total() + len(self.missed)


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
    files: Mapping[str, bytes], cell: Cell, toolpath: ToolPath | None, every: int = 1
) -> Judgement:
    """Judge the mutants of a program.

    Raises:
        ValueError: if the program itself is not good.
    """
    own = noticed(files, cell, toolpath, collisions=True)
    if own:
        raise ValueError(f"the program itself is not good: {sorted(own)}")
    feed = _fastest_cut(toolpath)
    original = Effect(files, cell, feed)
    result = Judgement()
    for mutant in mutants(files, every):
        codes = noticed(mutant.files, cell, toolpath, collisions=False)
        if codes:
            result.caught[min(codes)] += 1
            continue
        effect = Effect(mutant.files, cell, feed)
        if original.is_same(effect):
            result.harmless["the same motions, times and events"] += 1
        elif original.is_slower_in_the_air(effect):
            result.harmless["the same ways, slower through the air"] += 1
        elif codes := noticed(mutant.files, cell, toolpath, collisions=True):
            result.caught[min(codes)] += 1
        elif original.does_the_same_work(effect) and effect.is_free(original):
            result.harmless["the same cuts, another free way through the air"] += 1
        else:
            result.missed.append(mutant)
    return result


def _fastest_cut(toolpath: ToolPath | None) -> float:
    """Return up to which path speed [m/s] motions cut."""
    feeds = np.zeros(0) if toolpath is None else np.asarray(toolpath.feed)
    cycles = [] if toolpath is None else [cycle.feed for cycle in toolpath.cycles]
    known = [feed for feed in (*feeds, *cycles) if np.isfinite(feed)]
    return 1.001 * max(known, default=MACHINING_SPEED)
