"""Compensation: command other poses, so that the loaded real tool lands on the CAM points.

The whole robot model (load, geometry, every effect of ``model.toml``) is evaluated at the shifted
pose again and again until the real tool point is on the CAM point: a fixed-point iteration on the
full nonlinear model, not one step along its gradient. Orientations stay as planned. Under load the
real arm stands where the plan has proven it free, so collisions need no new check; joint limits do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.errors import DataError, Issue, Severity
from postproc.frames import inverse
from postproc.gap.robot_model import RobotModel
from postproc.kinematics.model import Kinematics, build
from postproc.model.arrays import BoolArray, FloatArray, IntArray
from postproc.model.cell import Cell
from postproc.model.modelfile import ModelFile, entry, load_model
from postproc.model.plan import MoveKind, MoveRole, Plan
from postproc.stiffness.cartesian import moved_wrench
from postproc.units import MM, STANDARD_GRAVITY

WORKING = (MoveRole.CUT, MoveRole.PLUNGE)
"""Moves in which the process force acts; in all others only the dead load does."""
ACCURACY = 1e-7
"""The iteration ends when every real tool point is this close [m] to its target."""
LARGEST = 0.05
"""A shift beyond this [m] is no compensation but a wrong model."""
_STEPS = 30
_STIFFNESS = "stiffness_Nmm_per_rad"


@dataclass(frozen=True, slots=True)
class Compensated:
    """Joint angles whose loaded tool point is the target.

    q (n, 6) [rad]; shift (n, 3) [m] of the commanded tool point, robroot; left (n,) [m] distance
    that remains; reached (n,): the shifted pose exists on the same branch.
    """

    q: FloatArray
    shift: FloatArray
    left: FloatArray
    reached: BoolArray


def compensate(plan: Plan, cell: Cell, model_path: str) -> Plan:
    """Return the plan with shifted commands.

    Args:
        plan: a plan without errors.
        cell: with tool mass and process force.
        model_path: ``model.toml``.

    Returns:
        The plan with new q and T_base_tcp, ``compensation`` (m, 3) in the workpiece frame and
        ``compensation_note``; findings PLN102 where a shifted pose leaves the joint limits.

    Raises:
        DataError: from the model file, or CMP001 if it asks for shifts beyond all reason.
    """
    kinematics = build(cell.robot)
    file = load_model(model_path)
    model = compensation_model(kinematics, cell, file)
    rows = _rows(plan, cell, kinematics)
    wrench = loads(rows.q, cell, kinematics, rows.working, carries_dead_load(file), rows.process)
    solved = solve(model, kinematics, cell.tool.T_flange_tcp, rows.q, wrench, rows.conditions)
    largest = float(np.linalg.norm(solved.shift, axis=1).max(initial=0.0))
    if largest > LARGEST:
        raise DataError(
            "CMP001",
            f"the model asks for shifts of up to {largest / MM:.1f} mm, which no real arm needs",
            file.source(next(iter(file.effects), "")),
        )
    return _shifted(plan, cell, kinematics, rows, solved, _note(plan, cell, file, solved, rows))


def compensation_model(kinematics: Kinematics, cell: Cell, file: ModelFile) -> RobotModel:
    """Return the robot model that compensation uses.

    A joint whose stiffness the data could not see takes the cell's, where the cell gives one: the
    process may load it although the measurement did not, and rigid would be worse.
    """
    effects: dict[str, Mapping[str, Any]] = dict(file.effects)
    table = effects.get("joint_compliance")
    known = cell.joint_stiffness
    if table is not None and known is not None and _STIFFNESS in table:
        k = np.asarray(table[_STIFFNESS], dtype=np.float64)
        if k.shape == (6,) and bool(np.any(np.isnan(k))):
            filled = np.where(np.isnan(k), entry(_STIFFNESS, known), k)
            effects["joint_compliance"] = {**table, _STIFFNESS: filled.tolist()}
    return RobotModel.of(kinematics, cell, replace(file, effects=effects))


def carries_dead_load(file: ModelFile) -> bool:
    """Return whether the tool's weight is to be added as a load.

    A sag or payload effect was fitted to the arm with its tool on, so it has the weight already.
    """
    return not any(name in file.effects for name in ("gravity_sag", "payload_error"))


def loads(
    q: FloatArray,
    cell: Cell,
    kinematics: Kinematics,
    working: BoolArray,
    dead: bool = True,
    process: FloatArray | None = None,
) -> FloatArray:
    """Return the wrench (n, 6) ON the tool at the tool point, axes of robroot [N, N*m].

    Args:
        q: (n, 6) joint angles [rad].
        cell: with tool and process.
        kinematics: of the robot.
        working: (n,) rows in which the process force acts.
        dead: add the tool's weight, where the cell gives mass and centre of gravity.
        process: (n, 6) process wrench at and in axes of the TCP; None: the cell's for all.
    """
    T = kinematics.fk(q)
    R_robroot_tcp = T[:, :3, :3] @ cell.tool.T_flange_tcp[:3, :3]
    process = np.asarray(cell.process.wrench_tcp)
    wrench = (
        np.concatenate([R_robroot_tcp @ process[:3], R_robroot_tcp @ process[3:]], axis=-1)
        * np.asarray(working, dtype=np.float64)[:, None]
    )
    mass = cell.tool.mass
    if dead and np.isfinite(mass) and mass > 0.0:
        down = cell.robot.T_world_robroot[:3, :3].T @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
        weight = np.tile(np.concatenate([mass * down, np.zeros(3)]), (len(q), 1))
        p_flange_com = np.zeros(3) if cell.tool.com is None else np.asarray(cell.tool.com)
        lever = T[:, :3, :3] @ (p_flange_com - cell.tool.T_flange_tcp[:3, 3])
        wrench = wrench + moved_wrench(weight, lever)
    return np.asarray(wrench)


def solve(
    model: RobotModel,
    kinematics: Kinematics,
    T_flange_tcp: FloatArray,
    q: FloatArray,
    wrench: FloatArray,
    conditions: Mapping[str, Any] | None = None,
) -> Compensated:
    """Find commands whose loaded real tool point is the nominal tool point of ``q``.

    Args:
        model: forward model of the real arm.
        kinematics: nominal arm, which the controller computes with.
        T_flange_tcp: (4, 4) tool.
        q: (n, 6) planned joint angles [rad].
        wrench: (n, 6) load on the tool at each pose, robroot.
        conditions: further columns of the model (direction of approach).
    """
    T_tcp_flange = inverse(T_flange_tcp)
    T_target = kinematics.fk(q) @ T_flange_tcp
    slot = kinematics.slot(q)
    rows = np.arange(len(q))
    shift = np.zeros((len(q), 3))
    command = np.array(q, dtype=np.float64)
    reached = np.ones(len(q), dtype=bool)
    left = np.zeros((len(q), 3))
    for _ in range(_STEPS):
        left = model.tool_point(command, wrench, conditions) - T_target[:, :3, 3]
        if float(np.max(np.linalg.norm(left, axis=1), initial=0.0)) < ACCURACY:
            break
        shift = shift - np.where(reached[:, None], left, 0.0)
        if float(np.max(np.abs(shift), initial=0.0)) > LARGEST:
            break
        T = T_target.copy()
        T[:, :3, 3] += shift
        branches, valid = kinematics.ik(T @ T_tcp_flange)
        reached = valid[rows, slot]
        found = kinematics.split_wrist(kinematics.nearest(branches[rows, slot], q), q)
        command = np.where(reached[:, None], found, command)
    return Compensated(command, shift, np.linalg.norm(left, axis=1), reached)


@dataclass(frozen=True, slots=True)
class _Rows:
    """Moves of a plan, then the points on the way of its arcs.

    q (r, 6); working (r,); process (r, 6) wrench in TCP axes; arc: indices of the moves whose
    way point is row m + k.
    """

    q: FloatArray
    working: BoolArray
    process: FloatArray
    arc: IntArray
    conditions: Mapping[str, Any]


def _rows(plan: Plan, cell: Cell, kinematics: Kinematics) -> _Rows:
    q = np.asarray(plan.q)
    working = np.isin(plan.role, WORKING)
    arc = np.flatnonzero(np.asarray(plan.kind) == MoveKind.CIRC).astype(np.int32)
    T_robroot_base = _T_robroot_base(plan, cell, kinematics)[arc]
    T_base_aux = np.array(plan.T_base_tcp[arc])
    T_base_aux[:, :3, 3] = plan.aux[arc]
    branches, valid = kinematics.ik(T_robroot_base @ T_base_aux @ inverse(cell.tool.T_flange_tcp))
    at = np.arange(len(arc))
    slot = kinematics.slot(q[arc])
    # the way point's own orientation lies between those of the ends; the difference to the end's
    # changes its load response far less than the response itself
    q_aux = np.where(
        valid[at, slot][:, None], kinematics.nearest(branches[at, slot], q[arc]), q[arc]
    )
    direction = _directions(q)
    process = process_of(plan, cell)
    return _Rows(
        np.concatenate([q, q_aux]),
        np.concatenate([working, working[arc]]),
        np.concatenate([process, process[arc]]),
        arc,
        {"direction": np.concatenate([direction, direction[arc]])},
    )


def process_of(plan: Plan, cell: Cell) -> FloatArray:
    """Return the process wrench (m, 6) of each move's operation, at and in axes of the TCP."""
    path = plan.toolpath
    names = [operation.name for operation in path.operations]
    table = [cell.process.wrench_of(name) for name in names]
    table.append(np.asarray(cell.process.wrench_tcp))
    operation = np.asarray(path.operation)[np.clip(plan.tag, 0, len(path) - 1)]
    known = (plan.tag >= 0) & (operation >= 0) & (operation < len(names))
    return np.array(table)[np.where(known, operation, len(names))]


