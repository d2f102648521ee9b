"""What controller and joints can take: points per second, memory, torques. Estimates.

Torques, where those of the arm are known, are of rigid links and the tool, the programmed speed
held along every path motion, the force of the process in cuts. What a gear rubs away and a motor
turns itself is not in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import RunKind, Severity
from postproc.kinematics import Kinematics
from postproc.paths import Paths, at_speed, chains, durations, motion_times, torques_of
from postproc.units import MEGABYTE, MM, MM_PER_MIN, MS, PERCENT
from postproc.verification.report import Measure, Remark, Said
from postproc.verification.run import Run

_HELD = 0.98
"""A speed that is held up to this share is held."""


def check_capacity(run: Run) -> Iterator[Said]:
    """Warn where the program asks more of the controller than ``[krl]`` says it can do.

    A block of splines is planned as one motion; single ones and motions that stop count no rate.
    """
    cell = run.cell
    size = sum(
        facts.size
        for module in run.modules
        for facts in (module.src_facts, module.dat_facts)
        if facts is not None
    )
    if size > cell.krl.memory:
        text = (
            f"the files take {size / MEGABYTE:.1f} MB, memory for programs is about "
            f"{cell.krl.memory / MEGABYTE:g} MB"
        )
        yield Remark(RunKind.MEMORY, 0, text, Severity.WARNING)
    trace = run.paths.trace
    rows = np.flatnonzero(trace.is_cp & (trace.block < 0) & (trace.column("advance") > 0))
    if len(rows):
        ahead = int(trace.column("advance")[rows].max())
        chain = chains(run.paths)
        yield from _check_rate(run, rows[_followed(rows, chain, ahead - 1)], ahead)
        yield from _check_look_ahead(run, rows[_followed(rows, chain, ahead + 1)], ahead)


def _followed(rows: AnyIntArray, chain: AnyIntArray, count: int) -> BoolArray:
    """Return which of motions (k,) so many others of them follow without a stop between."""
    result = np.zeros(len(rows), dtype=np.bool_)
    end = len(rows) - count
    if end > 0:
        apart = rows[count:] - rows[:end] == count
        result[:end] = apart & (chain[rows[:end]] == chain[rows[count:]])
    return result


def _check_rate(run: Run, rows: AnyIntArray, ahead: int) -> Iterator[Said]:
    """Warn where as many motions as are planned ahead take less time than planning them does."""
    cell = run.cell
    total = _summed(motion_times(run.paths))
    times = total[rows + ahead] - total[rows]
    fast = np.flatnonzero(times < ahead * cell.krl.block * _HELD)
    if not len(fast):
        return
    worst = int(fast[np.argmin(times[fast])])
    text = (
        f"{ahead / max(times[worst], 1e-9):.0f} points per second, the controller plans about "
        f"{1.0 / cell.krl.block:.0f} ({cell.krl.block / MS:g} ms each), at "
        f"{len(fast)} points"
    )
    yield Remark(RunKind.BLOCK_RATE, int(rows[worst]), text, Severity.WARNING)


def _check_look_ahead(run: Run, rows: AnyIntArray, ahead: int) -> Iterator[Said]:
    """Warn where the motions planned ahead are shorter than the way in which the robot stops."""
    trace, total = run.paths.trace, _summed(run.paths.curves.length)
    planned = total[rows + 1 + ahead] - total[rows + 1]
    speed, push = trace.column("speed")[rows], trace.column("acceleration")[rows]
    most = np.sqrt(2.0 * push * planned)
    short = np.flatnonzero(most < _HELD * speed)
    if not len(short):
        return
    worst = int(short[np.argmin((most / speed)[short])])
    text = (
        f"{ahead} motions planned ahead are {planned[worst] / MM:.2f} mm: {most[worst]:.3f} m/s "
        f"({most[worst] / MM_PER_MIN:.0f} mm/min) can be held, {speed[worst]:g} m/s is programmed, "
        f"at {len(short)} points"
    )
    yield Remark(RunKind.LOOK_AHEAD, int(rows[worst]), text, Severity.WARNING)


def _summed(values: FloatArray) -> FloatArray:
    """Return sums (m + 1,) of the first so many values, unknown ones as 0."""
    return np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])


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
