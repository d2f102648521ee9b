"""Targets given by joint angles only: placed where the file itself proves whose angles they are.

Joint angles mean nothing without the arm that they belong to: signs, zeros and lengths differ from
maker to maker. Targets that give both joint angles and a pose tell whether that arm is the cell's:
then the pose of the tool in the flange comes out the same at all of them. If it does, the pose of
a target with joint angles alone follows from the cell's own arm. If not, nothing is guessed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.geometry import inverse, rotation_angle, transform
from postproc.kinematics import build
from postproc.model import ToolPath
from postproc.planning import has_pose
from postproc.units import DEG, MM

FEWEST = 3
"""So many targets with both must agree."""
AGREE_POSITION = 0.1 * MM
AGREE_ANGLE = 0.02 * DEG
SEEN = 1.0 * DEG
"""Each joint must differ by so much among the targets that agree: else its sign is not proven."""


def with_joint_targets(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath with poses for its targets by joint angles, where they can be proven.

    Args:
        toolpath: what was read; its poses stand in the base frame of the arm that recorded it.
        cell: the arm that the angles are tried on.
    """
    if toolpath.joints is None or toolpath.rotations is None:
        return toolpath
    posed, jointed = has_pose(toolpath), np.isfinite(toolpath.joints).all(axis=1)
    wanted = jointed & ~posed
    points, R, axes = toolpath.points.copy(), toolpath.rotations.copy(), toolpath.axes.copy()
    placed: list[Finding] = []
    for tool in np.unique(toolpath.tool[wanted]).tolist():
        mine = toolpath.tool == tool
        proof, here = mine & posed & jointed, np.flatnonzero(mine & wanted)
        T_flange_tcp = _tool_of(toolpath, cell, proof)
        if T_flange_tcp is None:
            continue
        T_base_tcp = build(cell.robot).fk(toolpath.joints[here]) @ T_flange_tcp
        points[here], R[here] = T_base_tcp[:, :3, 3], T_base_tcp[:, :3, :3]
        axes[here] = -(R[here] @ np.asarray(cell.tool.axis)) + 0.0
        text = (
            f"{len(here)} targets by joint angles were placed by the cell's arm: the {proof.sum()} "
            "targets that give a pose as well agree with it; the spin about the tool axis is free"
        )
        placed.append(
            Finding(Severity.WARNING, "CNV011", text, source=toolpath.source(int(here[0])))
        )
    if not placed:
        return toolpath
    warnings = (*toolpath.warnings, *placed)
    return replace(toolpath, points=points, rotations=R, axes=axes, warnings=warnings)


def _tool_of(toolpath: ToolPath, cell: Cell, proof: BoolArray) -> FloatArray | None:
    """Return T_flange_tcp (4, 4) that all targets with both agree on, None where they do not."""
    if proof.sum() < FEWEST or toolpath.joints is None or toolpath.rotations is None:
        return None
    q = toolpath.joints[proof]
    if (np.ptp(q, axis=0) < SEEN).any():
        return None
    T_base_tcp = transform(toolpath.rotations[proof], toolpath.points[proof])
    T_flange_tcp = inverse(build(cell.robot).fk(q)) @ T_base_tcp
    first = T_flange_tcp[0]
    gap = np.linalg.norm(T_flange_tcp[:, :3, 3] - first[:3, 3], axis=1)
    turn = rotation_angle(np.broadcast_to(first[:3, :3], T_base_tcp[:, :3, :3].shape),
                          T_flange_tcp[:, :3, :3])  # fmt: skip
    agree = gap.max() <= AGREE_POSITION and turn.max() <= AGREE_ANGLE
    return np.asarray(first) if agree else None