def _directions(q: FloatArray) -> FloatArray:
    """Return the sign of each joint's last motion (m, 6); one that stood keeps the sign before."""
    step = np.diff(q, axis=0, prepend=q[:1])
    sign = np.where(np.abs(step) > 1e-7, np.sign(step), 0.0)
    for i in range(1, len(sign)):
        sign[i] = np.where(sign[i] == 0.0, sign[i - 1], sign[i])
    return sign


def _T_robroot_base(plan: Plan, cell: Cell, kinematics: Kinematics) -> FloatArray:
    """Return the workpiece frame (m, 4, 4) at each move; external axes move it."""
    T_robroot_tcp = kinematics.fk(plan.q) @ cell.tool.T_flange_tcp
    T: FloatArray = T_robroot_tcp @ inverse(plan.T_base_tcp)
    return T


def _shifted(
    plan: Plan,
    cell: Cell,
    kinematics: Kinematics,
    rows: _Rows,
    solved: Compensated,
    note: str,
) -> Plan:
    m = len(plan)
    R_base_robroot = np.swapaxes(_T_robroot_base(plan, cell, kinematics)[:, :3, :3], 1, 2)
    shift = np.einsum("nij,nj->ni", R_base_robroot, solved.shift[:m])
    T_base_tcp = np.array(plan.T_base_tcp)
    T_base_tcp[:, :3, 3] += shift
    aux = np.array(plan.aux)
    aux[rows.arc] += np.einsum("nij,nj->ni", R_base_robroot[rows.arc], solved.shift[m:])
    return replace(
        plan,
        q=solved.q[:m],
        T_base_tcp=T_base_tcp,
        aux=aux,
        compensation=shift,
        compensation_note=note,
        issues=(*plan.issues, *_findings(plan, kinematics, cell, solved, m)),
    )


