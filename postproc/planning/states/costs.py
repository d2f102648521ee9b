"""What a pose of a tag costs: named objectives that users weigh, or add by entry point.

An objective gives one number for each state, lower is better, about 1 for "clearly worse". A
stiffness objective gives its index k [N/m]; its cost is -log(k / k_best of the tag), so that a
cost of 0.01 is a loss of 1 %. The cost of a step is the joint travel: the squared joint
change in units of 10 degrees, times the weight ``travel``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import CellError, SourceRef
from postproc.kinematics import Kinematics
from postproc.registry import Registry
from postproc.units import DEG

TRAVEL = "travel"
TILT = "tilt"
TRAVEL_UNIT = 10.0 * DEG
"""Joint change that costs 1 at weight 1."""
DEFAULT_TRAVEL = 0.1
"""Weight of travel beside a stiffness objective: mean stiffness falls by 0.4 %, the largest joint
step from 181 to 1.3 degrees on a milling line of the paper's kind."""
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
    """Objectives with their weights, and the weight of travel."""

    states: tuple[tuple[str, float, Objective], ...]
    travel: float
    notes: tuple[str, ...] = ()

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

    A name means that objective with weight 1 beside travel with ``DEFAULT_TRAVEL``; a table is
    taken as it is, with the same travel unless it names ``travel``. Where the cell allows a tilt of
    the tool axis, ``tilt`` stands beside them with ``DEFAULT_TILT`` unless it is named. Without
    joint stiffness the stiffness objectives are left out, with a note.

    Raises:
        CellError: PLN202 for an objective that does not exist.
    """
    asked = cell.optimize.objective
    table: Mapping[str, float] = {asked: 1.0} if isinstance(asked, str) else asked
    if cell.optimize.tilt:
        table = {TILT: DEFAULT_TILT, **table}
    states, notes = [], []
    for name, weight in sorted(table.items()):
        if name == TRAVEL:
            continue
        if name not in OBJECTIVES:
            raise CellError("PLN202", OBJECTIVES.unknown(name, TRAVEL), SourceRef(cell.path))
        part = OBJECTIVES.get(name)
        if part.is_stiffness and not cell.has_stiffness:
            notes.append(
                f"no joint stiffness in the cell: {name!r} is left out, joint travel rules"
            )
        elif weight > 0.0:
            states.append((name, float(weight), part))
    travel = float(table.get(TRAVEL, DEFAULT_TRAVEL))
    if travel == 0.0 and all(name == TILT for name, _, _ in states):
        travel = DEFAULT_TRAVEL
    return Weights(tuple(states), travel, tuple(notes))


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
