"""What a pose of a tag costs: named objectives that users weigh, or add by entry point.

An objective gives one number for each state, lower is better, about 1 for "clearly worse". A
stiffness objective gives its index k [N/m]; its cost is -log(k / k_best of the tag), so that a
cost of 0.01 is a loss of 1 %. The cost of a step is the joint travel: the squared joint
change in units of 10 degrees, times the weight ``travel``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell, Preset, Strategy
from postproc.errors import CellError, SourceRef
from postproc.kinematics import Kinematics
from postproc.records import dataclass
from postproc.registry import Registry
from postproc.units import DEG

TRAVEL = "travel"
TILT = "tilt"
MEASURED, DEFAULT_MEASURED = "measured", 100.0
"""Weight of what a model of the arm leaves: whoever compensates asks for small errors first. One
that is 1 % larger costs more than half of the stiffness, no compensation at all more than a way
round the wrist."""
TRAVEL_UNIT = 10.0 * DEG
"""Joint change that costs 1 at weight 1."""
TRAVEL_OF = {Preset.STIFFEST: 0.01, Preset.BALANCED: 0.1, Preset.FASTEST: 1.0}
"""Weight of travel beside a stiffness objective, by preset. With that of ``balanced`` on a milling
line of the paper's kind mean stiffness falls by 0.4 %, the largest joint step from 181 to 1.3
degrees."""
WRIST, DEFAULT_WRIST = "wrist", 0.02
"""Weight of A4 and A6 off their unwound middle: half a turn of one must gain 2 % of stiffness."""
MARGIN = "margin"
MARGIN_OF = {Preset.STIFFEST: 0.1, Preset.BALANCED: 4.0, Preset.FASTEST: 4.0}
"""Weight of nearness to limits and to the straight wrist, by preset: 10 % of stiffness for standing
there, or more than the price of what most tags could gain, so that they keep 5 degrees."""
PRICE_OF = {Preset.STIFFEST: (0.02, 30.0), Preset.BALANCED: (0.05, 10.0)}
"""Loss of stiffness at a tag, and what each further 1 (100 %) of it costs, by preset: with
``balanced`` 10 % beyond 5 % must save as much as a way of 30 degrees of a joint costs."""
BOUND_PRICE = 1e6
"""The same beyond a bound that the cell sets."""
DEFAULT_TILT = 0.1
"""Weight of tilt, where the cell allows any: 5 degrees must gain 2.5 % of stiffness, 10 degrees
10 %, 15 degrees 22 %, or be the only way."""


@dataclass(slots=True)
class StateContext:
    """States of tags as columns of length N; what every objective may look at.

    Args:
        kinematics: of the robot; cell: the cell.
        q: (N, 6) [rad]; tag: (N,) index; spin: (N,) [rad].
        R_robroot_tcp: (N, 3, 3).
        normal: (N, 3) unit, robroot: across tool axis and path.
        c_joint: (6,) or (N, 6) [rad/(N*m)], None without stiffness.
        tilt: (N,) angle of the tool axis to that of the CAM data [rad], None where all is upright.
    """

    kinematics: Kinematics
    cell: Cell
    q: FloatArray
    tag: IndexArray
    spin: FloatArray
    R_robroot_tcp: FloatArray
    normal: FloatArray
    c_joint: FloatArray | None
    tilt: FloatArray | None = None
    _jacobian: FloatArray | None = field(default=None, init=False)

    @property
    def jacobian(self) -> FloatArray:
        """(N, 6, 6) at the TCP, rows linear then angular, axes of robroot."""
        if self._jacobian is None:
            p_flange_tcp = np.asarray(self.cell.tool.T_flange_tcp)[:3, 3]
            self._jacobian = self.kinematics.jacobian(self.q, p_flange_tcp)
        return self._jacobian

    def rates(self, direction: FloatArray) -> FloatArray:
        """Return how fast (N, 6) [m/rad] joints move the TCP along directions (N, 3), robroot."""
        p_flange_tcp = np.asarray(self.cell.tool.T_flange_tcp)[:3, 3]
        return self.kinematics.rates(self.q, p_flange_tcp, direction)

    @property
    def tool_axis(self) -> FloatArray:
        """(N, 3) unit, robroot, out of the tool into the part."""
        axis: FloatArray = self.R_robroot_tcp @ np.asarray(self.cell.tool.axis)
        return axis

    @property
    def compliance(self) -> FloatArray:
        """Joint compliance; only for objectives that say ``is_stiffness``."""
        if self.c_joint is None:
            raise ValueError("the cell has no joint stiffness")
        return self.c_joint


Function = Callable[[StateContext], FloatArray]


@dataclass(frozen=True, slots=True)
class Objective:
    """One named wish: a function of states (N,) and how to read its values.

    ``is_stiffness``: the value is an index k [N/m], larger is better, and joint stiffness is
    needed; otherwise the value is a cost, lower is better. ``is_of_pose``: a cost that is the same
    for all turns of the joints that give a pose.
    """

    function: Function
    is_stiffness: bool = False
    is_of_pose: bool = False

    def __call__(self, context: StateContext) -> FloatArray:
        """Return (N,) values."""
        return self.function(context)


OBJECTIVES: Registry[Objective] = Registry(
    "objectives", "postproc.planning.states.objectives", Objective
)


def objective(
    name: str, *, is_stiffness: bool = False, is_of_pose: bool = False
) -> Callable[[Function], Function]:
    """Return a decorator that registers a function as a built-in objective."""

    def add(function: Function) -> Function:
        OBJECTIVES.register(name)(Objective(function, is_stiffness, is_of_pose))
        return function

    return add


@dataclass(frozen=True, slots=True)
class Weights:
    """Objectives with their weights, the weight of travel, and prices of losses.

    ``prices``: from which loss of stiffness on, and what each further 1 (100 %) of it costs.
    """

    states: tuple[tuple[str, float, Objective], ...]
    travel: float
    notes: tuple[str, ...] = ()
    prices: tuple[tuple[float, float], ...] = ()

    def split(self) -> tuple[Weights, Weights]:
        """Return the objectives that all turns of a pose share, and the others."""
        parts: tuple[list[tuple[str, float, Objective]], ...] = ([], [])
        for entry in self.states:
            parts[not (entry[2].is_stiffness or entry[2].is_of_pose)].append(entry)
        return replace(self, states=tuple(parts[0])), replace(self, states=tuple(parts[1]))

    def price(self, loss: FloatArray) -> FloatArray:
        """Return what losses (n,) of stiffness against the best of a tag cost beyond their log."""
        total = np.zeros(len(loss))
        for bound, slope in self.prices:
            total += slope * np.nan_to_num(np.maximum(loss - bound, 0.0))
        return total

    @property
    def main(self) -> tuple[str, Objective] | None:
        """The stiffness objective of largest weight, None without one."""
        found = [(weight, name, part) for name, weight, part in self.states if part.is_stiffness]
        if not found:
            return None
        _, name, part = max(found, key=lambda item: item[0])
        return name, part


def weights_of(cell: Cell) -> Weights:
    """Return what ``[optimize] objective`` asks for.

    A table with the same travel as for a name unless it names ``travel``. Without joint stiffness
    the stiffness objectives are left out, with a note.

    Raises:
        CellError: PLN202 for an objective that does not exist.
    """
    wishes, asked, table = cell.optimize, cell.optimize.objective, _wanted(cell)
    states, notes = [], []
    for name, weight in sorted(table.items()):
        if name == TRAVEL:
            continue
        if name not in OBJECTIVES:
            raise CellError("PLN202", OBJECTIVES.unknown(name, TRAVEL), SourceRef(cell.path))
        part = OBJECTIVES.get(name)
        if part.is_stiffness and not cell.has_stiffness:
            notes.append(
                f"no joint stiffness in the cell: {name!r} is left out, joint travel decides"
            )
        elif weight > 0.0:
            states.append((name, float(weight), part))
    usual = TRAVEL_OF[wishes.preset]
    travel = float(table.get(TRAVEL, usual))
    if travel == 0.0 and all(name in (TILT, WRIST, MARGIN, MEASURED) for name, _, _ in states):
        travel = usual
    prices = (
        [PRICE_OF[wishes.preset]] if isinstance(asked, str) and wishes.preset in PRICE_OF else []
    )
    if wishes.strategy is not Strategy.SMOOTH and wishes.loss_bound is not None:
        prices.append((wishes.loss_bound, BOUND_PRICE))
    return Weights(tuple(states), travel, tuple(notes), tuple(prices))


def _wanted(cell: Cell) -> dict[str, float]:
    """Return the objectives that a cell asks for by name, each with its weight.

    A name means that objective with weight 1 and a little of wrist and margin. Beside what is named
    stand ``tilt`` where the cell allows any, and ``measured`` where a model says where it holds.
    """
    wishes, asked = cell.optimize, cell.optimize.objective
    beside = {TILT: DEFAULT_TILT} if wishes.tilt else {}
    beside |= {} if cell.model_doubt is None else {MEASURED: DEFAULT_MEASURED}
    if isinstance(asked, str):
        return {**beside, WRIST: DEFAULT_WRIST, MARGIN: MARGIN_OF[wishes.preset], asked: 1.0}
    return {**beside, **asked}


def state_costs(weights: Weights, context: StateContext) -> tuple[FloatArray, FloatArray]:
    """Return the cost (N,) of states and the index of the main stiffness objective (N,) [N/m].

    Costs of stiffness objectives are -log k here; the best of each tag is subtracted by the
    caller, who knows all states of a tag.
    """
    cost = np.zeros(len(context.q))
    index = np.full(len(context.q), np.nan)
    main = weights.main
    for name, weight, part in weights.states:
        value = part(context)
        if part.is_stiffness:
            if main is not None and name == main[0]:
                index = value
            value = -np.log(np.clip(value, 1e-30, 1e30))
        cost += weight * value
    return cost, index
