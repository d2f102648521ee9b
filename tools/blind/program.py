"""A reader of KRL of its own: what a program commands, joint by joint.

It knows the few statements that a program for a path needs, and refuses any other motion.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tools.blind.chain import (
    Array,
    Dimensions,
    Geometry,
    embed,
    rotation,
    solve_pose,
    sweep,
)

STEP = 1e-3
"""Longest way [m] of the tool between two poses."""
FEWEST, JOINT_STEPS = 4, 40
HOME = np.deg2rad([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
_FIELD = re.compile(r"\b(A[1-6]|[XYZABC])\s+(-?[\d.]+(?:E[-+]?\d+)?)")
_LINE = re.compile(r"; CAM line (\d+)")
_NEAR = re.compile(r"^\$APO\.CDIS\s*=\s*([\d.]+)", re.IGNORECASE)
_SPEED = re.compile(r"^\$VEL\.CP\s*=\s*([\d.]+)", re.IGNORECASE)


@dataclass(frozen=True)
class Command:
    """One motion: ``kind`` PTP, LIN or CIRC; (6,) joints [rad], or poses (4, 4) of the tool.

    ``line`` of the CAM file, -1 where none is named; ``speed`` [m/s] set for path motions;
    ``blend`` [m] from which on the next motion is approached, 0: exact.
    """

    kind: str
    line: int
    speed: float
    joints: Array | None = None
    pose: Array | None = None
    way: Array | None = None
    blend: float = 0.0


@dataclass(frozen=True)
class Drive:
    """A program driven: poses in the order of time, k of them.

    q (k, 6) [rad]; point (k, 3) and turn (k, 3, 3) of the tool in the base; command (k,): which;
    speed (k,) [m/s], infinite in joint motions; ends (m,): last pose of each command.
    """

    commands: tuple[Command, ...]
    q: Array
    point: Array
    turn: Array
    command: Array
    speed: Array
    ends: Array


def read_krl(path: Path) -> tuple[Command, ...]:
    """Return the motions of a program.

    Raises:
        ValueError: for a motion that is not PTP by axes, LIN or CIRC by frames.
    """
    found: list[Command] = []
    speed, near = float("nan"), 0.0
    for text in path.read_text(encoding="ascii").splitlines():
        statement, _, remark = text.strip().partition(";")
        named = _LINE.search(";" + remark)
        line = int(named[1]) if named else -1
        told = _SPEED.match(statement)
        if told:
            speed = float(told[1])
        told = _NEAR.match(statement)
        if told:
            near = 1e-3 * float(told[1])
        blend = near if "C_DIS" in statement.upper().split() else 0.0
        word = statement.split(" ", 1)[0].upper()
        parts = [dict(_FIELD.findall(part)) for part in re.findall(r"\{([^}]*)\}", statement)]
        if word == "PTP" and len(parts) == 1 and len(parts[0]) >= 6 and "A6" in parts[0]:
            joints = np.deg2rad([float(parts[0][f"A{k}"]) for k in range(1, 7)])
            found.append(Command("PTP", line, speed, joints=joints))
        elif word == "LIN" and len(parts) == 1:
            found.append(Command("LIN", line, speed, pose=_pose(parts[0]), blend=blend))
        elif word == "CIRC" and len(parts) == 2:
            found.append(
                Command("CIRC", line, speed, pose=_pose(parts[1]), way=_pose(parts[0]), blend=blend)
            )
        elif re.match(r"(S?PTP|S?LIN|S?CIRC|SPLINE)(_REL)?$", word):
            raise ValueError(f"{path.name}: not understood: {text}")
    return tuple(found)


def drive_program(
    commands: tuple[Command, ...], arm: Dimensions, T_robroot_base: Array, T_flange_tcp: Array
) -> Drive:
    """Return the poses of a program, as a controller without blending drives them.

    Raises:
        ArithmeticError: if a pose is not reached.
    """
    T_tcp_flange = np.linalg.inv(T_flange_tcp)
    now = HOME
    parts: list[tuple[Array, Array, Array]] = []
    T_now = _tool(arm, now[None], T_robroot_base, T_flange_tcp)[0]
    for command in commands:
        if command.joints is not None:
            share = np.linspace(0.0, 1.0, JOINT_STEPS + 1)[1:, None]
            q = now + share * (command.joints - now)
            T = _tool(arm, q, T_robroot_base, T_flange_tcp)
        else:
            T = _along(command, T_now)
            flange = T_robroot_base @ T @ T_tcp_flange
            q = _followed(arm, flange, now)
        parts.append((q, T[:, :3, 3], T[:, :3, :3]))
        now, T_now = q[-1], T[-1]
    sizes = [len(part[0]) for part in parts]
    speed = [np.inf if c.joints is not None else c.speed for c in commands]
    return Drive(
        commands,
        *(np.concatenate([part[k] for part in parts]) for k in range(3)),
        np.repeat(np.arange(len(commands)), sizes),
        np.repeat(speed, sizes),
        np.cumsum(sizes) - 1,
    )


def _followed(arm: Dimensions, flange: Array, start: Array) -> Array:
    """Return joint angles (n, 6) along flange poses: the end first, what is between from it."""
    q_end, good = solve_pose(arm, flange[-1:, :3, 3], flange[-1:, :3, :3], start)
    share = np.linspace(0.0, 1.0, len(flange) + 1)[1:, None]
    q, inner = solve_pose(arm, flange[:, :3, 3], flange[:, :3, :3], start + share * (q_end - start))
    if not (good.all() and inner.all()) or np.abs(np.diff(q, axis=0)).max(initial=0.0) > 0.2:
        raise ArithmeticError("a pose of the program is not reached")
    return q


def _tool(arm: Dimensions, q: Array, T_robroot_base: Array, T_flange_tcp: Array) -> Array:
    poses = sweep(Geometry.of(arm, len(q)), embed(q))
    T = np.tile(np.eye(4), (len(q), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = poses.flange_turn, poses.flange_p
    placed: Array = np.linalg.inv(T_robroot_base) @ T @ T_flange_tcp
    return placed


def _pose(fields: dict[str, str]) -> Array:
    value = {name: float(text) for name, text in fields.items()}
    T = np.eye(4)
    for name, axis in (("A", [0, 0, 1]), ("B", [0, 1, 0]), ("C", [1, 0, 0])):
        turn = rotation(np.array([axis], dtype=float), np.deg2rad([value[name]]))[0]
        T[:3, :3] = T[:3, :3] @ turn
    T[:3, 3] = [1e-3 * value[name] for name in "XYZ"]
    return T


def _along(command: Command, start: Array) -> Array:
    """Return the tool's poses (n, 4, 4) on the way of a path motion, without its start."""
    end = start if command.pose is None else command.pose
    D = start[:3, :3].T @ end[:3, :3]
    axis = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    size = float(np.linalg.norm(axis))
    angle = float(np.arctan2(0.5 * size, 0.5 * (np.trace(D) - 1.0)))
    centre, turn = (None, 0.0) if command.way is None else _circle(start, command.way, end)
    length = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    if centre is not None:
        length = abs(turn) * float(np.linalg.norm(start[:3, 3] - centre[:3, 3]))
    n = max(FEWEST, int(np.ceil(length / STEP)), int(np.ceil(angle / 0.01)))
    share = np.arange(1, n + 1) / n
    T = np.tile(np.eye(4), (n, 1, 1))
    unit = axis / size if size > 1e-12 else np.array([0.0, 0.0, 1.0])
    T[:, :3, :3] = start[:3, :3] @ rotation(np.tile(unit, (n, 1)), share * angle)
    if centre is None:
        T[:, :3, 3] = start[:3, 3] + share[:, None] * (end[:3, 3] - start[:3, 3])
    else:
        spoke = start[:3, 3] - centre[:3, 3]
        around = rotation(np.tile(centre[:3, 2], (n, 1)), share * turn)
        T[:, :3, 3] = centre[:3, 3] + around @ spoke
    return T


def _circle(start: Array, way: Array, end: Array) -> tuple[Array, float]:
    """Return a frame at the centre, z along the axis, and the angle of an arc by three points."""
    a, b, c = start[:3, 3], way[:3, 3], end[:3, 3]
    u, v = b - a, c - a
    normal = np.cross(u, v)
    square = float(normal @ normal)
    middle = a + np.cross((u @ u) * v - (v @ v) * u, normal) / (2.0 * square)
    z = normal / np.sqrt(square)
    first, last = a - middle, c - middle
    turn = float(np.arctan2(z @ np.cross(first, last), first @ last)) % (2.0 * np.pi)
    T = np.eye(4)
    T[:3, 2], T[:3, 3] = z, middle
    return T, turn