def _findings(
    plan: Plan, kinematics: Kinematics, cell: Cell, solved: Compensated, m: int
) -> list[Issue]:
    inside = kinematics.within_limits(solved.q[:m])
    good = solved.reached[:m] & inside & (solved.left[:m] < 100.0 * ACCURACY)
    findings = []
    for move in np.flatnonzero(~good):
        tag = int(plan.tag[move])
        reason = "leaves the joint limits" if solved.reached[move] else "is out of reach"
        source = plan.toolpath.source(tag) if 0 <= tag < len(plan.toolpath) else None
        findings.append(
            Issue(
                Severity.ERROR,
                "PLN102" if solved.reached[move] else "PLN101",
                f"the compensated pose {reason}",
                tag,
                source,
                hint="move the workpiece, or convert without --model",
            )
        )
    return findings


def _note(plan: Plan, cell: Cell, file: ModelFile, solved: Compensated, rows: _Rows) -> str:
    """Return one short line for the program: model, loads, largest shift. No path, no date."""
    size = np.linalg.norm(solved.shift[: len(plan)], axis=1) / MM
    mass = cell.tool.mass
    parts = []
    if carries_dead_load(file) and np.isfinite(mass) and mass > 0.0:
        parts.append(f"tool {mass:g} kg")
    acting = np.unique(rows.process[rows.working], axis=0)
    if len(acting) == 1:
        force, moment = np.split(acting[0], 2)
        parts += [f"force {_triple(force)} N"] if bool(np.any(force)) else []
        parts += [f"moment {_triple(moment)} Nm"] if bool(np.any(moment)) else []
    elif len(acting) > 1:
        parts.append(f"process loads of {len(acting)} kinds")
    parts.append(f"shift <= {size.max(initial=0.0):.3f} mm")
    return f"compensated ({Path(file.path).name}): {', '.join(parts)}"


def _triple(values: FloatArray) -> str:
    return " ".join(f"{value:g}" for value in values)


def expected_points(
    q: FloatArray,
    cell: Cell,
    file: ModelFile,
    working: BoolArray,
    process: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return nominal and expected real tool points (n, 3) [m] of commanded angles, robroot.

    Args:
        q: (n, 6) commanded joint angles [rad].
        cell: the cell.
        file: model of the real arm.
        working: (n,) rows in which the process force acts.
        process: (n, 6) process wrench in TCP axes; None: the cell's for all.
    """
    kinematics = build(cell.robot)
    model = compensation_model(kinematics, cell, file)
    wrench = loads(q, cell, kinematics, working, carries_dead_load(file), process)
    conditions = {"direction": _directions(np.asarray(q, dtype=np.float64))}
    return model.nominal(q), model.tool_point(q, wrench, conditions)
