"""External axes of a controller: what carries the robot, what turns a workpiece, and where.

The chain of a kinematic is root, ``$ETn_TA1KR``, axis 1, ``$ETn_TA2A1``, axis 2, ``$ETn_TA3A2``,
axis 3, ``$ETn_TFLA3``; each axis moves along or about z of its frame. A rail (``#ERSYS``) stands
at ``$ERSYSROOT``, its flange is the robot root and ``$ROBROOT`` is ignored. A positioner stands at
the ROOT of its ``MACHINE_DEF``; a base that hangs on it is ``EK(ROOT, MECH_TYPE, BASE_DATA)``. A
KRC2 has no ``MACHINE_DEF``: the ROOT is that of ``EX_AX_DATA``, all of its kinematic the same.

Source: KUKA, KR C2 machine data 02.2005, 2.1.9, 2.1.10, 2.2.8 to 2.2.11; ``bas.src`` of KSS 8.6
and of V4.1.7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from postproc.backup.variables import FRAME, Variables, matrix, numbers_of, rated_speed, six
from postproc.records import dataclass

_RAIL = "ERSYS"
_POSITIONERS = frozenset(f"E{letter}SYS" for letter in "ABCDEF")
_KINEMATICS = ("ET1", "ET2", "ET3", "ET4", "ET5", "ET6")
_LINKS = ("TA1KR", "TA2A1", "TA3A2")
_LINEAR, _ENDLESS = 1.0, 5.0
_FARTHEST = 1e5
"""Largest limit [mm or deg] that is one."""


@dataclass(frozen=True, slots=True)
class ExternalAxisEntry:
    """E1..E6 with all axes of its kinematic at 0.

    Args:
        name: ``E1``.
        is_linear: whether its unit is mm, else deg.
        limits: soft limits, None where they are not set.
        speed: rated speed [mm/s or deg/s], None where drive data are not in the file.
        frame: X Y Z A B C [mm, deg] in the world; it moves along or about z of this frame.
    """

    name: str
    is_linear: bool
    limits: tuple[float, float] | None
    speed: float | None = None
    frame: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class ExternalKinematic:
    """A kinematic of external axes.

    Args:
        name: as the controller calls it.
        kind: ``rail`` where the robot stands on it, ``positioner`` where a workpiece does, empty
            for an axis that belongs to none.
        system: such as ``ERSYS``.
        axes: its axes in the order of the chain.
        flange: X Y Z A B C [mm, deg] of its flange in the world with all axes at 0.
        frames: frames of the files by the name of their variable.
        unknown: why a cell cannot have it as it is, empty where it can.
    """

    name: str
    kind: str
    system: str
    axes: tuple[ExternalAxisEntry, ...]
    flange: tuple[float, ...] | None = None
    frames: dict[str, tuple[float, ...]] = field(default_factory=dict)
    unknown: str = ""


def external_kinematics(data: Variables, config: Variables | None) -> tuple[ExternalKinematic, ...]:
    """Return the kinematics of the external axes; axes that belong to none come as their own."""
    count = int(min(max(data.number("$EX_AX_NUM") or 0.0, 0.0), 6.0))
    if not count:
        return ()
    kinds = data.get("$EX_KIN")
    found, free = [], [f"E{i}" for i in range(1, count + 1)]
    for kinematic in _KINEMATICS:
        word = str(kinds.get(kinematic, "#NONE")) if isinstance(kinds, dict) else "#NONE"
        members = data.get(f"${kinematic}_AX")
        names = [str(v).lstrip("#") for v in members.values()] if isinstance(members, dict) else []
        names = [name for name in names if name in free]
        if word == "#NONE" or not names:
            continue
        free = [name for name in free if name not in names]
        found.append(_kinematic(data, config, kinematic, word.lstrip("#"), names))
    found += [
        ExternalKinematic(
            name, "", "", (_axis(data, name, None),), unknown="it belongs to no kinematic"
        )
        for name in free
    ]
    return tuple(found)


def _kinematic(
    data: Variables, config: Variables | None, short: str, system: str, names: Sequence[str]
) -> ExternalKinematic:
    own = f"${short}_"
    kind = "rail" if system == _RAIL else "positioner" if system in _POSITIONERS else ""
    root_name, root = _root(data, config, kind, system)
    frames = {own + part: data.parts(own + part, FRAME) for part in (*_LINKS, "TFLA3", "TPINFL")}
    if root_name:
        frames[root_name] = root
    links = [frames[own + part] for part in _LINKS[: len(names)]]
    chain = [root, *links, frames[own + "TFLA3"]]
    axis_frames, flange = _chain(chain)
    axes = tuple(_axis(data, name, frame) for name, frame in zip(names, axis_frames, strict=True))
    return ExternalKinematic(
        name=data.text(own + "NAME") or system,
        kind=kind,
        system=system,
        axes=axes,
        flange=flange,
        frames={name: tuple(frame) for name, frame in frames.items() if frame is not None},
        unknown=_unknown(kind, axes, flange, chain),
    )


def _root(
    data: Variables, config: Variables | None, kind: str, system: str
) -> tuple[str, list[float] | None]:
    """Return name and value of the frame in the world that a kinematic stands at."""
    if kind == "rail":
        return "$ERSYSROOT", data.parts("$ERSYSROOT", FRAME)
    if config is None:
        return "", None
    for index in config.indices("MACHINE_DEF"):
        machine = config.get("MACHINE_DEF", index)
        if isinstance(machine, dict) and machine.get("MECH_TYPE") == f"#{system}":
            parent = str(machine.get("PARENT", "")).strip().upper()
            root = numbers_of(machine.get("ROOT"), FRAME) if parent in ("", "WORLD") else None
            return f"MACHINE_DEF[{index}].ROOT", root
    old = old_external_bases(config, system)
    roots = {tuple(root) for _, root, _ in old}
    return (f"EX_AX_DATA[{old[0][0]}].ROOT", list(roots.pop())) if len(roots) == 1 else ("", None)


def old_external_bases(
    config: Variables, system: str = ""
) -> list[tuple[int, list[float], list[float]]]:
    """Return index, ROOT and OFFSET of the ``EX_AX_DATA`` of a KRC2 that are not all zero.

    A ``$config.dat`` with ``MACHINE_DEF`` is of a newer controller: none. ``system``: such as
    ``EASYS``; empty for all.
    """
    found = []
    for index in () if config.indices("MACHINE_DEF") else config.indices("EX_AX_DATA"):
        held = config.get("EX_AX_DATA", index)
        if not isinstance(held, dict) or str(held.get("EX_KIN")).lstrip("#") not in (
            (system,) if system else _POSITIONERS
        ):
            continue
        root, offset = (numbers_of(held.get(key), FRAME) for key in ("ROOT", "OFFSET"))
        if root is not None and offset is not None and any((*root, *offset)):
            found.append((index, root, offset))
    return found


def _chain(
    frames: Sequence[list[float] | None],
) -> tuple[list[tuple[float, ...] | None], tuple[float, ...] | None]:
    """Return the frames of the axes and of the flange in the world, None where one is not known."""
    if None in frames:
        return [None] * (len(frames) - 2), None
    T, found = np.eye(4), []
    for frame in frames:
        T = T @ matrix(frame)  # type: ignore[arg-type]
        found.append(tuple(six(T)))
    return found[1:-1], found[-1]  # type: ignore[return-value]


def _axis(data: Variables, name: str, frame: tuple[float, ...] | None) -> ExternalAxisEntry:
    index = 6 + int(name[1:])
    low, high = data.number("$SOFTN_END", index), data.number("$SOFTP_END", index)
    is_set = low is not None and high is not None and -_FARTHEST <= low < high <= _FARTHEST
    limits = (low, high) if is_set and data.number("$AXIS_TYPE", index) != _ENDLESS else None
    is_linear = data.number("$AXIS_TYPE", index) == _LINEAR
    speed = rated_speed(data, index, 1e3 if is_linear else 360.0)
    return ExternalAxisEntry(name, is_linear, limits, speed, frame)  # type: ignore[arg-type]


def _unknown(
    kind: str,
    axes: Sequence[ExternalAxisEntry],
    flange: tuple[float, ...] | None,
    chain: Sequence[list[float] | None],
) -> str:
    """Return why a cell cannot have a kinematic, empty where it can."""
    kinds = {"rail": "linear", "positioner": "rotational"}
    numbers = [value for frame in chain for value in frame or ()]
    unset = [axis.name for axis in axes if axis.limits is None]
    slow = [axis.name for axis in axes if axis.speed is None]
    reasons = {
        "its kind is not known": not kind,
        "its place is not in the files": flange is None,
        "all its frames are zero, it was never measured": not any(numbers),
        "its frames are out of range": max(map(abs, numbers), default=0.0) > _FARTHEST,
        f"a {kind} of a cell has {kinds.get(kind, '')} axes alone": any(
            axis.is_linear != (kind == "rail") for axis in axes
        ),
        f"the soft limits of {', '.join(unset)} are not set": bool(unset),
        f"the speed of {', '.join(slow)} is not in the files": bool(slow),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")
