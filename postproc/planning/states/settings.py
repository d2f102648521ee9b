"""What a plan is asked for: the options of the call, and what those of the cell come to."""

from __future__ import annotations

from postproc.arrays import FloatArray
from postproc.cell import Cell, require_numbers
from postproc.errors import CellError, SourceRef
from postproc.planning.states.costs import Weights, weights_of
from postproc.planning.states.place import spin_values
from postproc.planning.states.tilt import MOST_COLUMNS, coarsest
from postproc.records import dataclass
from postproc.units import DEG

_FINER = (2, 4)
"""So many times as fine as the cell's is the finest grid of spins, ..."""
_FINEST = 0.499 * DEG
"""... but its step no smaller [rad], ..."""
_FINEST_COLUMNS = 2 * MOST_COLUMNS
"""... with no more spins times tilts at a tag."""


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """What a call asks for beside the keys of its cell.

    Args:
        partial: plan the good stretches although some tags fail.
        name: program name; None: the input's.
    """

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


def settle(cell: Cell) -> tuple[Cell, Settings]:
    """Return the cell, and what its options come to.

    Raises:
        CellError: CEL030 for an arm with unknown limits or speeds, PLN202 for an unknown
            objective, PLN207 for more spins times tilts than a tag can hold.
    """
    require_numbers(cell)
    spins = spin_values(cell.optimize.step, *cell.optimize.range)
    _require_columns(cell, len(spins))
    return cell, Settings(weights_of(cell), spins)


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
