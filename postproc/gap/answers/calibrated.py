"""The calibrated arm as URDF: what of a model is the same in every pose, for any simulation.

An effect is in it where it turns joints and moves links alike in all poses and needs no column but
the joint angles. What follows the pose, a load, the time or the approach is no geometry: the file
names it in a comment, for whoever reads it to know what is still missing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.gap.data import Samples
from postproc.gap.effect import Effect, State
from postproc.gap.robot_model import RobotModel, effect_of
from postproc.geometry import inverse, rotation_from_vector, transform
from postproc.kinematics import Kinematics
from postproc.model import ModelFile

TIP = "tool_point"
_SAME = 1e-15
_POSES = 4
_SEED = 7


def calibrated_urdf(kinematics: Kinematics, cell: Cell, model: ModelFile) -> bytes:
    """Return the arm of a cell with the geometry of a model, commanded angles in.

    Links ``base_link``, ``link_1`` to ``link_6``, ``flange``, ``tool_point``: the last is the tool
    point of the cell as the model moves it. Exact: forward kinematics of the file is that of the
    model's geometric effects.

    Args:
        kinematics: of the cell's robot.
        cell: with its tool.
        model: effects.
    """
    robot = RobotModel.of(kinematics, cell, model)
    low, high = np.asarray(cell.robot.q_min), np.asarray(cell.robot.q_max)
    q = np.random.default_rng(_SEED).uniform(low, high, (_POSES, 6))
    samples = robot.samples(np.vstack([np.zeros(6), q]))
    turn, link, inside = np.zeros(6), np.zeros((7, 6)), list[str]()
    for name, state in robot.states.items():
        own = _constant(effect_of(name), samples, state)
        if own is not None:
            turn, link = turn + own[0], link + own[1]
            inside.append(name)
    outside = [name for name in robot.states if name not in inside]
    return _text(cell, samples, turn, link, _notes(inside, outside)).encode()


def _constant(
    effect: Effect, samples: Samples, state: State
) -> tuple[FloatArray, FloatArray] | None:
    """Return turns (6,) and link motions (7, 6) that are the same in all poses, None if not."""
    if effect.needs:
        return None
    basis, theta = effect.basis(samples, state.setting), np.nan_to_num(state.theta)
    if basis.point is not None and np.any(basis.point @ theta):
        return None
    found = []
    for part, shape in ((basis.joint, (6,)), (basis.link, (7, 6))):
        moved = np.zeros((len(samples), *shape)) if part is None else part @ theta
        if np.any(np.ptp(moved, axis=0) > _SAME):
            return None
        found.append(moved[0])
    return found[0], found[1]


def _notes(inside: Sequence[str], outside: Sequence[str]) -> list[str]:
    """Return the comment at the top of the file, line by line."""
    lines = [
        f"In it: {', '.join(inside) or 'nothing beyond the nominal arm'}.",
        "Angles are those that the controller is commanded.",
    ]
    if outside:
        lines.append("Not in it, for it is not the same in every pose:")
        lines += [f"  {name}: {effect_of(name).title}" for name in outside]
    return [line.replace("--", "-") for line in lines]


def _text(
    cell: Cell, samples: Samples, turn: FloatArray, link: FloatArray, notes: Sequence[str]
) -> str:
    """Return the file: frames at zero angles (row 0 of samples), moved, joints about their axes."""
    frames, axes = samples.frames[0], samples.axes[0]
    moved = [transform(rotation_from_vector(part[:3]), part[3:]) for part in link]
    R_6_flange = samples.arm.link_constants()[2]
    to_flange = transform(R_6_flange, _in_frame(frames[6], samples.flange()[0]))
    lines = ['<?xml version="1.0"?>', "<!--", *(f"  {note}" for note in notes), "-->"]
    lines.append(f'<robot name="{_name(cell.robot.name)}_calibrated">')
    links = ["base_link", *(f"link_{k}" for k in range(1, 7)), "flange", TIP]
    lines += [f'  <link name="{name}"/>' for name in links]
    robot, unknown = cell.robot, np.full(6, np.nan)
    torques = unknown if robot.torque_max is None else robot.torque_max
    rated = np.nan_to_num(np.stack([robot.q_min, robot.q_max, robot.qd_max, torques], axis=1))
    for k, (low, high, speed, torque) in enumerate(rated.tolist()):
        axis = frames[k + 1, :3, :3].T @ axes[:, k]
        placed = moved[k] @ inverse(frames[k]) @ frames[k + 1]
        placed = placed @ transform(rotation_from_vector(turn[k] * axis), np.zeros(3))
        lines += [
            f'  <joint name="joint_{k + 1}" type="revolute">',
            *_joint(links[k], links[k + 1], placed),
            f'    <axis xyz="{_numbers(axis)}"/>',
            f'    <limit lower="{low:.10g}" upper="{high:.10g}"'
            f' velocity="{speed:.10g}" effort="{torque:.10g}"/>',
            "  </joint>",
        ]
    # what is moved beyond joint 6 is the tool: the flange stays the arm's, for another tool
    tool = inverse(to_flange) @ moved[6] @ to_flange @ np.asarray(cell.tool.T_flange_tcp)
    for child, parent, placed in (("flange", 6, to_flange), (TIP, 7, tool)):
        lines += [f'  <joint name="{child}_joint" type="fixed">']
        lines += [*_joint(links[parent], child, placed), "  </joint>"]
    return "\n".join([*lines, "</robot>"]) + "\n"


def _in_frame(T: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(T[:3, :3].T @ (p - T[:3, 3]))


def _joint(parent: str, child: str, T: FloatArray) -> list[str]:
    R = T[:3, :3]
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    if math.hypot(R[0, 0], R[1, 0]) < 1e-8:  # yaw and roll turn about one axis
        roll, yaw = math.atan2(-R[0, 1] * np.sign(R[2, 0]), R[1, 1]), 0.0
    else:
        roll, yaw = math.atan2(R[2, 1], R[2, 2]), math.atan2(R[1, 0], R[0, 0])
    angles = _numbers(np.array([roll, pitch, yaw]))
    return [
        f'    <parent link="{parent}"/><child link="{child}"/>',
        f'    <origin xyz="{_numbers(T[:3, 3])}" rpy="{angles}"/>',
    ]


def _numbers(values: FloatArray) -> str:
    return " ".join(f"{value + 0.0:.15g}" for value in values)


def _name(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)
