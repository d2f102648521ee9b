"""What a bench of executed programs counts, and where: classes of motions, cell and judge."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from postproc.cell import Cell
from postproc.kinematics import build
from tools.bench.outside import Machine, Move
from tools.bench.solids import Judge

RAIL = ", rail"


@dataclass(frozen=True, slots=True)
class Place:
    """A cell, how a program runs in it, and what judges it."""

    cell: Cell
    machine: Machine
    judge: Judge

    @classmethod
    def of(cls, cell: Cell) -> Place:
        """Return the place of a cell."""
        arm = build(cell.robot)
        return cls(cell, Machine(cell, arm), Judge(cell, arm, cell.limits.clearance))


@dataclass(slots=True)
class Score:
    """What came out, over all cells."""

    counts: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    false: list[str] = field(default_factory=list)

    def note(self, what: str, where: str) -> None:
        """Count something that must not be, and remember where it was."""
        self.counts[what] += 1
        self.wrong.append(f"{what}: {where}")


def kind_of(moves: Sequence[Move], number: int) -> str:
    """Return the class of a motion: joint or path, and whether the rail travels with it."""
    kind = "joint motion" if moves[number].word == "PTP" else "path motion"
    way = moves[number].external - moves[max(number - 1, 0)].external
    return f"{kind}{RAIL}" if np.abs(way).max(initial=0.0) > 0.0 else kind


def corner_of(kinds: Sequence[str], number: int) -> str:
    """Return the class of the corner behind a motion."""
    both = "".join(kinds[number : number + 2])
    kind = "joint" if "path" not in both else "path" if "joint" not in both else "mixed"
    return f"{kind} corner{RAIL}" if RAIL in both else f"{kind} corner"


def table(counts: Counter[str]) -> Iterator[str]:
    """Yield the lines of a table by class of motion."""
    columns = ("converted", "hit, let pass", "free", "verify", "planner", "hit", "missed")
    names = (
        "class",
        "converted",
        "of them hit",
        "random, free",
        "`verify` refuses",
        "planner refuses",
    )
    yield f"| {' | '.join(names)} |"
    yield "| --- | --: | --: | --: | --: | --: |"
    kinds = ["joint motion", "path motion", "joint corner", "mixed corner", "path corner"]
    totals: Counter[str] = Counter()
    for kind in [*kinds, *(kind + RAIL for kind in kinds)]:
        own = Counter({column: counts[f"{kind}: {column}"] for column in columns})
        totals += own
        yield _row(kind, own)
    yield _row("all", totals)
    yield ""
    yield (
        f"{counts['cells']} cells with a program. Random motions and corners that are hit: "
        f"{totals['hit']}, of them let pass by `verify` or the planner: {totals['missed']}. "
        f"Programs of `convert` that `verify` refuses: "
        f"{counts['verify refuses what convert wrote'] + counts['convert fails its own check']}."
    )


def _row(name: str, own: Counter[str]) -> str:
    free = max(own["free"], 1)
    false = [f"{own[who]} ({own[who] / free:.1%})" for who in ("verify", "planner")]
    cells = [own["converted"], own["hit, let pass"], own["free"], *false]
    return f"| {name} | " + " | ".join(map(str, cells)) + " |"
