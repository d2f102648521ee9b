"""Where cuts start, and the point more that takes gears to the sides of the cut there.

What moved the tool to the start of a cut left each gear on some side, and the cut moves joints the
other way. The point before is compensated for the side that the joints come from, the next one, at
the same place, for the side that they go on: the motor of a joint crosses the gap of its gear, and
the tool is to stand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, columns_at
from postproc.compensation.pieces import BLEND_SHARE
from postproc.model import MoveKind, MoveRole, Plan
from postproc.units import DEG, UM

DOWN = 30.0 * DEG
"""A cut within this of the tool axis comes down to where the next one starts."""
LEAST_STEP = 10.0 * UM
"""Gears that move the tool by less are worth no point of their own."""


def comes_down(plan: Plan) -> BoolArray:
    """Return the cuts (m,) along the tool axis into the part that another direction follows."""
    is_cut = np.asarray(plan.role) == MoveRole.CUT
    point = plan.T_base_tcp[:, :3, 3]
    way = np.diff(point, axis=0, prepend=point[:1])
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    axis = np.asarray(plan.toolpath.axes)[np.maximum(plan.tag, 0)]
    down = is_cut & (plan.tag >= 0) & (np.sum(way * axis, axis=1) < -np.cos(DOWN))
    follows = np.append(is_cut[1:] & (np.sum(way[1:] * way[:-1], axis=1) < np.cos(DOWN)), False)
    return np.asarray(down & follows)


def with_points(plan: Plan, start: AnyIntArray, there: Plan) -> Plan:
    """Return a compensated plan with a point more behind moves (k,) that end where a cut starts.

    ``there``: k moves with the joints, poses and shifts of the points.
    """
    step = np.linalg.norm((there.T_base_tcp - plan.T_base_tcp[start])[:, :3, 3], axis=1)
    worth = np.flatnonzero(step > LEAST_STEP)
    start, step, there = start[worth], step[worth], there.rows(worth)
    speed = np.asarray(plan.speed)[start + 1]
    blend = np.minimum(np.asarray(plan.blend)[start], BLEND_SHARE * step)
    rounded, waits = np.array(plan.blend), np.array(plan.dwell)
    rounded[start], waits[start] = blend, 0.0
    nothing = np.full(len(start), np.nan)
    points = replace(
        there,
        kind=np.full(len(start), MoveKind.LIN),
        role=np.full(len(start), MoveRole.CUT),
        aux=np.full((len(start), 3), np.nan),
        speed=speed,
        ptp_fraction=nothing,
        blend=blend,
        duration=step / speed,
    )
    both = Plan.concat([replace(plan, blend=rounded, dwell=waits), points])
    order = np.argsort(np.concatenate([np.arange(len(plan)), start + 0.5]), kind="stable")
    longer = plan.rows(np.sort(np.concatenate([np.arange(len(plan)), start])))
    return replace(longer, **columns_at(both, "move", order))
