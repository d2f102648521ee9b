"""Who notices a mutant: the reader, lint, verify."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import islice

import numpy as np

from postproc.errors import KrlError, Severity
from postproc.krl import lint, parse_files
from postproc.model import ToolPath
from postproc.process import MACHINING_SPEED
from postproc.verification import verify
from tools.mutants.cases import Case
from tools.mutants.effect import SPARE, Effect
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

    def add(self, other: Judgement) -> None:
        """Add what came out for another program."""
        self.caught.update(other.caught)
        self.harmless.update(other.harmless)
        self.missed += other.missed


def noticed(case: Case, files: Mapping[str, bytes], *, collisions: bool) -> set[str]:
    """Return the codes of what stands against a text in the place of the program of a case."""
    try:
        modules = parse_files(files)
        found = {i.code for i in lint(modules) if i.severity is Severity.ERROR}
        report = verify(
            modules,
            modules[0].name,
            case.cell,
            case.toolpath,
            collisions=collisions,
            displacement=case.displacement,
        )
    except KrlError as error:
        return {error.code}
    return found | {violation.code for violation in report.violations}


def judge(
    case: Case, each: int | None = None, seed: int = 0, part: tuple[int, int] = (0, 1)
) -> Judgement:
    """Judge the mutants of a program: at most so many of each rule in a file, or all.

    ``part``: of those only each so many-th, from which one on.

    Raises:
        ValueError: if the program itself is not good.
    """
    own = noticed(case, case.files, collisions=True)
    if own:
        raise ValueError(f"the program itself is not good: {sorted(own)}")
    cell, feed = case.cell, _fastest_cut(case.toolpath)
    original = Effect(case.files, cell, feed)
    result = Judgement()
    for mutant in islice(mutants(case.files, each, seed), part[0], None, part[1]):
        codes = noticed(case, mutant.files, collisions=False)
        if codes:
            result.caught[min(codes)] += 1
            continue
        effect = Effect(mutant.files, cell, feed)
        is_free = partial(effect.is_free, original)
        if original.is_same(effect):
            result.harmless["the same motions, times and events"] += 1
        elif case.toolpath is None and original.moves_as(effect):
            result.harmless["the same motions; without a CAM file nothing asks for calls"] += 1
        elif original.is_slower_in_the_air(effect):
            result.harmless["the same ways, slower through the air"] += 1
        elif codes := noticed(case, mutant.files, collisions=True):
            result.caught[min(codes)] += 1
        elif original.does_the_same_work(effect) and is_free():
            result.harmless["the same cuts, another free way through the air"] += 1
        elif original.does_the_same_work(effect, SPARE + cell.motion.chord) and is_free():
            result.harmless["the same cuts, as near to the path as the cell asks"] += 1
        else:
            result.missed.append(mutant)
    return result


def _fastest_cut(toolpath: ToolPath | None) -> float:
    """Return up to which path speed [m/s] motions cut."""
    feeds = np.zeros(0) if toolpath is None else np.asarray(toolpath.feed)
    cycles = [] if toolpath is None else [cycle.feed for cycle in toolpath.cycles]
    known = [feed for feed in (*feeds, *cycles) if np.isfinite(feed)]
    return 1.001 * max(known, default=MACHINING_SPEED)
