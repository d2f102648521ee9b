"""Sizes of hidden effects: what each adds to the readings, and what that counts."""

from __future__ import annotations

from typing import Any

import numpy as np

from tools.blind.beyond import BEYOND
from tools.blind.case import Case, Entry
from tools.blind.chain import Array, Geometry, columns, embed, sweep
from tools.blind.world import simulate

TRUTH_SIGMA, NUISANCE_SIGMA = 3.0, 0.2
"""An effect above the first is true and to be named; between the two, naming it is no fault."""
RARE_SIGMA, RARE_SHARE = 5.0, 0.25
"""Rows moved further, and fewer than that share of all: what a campaign shows in a few rows."""
HIDING = {
    "backlash": ("dir",),
    "servo_lag": ("qd",),
    "thermal_drift": ("time_s", "temp_C"),
    "joint_compliance": ("wrench",),
}
"""Columns without which an effect of the library cannot be seen."""


def difference(case: Case, entry: Entry) -> Array:
    """Return what an effect adds beside all others (n, 3), registration taken out [m]."""
    others = [other.effect for other in case.entries if other is not entry]
    full = simulate(case.robot, case.rows, case.hidden).point
    moved = full - simulate(case.robot, case.rows, others).point
    return _without(moved, _frame_columns(case)) if case.registered else moved


def contribution(case: Case, entry: Entry) -> float:
    """Return the rms per axis of what an effect adds [m]."""
    return float(np.sqrt(np.mean(difference(case, entry) ** 2)))


def rare(case: Case) -> list[int]:
    """Return the rows that causes in no library move far beyond the noise, if these are few."""
    strange = [e for e in case.entries if e.effect.name in BEYOND]
    if not strange:
        return []
    others = [e.effect for e in case.entries if e not in strange]
    moved = simulate(case.robot, case.rows, case.hidden).point
    away = np.linalg.norm(moved - simulate(case.robot, case.rows, others).point, axis=1)
    rows = np.flatnonzero(away > RARE_SIGMA * case.sigma)
    few = len(rows) < RARE_SHARE * len(away) and np.median(away) < case.sigma
    return [int(k) for k in rows] if few else []


def own_part(case: Case, moved: Array) -> float:
    """Return the rms per axis that frames, joint offsets and constant give cannot imitate [m]."""
    poses = sweep(Geometry.of(case.robot.arm, len(case.rows.q)), embed(case.rows.q))
    J = columns(poses, poses.tool_point(case.robot.tool))
    basis = [_frame_columns(case), J.reshape(-1, 6)]
    if case.plan.loads != "none":
        torque = np.einsum("nij,ni->nj", J, case.rows.force)
        basis.append((J * torque[:, None, :]).reshape(-1, 6))
    return float(np.sqrt(np.mean(_without(moved, np.concatenate(basis, axis=1)) ** 2)))


def _frame_columns(case: Case) -> Array:
    """Return the motions (3 n, 9) of a shifted, turned frame and another reflector place."""
    n = len(case.rows.q)
    poses = sweep(Geometry.of(case.robot.arm, n), embed(case.rows.q))
    p = poses.tool_point(case.robot.tool)
    shift = np.tile(np.eye(3), (n, 1, 1))
    turn = np.stack([np.cross(np.eye(3)[k], p) for k in range(3)], axis=2)
    return np.concatenate([shift, turn, poses.flange_turn], axis=2).reshape(-1, 9)


def _without(moved: Array, basis: Array) -> Array:
    scale = np.linalg.norm(basis, axis=0)
    basis = basis[:, scale > 0] / scale[scale > 0]
    flat = moved.reshape(-1)
    solution = np.linalg.lstsq(basis, flat, rcond=1e-10)[0]
    left: Array = (flat - basis @ solution).reshape(-1, 3)
    return left


def truth(case: Case) -> list[dict[str, Any]]:
    """Return every effect with its role, size and what naming it is worth, largest first."""
    found = []
    for entry in case.entries:
        if entry.role in ("setup", "known"):
            continue
        size = contribution(case, entry) / case.sigma
        weight = "true" if size >= TRUTH_SIGMA else "nuisance"
        if size < NUISANCE_SIGMA and entry.role != "planned":
            weight = "hidden"
        if case.kind == "none" and weight == "hidden":
            weight = "nuisance" if size > 0.05 else "hidden"
        found.append(
            {
                "name": entry.effect.name,
                "role": entry.role,
                "weight": weight,
                "outside": entry.effect.name in BEYOND or _unseen(case, entry),
                "size_sigma": round(size, 3),
                "strength": entry.effect.strength,
                "parameters": {
                    k: np.round(v, 12).tolist() for k, v in entry.effect.parameters.items()
                },
            }
        )
    return sorted(found, key=lambda item: -float(item["size_sigma"]))


def _unseen(case: Case, entry: Entry) -> bool:
    hiding = HIDING.get(entry.effect.name, ())
    return entry.role == "planned" and bool(hiding) and set(hiding) <= set(case.dropped)


def joint_give(case: Case) -> Array:
    """Return the joints' real compliance (6,) [rad/(N*m)] where it is constant."""
    give = case.robot.arm.give.copy()
    for entry in case.entries:
        if entry.effect.name == "joint_compliance" and entry.role != "known":
            give = give * entry.effect.strength * entry.effect.parameters["factor"]
    return give
