"""Targets given by joint angles only: met by the cell's arm as they are.

Joint angles mean nothing without the arm that they belong to: signs, zeros and lengths differ from
maker to maker. Targets of the file that give both joint angles and a pose tell whether that arm is
the cell's: then the pose of the tool in the flange comes out the same at all of them. Where they
show another arm, nothing is guessed; where nothing shows it, the angles are taken and said so.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import Cell
from postproc.errors import CellError, Finding, Severity
from postproc.geometry import inverse, rotation_angle, transform
from postproc.kinematics import build
from postproc.model import ToolPath
from postproc.planning import has_pose
from postproc.process import assign
from postproc.units import DEG, MM

FEWEST = 3
"""So many targets with both must agree."""
AGREE_POSITION = 0.1 * MM
AGREE_ANGLE = 0.02 * DEG
SEEN = 1.0 * DEG
"""Each joint must differ by so much among the targets that agree: else its sign is not proven."""


def with_joint_targets(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath with poses for its targets by joint angles alone.

    The pose is that of the cell's own tool in its own base at these angles. Targets beyond the
    limits of the arm, or of an arm that the file shows to be another, stay without one.
    """
    if toolpath.joints is None or toolpath.rotations is None:
        return toolpath
    posed, jointed = has_pose(toolpath), np.isfinite(toolpath.joints).all(axis=1)
    wanted = jointed & ~posed
    wanted[wanted] &= build(cell.robot).within_limits(toolpath.joints[wanted])
    if not wanted.any():
        return toolpath
    try:
        assigned = assign(toolpath, cell)
    except CellError:
        return toolpath  # which tool is meant nobody knows: the job itself says so
    served = assigned.toolpath
    points, R = served.points.copy(), np.array(served.rotations)
    placed: list[Finding] = []
    for index in np.unique(assigned.tool[wanted]).tolist():
        mine = assigned.tool == index
        proof, here = mine & posed & jointed, np.flatnonzero(mine & wanted & (assigned.base >= 0))
        known = _is_proven(toolpath, cell, proof)
        if index < 0 or not len(here) or known is False:
            continue
        T_robroot_base = np.array([base.T_robroot_base for base in cell.bases])[assigned.base[here]]
        T_robroot_tcp = build(cell.robot).fk(toolpath.joints[here]) @ cell.tools[index].T_flange_tcp
        T_base_tcp = inverse(T_robroot_base) @ T_robroot_tcp
        points[here], R[here] = T_base_tcp[:, :3, 3], T_base_tcp[:, :3, :3]
        text = f"{len(here)} targets by joint angles are placed with the cell's arm: " + (
            f"the {proof.sum()} targets that give a pose as well agree with it"
            if known
            else "nothing in the file shows that it is the same arm"
        )
        source = toolpath.source(int(here[0]))
        placed.append(Finding(Severity.WARNING, "CNV011", text, source=source))
    if not placed:
        return toolpath
    axes = -np.einsum("nij,nj->ni", R, cell.axes_of(assigned.tool)) + 0.0
    warnings = (*toolpath.warnings, *placed)
    return replace(served, points=points, rotations=R, axes=axes, warnings=warnings)


def _is_proven(toolpath: ToolPath, cell: Cell, proof: BoolArray) -> bool | None:
    """Return whether all targets with both say one pose of the tool; None where nothing tells."""
    if toolpath.joints is None or toolpath.rotations is None or proof.sum() < FEWEST:
        return None
    q = toolpath.joints[proof]
    if (np.ptp(q, axis=0) < SEEN).any():
        return None
    T_base_tcp = transform(toolpath.rotations[proof], toolpath.points[proof])
    T_flange_tcp = inverse(build(cell.robot).fk(q)) @ T_base_tcp
    R, point = T_flange_tcp[:, :3, :3], T_flange_tcp[:, :3, 3]
    gap = np.linalg.norm(point - point[0], axis=1)
    turn = rotation_angle(np.broadcast_to(R[0], R.shape), R)
    return bool(gap.max() <= AGREE_POSITION and turn.max() <= AGREE_ANGLE)
