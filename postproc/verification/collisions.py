"""Collisions along the executed motions, between the sampled poses as well."""

from __future__ import annotations

import numpy as np

from postproc.kinematics.model import Kinematics
from postproc.model.arrays import BoolArray
from postproc.model.cell import Cell
from postproc.verification.checks import Result

_LISTED = 20


def check_collisions(
    result: Result, cell: Cell, kinematics: Kinematics, is_cut: BoolArray | None
) -> bool:
    """Search the joint paths for collisions; False if the cell has no solid to collide with.

    Args:
        result: joint paths; collects the findings.
        cell: its solids.
        kinematics: of its robot.
        is_cut: (m,) motions on which cutting solids may touch the workpiece; None: all path
            motions, as no CAM file tells.
    """
    if not (cell.obstacles or cell.tool.meshes or cell.workpiece.meshes):
        return False
    from postproc.collision.scene import Scene

    paths = result.paths
    trace = paths.trace
    q, motion = _sequence(result)
    if len(q) < 2:
        return True
    touch = trace.is_cp if is_cut is None else _with_way_out(is_cut, trace.is_cp)
    hits = Scene.build(cell, kinematics).check_paths(q[:-1], q[1:], touch[motion[1:]])
    found = np.flatnonzero(hits.hit)
    told: set[tuple[int, int]] = set()
    for row in found.tolist():
        key = (int(motion[row + 1]), int(hits.pair[row]))
        if key in told:
            continue
        told.add(key)
        if len(told) <= _LISTED:
            one, other = hits.pairs[key[1]] if key[1] >= 0 else ("?", "?")
            result.finding("collision", key[0], f"{one} hits {other} on the way there")
    return True


def _sequence(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Return all configurations (k, 6) in order, and the motion (k,) each belongs to."""
    paths = result.paths
    ptp = np.flatnonzero(~paths.trace.is_cp)
    q = np.concatenate([paths.q_sample, paths.q[ptp]])
    motion = np.concatenate([paths.row, ptp])
    order = np.argsort(motion, kind="stable")
    known = np.isfinite(q[order]).all(axis=1)
    return q[order][known], motion[order][known]


def _with_way_out(is_cut: BoolArray, is_cp: BoolArray) -> BoolArray:
    """Return the cuts and the path motion behind each: the tool stands in the part there."""
    behind = np.r_[False, is_cut[:-1]] & is_cp
    return np.asarray(is_cut | behind)
