"""What a bench of executed programs counts, and where: classes of motions, cell and judge."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from postproc.cell import Cell
from postproc.kinematics import build
from tools.bench.outside import Judge, Machine, Move


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
    kind = "joint" if moves[number].word == "PTP" else "path"
    way = moves[number].external - moves[max(number - 1, 0)].external
    return f"{kind} with rail" if np.abs(way).max(initial=0.0) > 0.0 else kind


def corner_of(kinds: Sequence[str], number: int) -> str:
    """Return the class of the corner behind a motion."""
    both = "".join(kinds[number : number + 2])
    kind = "joint" if "path" not in both else "path" if "joint" not in both else "mixed"
    return f"{kind} corner with rail" if "rail" in both else f"{kind} corner"
