"""What a plan is asked for: the options of the call and of the cell, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import CellError, SourceRef
from postproc.planning.states.costs import Weights, weights_of
from postproc.planning.states.place import spin_values
from postproc.planning.states.tilt import MOST_COLUMNS, coarsest
from postproc.process import TiltRange
from postproc.units import DEG, MM, PERCENT

STRATEGIES = ("global", "smooth", "each")


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Options of one call; None keeps the cell's own choice.

    Args:
        strategy: ``global``, ``smooth`` or ``each``.
        objective: name or table of weights.
        partial: plan the good stretches although some tags fail.
        clearance: measure the smallest distance at every tag (slow).
        name: program name; None: the input's.
    """

    strategy: str | None = None
    objective: str | Mapping[str, float] | None = None
    partial: bool = False
    clearance: bool = False
    name: str | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """All options of a plan, resolved. Lengths [m], angles [rad], speeds [m/s]."""

    strategy: str
    weights: Weights
    spins: FloatArray
    step: float
    tilt: TiltRange
    refine: bool
    turns: bool
    key_every: float
    key_corner: float
    key_tags: tuple[str, ...]
    loss_bound: float
    free_order: bool
    approach: float
    chord: float
    arcs: str
    rapid_speed: float
    rapid_share: float
    blend: float
    pins: Mapping[str, float] = field(default_factory=dict)


def settle(cell: Cell, options: PlanOptions) -> tuple[Cell, Settings]:
    """Return the cell with the call's choices in it, and all settings.

    Raises:
        CellError: PLN202 for an unknown objective, PLN204 for an unknown strategy, PLN207 for more
            turns times tilts than a tag can hold.
    """
    changes = {
        key: value
        for key, value in (("strategy", options.strategy), ("objective", options.objective))
        if value is not None
    }
    if changes:
        cell = replace(cell, optimize=replace(cell.optimize, **changes))  # type: ignore[arg-type]
    chosen = cell.optimize
    if chosen.strategy not in STRATEGIES:
        raise CellError(
            "PLN204",
            f"strategy {chosen.strategy!r}: expected one of {', '.join(STRATEGIES)}",
            SourceRef(cell.path),
        )
    extra, motion = _Extra(chosen.options), _Extra(cell.motion.options)
    spins, tilt = spin_values(chosen.step, *chosen.range), TiltRange.of(cell)
    _require_room(cell, len(spins), tilt)
    return cell, Settings(
        strategy=chosen.strategy,
        weights=weights_of(cell),
        spins=spins,
        step=chosen.step,
        tilt=tilt,
        refine=extra.flag("refine", default=True),
        turns=extra.flag("turns", default=True),
        key_every=extra.number("key_every_mm", 100.0) * MM,
        key_corner=extra.number("key_corner_deg", 20.0) * DEG,
        key_tags=extra.words("key_tags"),
        loss_bound=extra.number("loss_bound_percent", 5.0) * PERCENT,
        free_order=extra.flag("free_order", default=False),
        approach=motion.number("approach_mm", 50.0) * MM,
        chord=motion.number("chord_mm", 0.01) * MM,
        arcs=str(motion.table.get("arcs", "circ")),
        rapid_speed=motion.number("rapid_speed_m_s", 2.0) * cell.motion.rapid,
        rapid_share=cell.motion.rapid,
        blend=cell.motion.approximation,
        pins=extra.pins(),
    )


def _require_room(cell: Cell, spins: int, tilt: TiltRange) -> None:
    tilts = coarsest(tilt)
    if tilts > 1 and spins * tilts > MOST_COLUMNS:
        raise CellError(
            "PLN207",
            f"[optimize] step_deg = {cell.optimize.step / DEG:g} gives {spins} turns times at "
            f"least {tilts} tilts at every milling tag, expected at most {MOST_COLUMNS} in all",
            SourceRef(cell.path),
            hint="raise step_deg: turns between the steps are found by refine",
        )


@dataclass(frozen=True, slots=True)
class _Extra:
    """Keys of a table of the cell file, in file units, with their defaults."""

    table: Mapping[str, object]

    def number(self, key: str, default: float) -> float:
        value = self.table.get(key, default)
        return float(value) if isinstance(value, int | float) else default

    def flag(self, key: str, *, default: bool) -> bool:
        return bool(self.table.get(key, default))

    def words(self, key: str) -> tuple[str, ...]:
        value = self.table.get(key, ())
        return tuple(str(v) for v in value) if isinstance(value, list | tuple) else ()

    def pins(self) -> dict[str, float]:
        value = self.table.get("pins", {})
        if not isinstance(value, Mapping):
            return {}
        return {str(tag): float(np.asarray(spin)) * DEG for tag, spin in value.items()}
