"""What torques a program asks of the joints, where those of the arm are known: an estimate.

Rigid links and the tool, the programmed speed held along every path motion, the force of the
process in cuts. What a gear rubs away and a motor turns itself is not in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray
from postproc.cell import Cell
from postproc.errors import RunKind, Severity
from postproc.kinematics import Kinematics
from postproc.paths import Paths, at_speed, durations, torques_of
from postproc.units import PERCENT
from postproc.verification.report import Measure, Remark, Said
from postproc.verification.run import Run

_SLACK = 1e-3


def check_torques(run: Run) -> Iterator[Said]:
    """Measure what the joints need, warn of more than they have."""
    paths, robot = run.paths, run.cell.robot
    torques = torques_of(robot, run.cell.tools, paths.station.tool)
    still = np.flatnonzero(np.isfinite(paths.q).all(axis=1))
    if torques is None or not len(still):
        return
    none = np.zeros((len(still), 6))
    parts = (still, paths.q[still], none, none), at_speed(paths)
    row, q, qd, qdd = (np.concatenate(both) for both in zip(*parts, strict=True))
    needed = torques.of(row, q, qd, qdd)
    moving = needed - torques.of(row, q, 0.0 * qd, 0.0 * qdd)
    cuts = np.flatnonzero(run.is_cut[row])
    needed[cuts] -= _of_process(run.cell, run.kinematics, paths.station.tool[row[cuts]], q[cuts])
    share = np.abs(needed) / torques.most
    worst = int(share.max(axis=1).argmax())
    axis = int(share[worst].argmax())
    at, value = int(row[worst]), float(share[worst, axis] / PERCENT)
    yield Measure("torque", value, "%", at, f"A{axis + 1}")
    bad = np.unique(row[share.max(axis=1) > 1.0 + _SLACK])
    if len(bad):
        held = np.abs(needed[worst] - moving[worst]) / torques.most
        speed = float(paths.trace.column("speed")[at])
        why = "to stand still" if held[axis] > 1.0 else f"for {speed:g} m/s"
        detail = f"A{axis + 1} would need {value:.0f} % of its torque {why}, {len(bad)} motions"
        yield Remark(RunKind.TORQUE, at, detail, Severity.WARNING)
    yield from _time(paths, run.cell)


def _of_process(cell: Cell, kinematics: Kinematics, tool: AnyIntArray, q: FloatArray) -> FloatArray:
    """Return the torques (n, 6) by which the force of the process turns the joints."""
    found, T = np.zeros_like(q), kinematics.fk(q)
    for index in np.unique(tool).tolist():
        mine = tool == index
        T_flange_tcp = np.asarray(cell.tools[index].T_flange_tcp)
        R = T[mine, :3, :3] @ T_flange_tcp[:3, :3]
        force = (R @ np.asarray(cell.process.wrench_tcp).reshape(2, 3).T).swapaxes(1, 2)
        J = kinematics.jacobian(q[mine], T_flange_tcp[:3, 3])
        found[mine] = np.einsum("nij,ni->nj", J, force.reshape(-1, 6))
    return found


def _time(paths: Paths, cell: Cell) -> Iterator[Said]:
    """Measure how much longer the program takes because of the torques [s]."""
    free = replace(cell, robot=replace(cell.robot, torque_max=None))
    more = durations(paths, cell) - durations(paths, free)
    motion = int(more.argmax())
    yield Measure("torque_time", float(more.sum()), "s", motion, f"most here: {more[motion]:.3f}")
