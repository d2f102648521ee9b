"""The real arm as a model knows it: where its tool is under load, in motion, from each side.

Shared by compensation, which commands against it, and verification, which asks where a program
lands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from postproc.arrays import AT_ONCE, ROUNDING, BoolArray, FloatArray
from postproc.cell import Cell, Tool
from postproc.compensation.along import split
from postproc.compensation.drive import check_size, driven
from postproc.gap import EFFECTS, RobotModel, effect_of, stiffness_of
from postproc.geometry import apply
from postproc.kinematics import Kinematics, build
from postproc.model import ModelFile
from postproc.paths import Displacement, Moments, Paths
from postproc.process import weight_wrench
from postproc.records import dataclass
from postproc.units import MM

LEFT_OF_MOTION = 0.5 * MM
"""More than this of backlash and lag that is left over at a point is a fault of the program."""


def cell_with_model(cell: Cell, file: ModelFile) -> Cell:
    """Return the cell with the joint stiffness that a model knows and where it holds, for planning.

    A joint that the data could not see keeps the cell's stiffness.
    """
    kinematics = build(cell.robot)
    if file.reach is not None:
        cell = replace(cell, model_doubt=file.reach.doubt)

    def locate(q: FloatArray, tool: Tool) -> FloatArray:
        return apply(kinematics.fk(q), tool.T_flange_tcp[:3, 3])

    stiffness = cell.joint_stiffness
    fields = [stiffness_of(file, stiffness, partial(locate, tool=tool)) for tool in cell.tools]
    known = tuple(field.compliance for field in fields if field is not None)
    return replace(cell, joint_compliances=known) if known else cell


def compensation_model(kinematics: Kinematics, cell: Cell, file: ModelFile) -> RobotModel:
    """Return the robot model that compensation uses.

    A joint whose stiffness the data could not see takes the cell's, where the cell gives one.
    """
    known = dict(EFFECTS)
    effects = {
        name: known[name].completed(table, cell.joint_stiffness) if name in known else table
        for name, table in file.effects.items()
    }
    return RobotModel.of(kinematics, cell, replace(file, effects=effects))


def carries_dead_load(file: ModelFile) -> bool:
    """Return whether the tool's weight is to be added as a load.

    Effects that were fitted to the arm with its tool on have the weight already.
    """
    return not file.has_tool_weight and not any(
        effect.has_tool_weight for name, effect in EFFECTS if name in file.effects
    )


def left_out(model: RobotModel) -> dict[str, tuple[str, ...]]:
    """Return the effects that move nothing in a program, with the columns no program knows."""
    missing = {name: effect_of(name).unknown_to_programs for name in model.states}
    return {name: columns for name, columns in missing.items() if columns}


def loads(
    q: FloatArray,
    cell: Cell,
    kinematics: Kinematics,
    working: BoolArray,
    dead: bool = True,
    process: FloatArray | None = None,
) -> FloatArray:
    """Return the wrench (n, 6) ON the tool at the tool point, axes of robroot [N, N*m].

    At joint angles (n, 6) [rad]; the process force acts in rows ``working`` (n,): ``process``
    (n, 6) at and in axes of the TCP, None: the cell's. ``dead``: with the tool's weight, where it
    is known.
    """
    T = kinematics.fk(q)
    R_robroot_tcp = T[:, :3, :3] @ cell.tool.T_flange_tcp[:3, :3]
    own = np.broadcast_to(cell.process.wrench_tcp if process is None else process, (len(q), 6))
    own = own * np.asarray(working, dtype=np.float64)[:, None]
    turned = [np.einsum("nij,nj->ni", R_robroot_tcp, part) for part in (own[:, :3], own[:, 3:])]
    wrench = np.concatenate(turned, axis=1)
    mass = cell.tool.mass
    if dead and np.isfinite(mass) and mass > 0.0:
        p_flange_com = np.zeros(3) if cell.tool.com is None else np.asarray(cell.tool.com)
        lever = T[:, :3, :3] @ (p_flange_com - cell.tool.T_flange_tcp[:3, 3])
        wrench = wrench + weight_wrench(mass, cell.robot.gravity, lever)
    return np.asarray(wrench)


def real_point(
    model: RobotModel,
    q: FloatArray,
    wrench: FloatArray,
    conditions: Mapping[str, Any] | None = None,
) -> FloatArray:
    """Return the real tool point (n, 3) [m], robroot, as it counts for the part.

    An arm that is late is on the same path a moment later. What lateness (``qd`` in the conditions)
    moves along the tool's way is therefore left out; across the way it counts. Outside of what was
    measured the model is believed less and less. CMP001 if the effects ask for more than any arm is
    off by, faded or not.
    """
    point, nominal = _acting(model, q, wrench, conditions), model.nominal(q)
    if model.file is not None:
        alone = {name: replace(model, states={name: state}) for name, state in model.states.items()}
        check_size(
            point - nominal,
            model.file,
            lambda: {n: part.displacement(q, wrench, conditions) for n, part in alone.items()},
        )
    if model.reach is None:
        return point
    return np.asarray(nominal + model.reach.share(q)[:, None] * (point - nominal))


def _acting(
    model: RobotModel, q: FloatArray, wrench: FloatArray, conditions: Mapping[str, Any] | None
) -> FloatArray:
    """Return the point (n, 3) where the model has it, lateness aside."""
    conditions = dict(conditions or {})
    point = model.tool_point(q, wrench, conditions)
    qd = conditions.pop("qd", None)
    late = any("qd" in effect_of(name).needs for name in model.states)
    if qd is None or not bool(np.any(qd)) or not late:
        return point
    in_time = model.tool_point(q, wrench, {**conditions, "qd": np.zeros_like(qd)})
    velocity = np.einsum("nij,nj->ni", model.samples(q).jacobian, qd)
    size = np.linalg.norm(velocity, axis=1, keepdims=True)
    way = np.where(size > ROUNDING, velocity / np.maximum(size, ROUNDING), 0.0)
    behind = point - in_time
    across: FloatArray = behind - way * np.sum(way * behind, axis=1, keepdims=True)
    return in_time + across


@dataclass(frozen=True, slots=True)
class RealArm:
    """The arm of a cell with its model, as a displacement of the tool for verification.

    ``models``: of the arm with each tool of the cell; ``along``: parameters of effects along the
    path by name.
    """

    cell: Cell
    kinematics: Kinematics
    models: tuple[RobotModel, ...]
    dead: bool
    along: Mapping[str, FloatArray]

    @classmethod
    def of(cls, cell: Cell, file: ModelFile) -> RealArm:
        """Return the arm of a cell with a model."""
        kinematics = build(cell.robot)
        file, along = split(file)
        models = tuple(
            compensation_model(kinematics, cell.with_tool(index), file)
            for index in range(len(cell.tools))
        )
        return cls(cell, kinematics, models, carries_dead_load(file), along)

    @property
    def model(self) -> RobotModel:
        """The model with the first tool; which effects it has does not depend on the tool."""
        return self.models[0]

    @property
    def follows_motion(self) -> bool:
        """Whether an effect depends on how the joints move: from which side, how fast."""
        return any(effect_of(name).follows_motion for name in self.model.states)

    @property
    def on_runs(self) -> Displacement:
        """What the model says of programs that are run."""
        states = self.model.states.items()
        ways = [effect_of(name).lost_motion(np.nan_to_num(state.theta)) for name, state in states]
        left = LEFT_OF_MOTION if self.follows_motion or self.along else 0.0
        lost = np.max([np.zeros(6), *ways], axis=0)
        return Displacement(self.displacement, lost, left, self._missed if self.along else None)

    def _missed(self, paths: Paths) -> FloatArray:
        """Return how far the tool passes ends and samples (m + s, 3) of a run."""
        drive = driven(paths, self.cell, self.kinematics, self.along)
        place = np.concatenate([np.arange(1.0, len(paths) + 1.0), paths.row + paths.share])
        order = np.argsort(place, kind="stable")
        found = np.empty((len(place), 3))
        found[order] = drive.missed(place[order])
        return found

    def wrench(self, q: FloatArray, process: FloatArray, tool: int = 0) -> FloatArray:
        """Return the wrench (n, 6) of a tool and process at joint angles (n, 6), robroot."""
        working = np.ones(len(q), dtype=np.bool_)
        cell = self.cell.with_tool(tool)
        return loads(q, cell, self.kinematics, working, self.dead, process)

    def displacement(self, moments: Moments) -> FloatArray:
        """Return real minus nominal tool point (n, 3) [m], robroot."""
        parts = [
            self._part(moments.rows(np.arange(start, min(start + AT_ONCE, len(moments)))))
            for start in range(0, len(moments), AT_ONCE)
        ]
        return np.concatenate(parts) if parts else np.zeros((0, 3))

    def _part(self, moments: Moments) -> FloatArray:
        tool = np.zeros(len(moments), dtype=np.int64) if moments.tool is None else moments.tool
        moved = np.zeros((len(moments), 3))
        for index in np.unique(tool).tolist():
            rows = np.flatnonzero(tool == index)
            own, model = moments.rows(rows), self.models[index]
            wrench = self.wrench(own.q, own.process, index)
            conditions = {"direction": own.direction, "qd": own.qd}
            moved[rows] = real_point(model, own.q, wrench, conditions) - model.nominal(own.q)
        return moved
