"""What a plan is asked for: the options of the call, and what those of the cell come to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from typing import TypeVar

from postproc.arrays import FloatArray
from postproc.cell import Cell, Preset, Strategy, require_numbers
from postproc.errors import CellError, SourceRef
from postproc.planning.states.costs import Weights, weights_of
from postproc.planning.states.place import spin_values
from postproc.planning.states.tilt import MOST_COLUMNS, coarsest
from postproc.records import dataclass
from postproc.units import DEG

Word = TypeVar("Word", bound=StrEnum)
_FINER = (2, 4)
"""So many times as fine as the cell's is the finest grid of spins, ..."""
_FINEST = 0.499 * DEG
"""... but its step no smaller [rad], ..."""
_FINEST_COLUMNS = 2 * MOST_COLUMNS
"""... with no more spins times tilts at a tag."""


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Options of one call; None keeps the cell's own choice.

    Args:
        strategy: ``global``, ``smooth`` or ``each``.
        objective: name or table of weights.
        preset: ``stiffest``, ``balanced`` or ``fastest``.
        partial: plan the good stretches although some tags fail.
        name: program name; None: the input's.
    """

    strategy: str | None = None
    objective: str | Mapping[str, float] | None = None
    preset: str | None = None
    partial: bool = False
    name: str | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """What the objective and the range of the spin of a cell come to: weights, spins (s,) [rad]."""

    weights: Weights
    spins: FloatArray

    def fine(self, tilts: int) -> int:
        """Return how many spins of the finest grid there are to one of the cell's.

        The finest one is searched where the other has no way; a rung has to hold it.
        """
        count, most = len(self.spins), _FINEST_COLUMNS // tilts
        if count < 2:
            return 1
        step = float(self.spins[1] - self.spins[0])
        fits = [n for n in _FINER if step >= n * _FINEST and count * n <= most]
        return max(fits, default=1)


def settle(cell: Cell, options: PlanOptions) -> tuple[Cell, Settings]:
    """Return the cell with the call's choices in it, and what its options come to.

    Raises:
        CellError: CEL030 for an arm with unknown limits or speeds, PLN202 for an unknown
            objective, PLN204 for an unknown strategy or preset, PLN207 for more spins times tilts
            than a tag can hold.
    """
    require_numbers(cell)
    wishes = cell.optimize
    if options.strategy is not None:
        wishes = replace(wishes, strategy=_one_of(Strategy, options.strategy, "strategy", cell))
    if options.preset is not None:
        wishes = replace(wishes, preset=_one_of(Preset, options.preset, "preset", cell))
    if options.objective is not None:
        wishes = replace(wishes, objective=options.objective)
    if wishes is not cell.optimize:
        cell = replace(cell, optimize=wishes)
    spins = spin_values(wishes.step, *wishes.range)
    _require_columns(cell, len(spins))
    return cell, Settings(weights_of(cell), spins)


def _one_of(words: type[Word], name: str, key: str, cell: Cell) -> Word:
    if name not in tuple(words):
        text = f"{key} {name!r}: expected one of {', '.join(words)}"
        raise CellError("PLN204", text, SourceRef(cell.path))
    return words(name)


def _require_columns(cell: Cell, spins: int) -> None:
    tilts = coarsest(cell.optimize.tilt)
    if tilts > 1 and spins * tilts > MOST_COLUMNS:
        raise CellError(
            "PLN207",
            f"[optimize] step_deg = {cell.optimize.step / DEG:g} gives {spins} spins times at "
            f"least {tilts} tilts at every milling tag, expected at most {MOST_COLUMNS} in all",
            SourceRef(cell.path),
            hint="raise step_deg: spins between the steps are found by refine",
        )
