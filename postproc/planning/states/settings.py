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
