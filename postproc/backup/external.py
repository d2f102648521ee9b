"""External axes of a controller, as far as its files tell."""

from __future__ import annotations

from dataclasses import dataclass

from postproc.backup.variables import Variables

_FRAME = "X Y Z A B C"
_KINDS = {"ERSYS": "rail", **{f"E{letter}SYS": "positioner" for letter in "ABCDEF"}}


@dataclass(frozen=True, slots=True)
class ExternalAxisEntry:
    """E1..E6: soft limits [mm or deg] and type of the axis."""

    name: str
    is_linear: bool
    limits: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class ExternalKinematic:
    """A kinematic of external axes.

    ``kind``: ``rail`` where the robot stands on it, ``positioner`` where a workpiece does; frames
    X Y Z A B C [mm, deg] by the name of their variable.
    """

    name: str
    kind: str
    axes: tuple[ExternalAxisEntry, ...]
    frames: dict[str, tuple[float, ...]]


def external_kinematics(data: Variables, config: Variables | None) -> tuple[ExternalKinematic, ...]:
    """Return the kinematics of the external axes; axes that belong to none come as their own."""
    count = int(min(max(data.number("$EX_AX_NUM") or 0.0, 0.0), 6.0))
    if not count:
        return ()
    kinds = data.get("$EX_KIN")
    found, free = [], [f"E{i}" for i in range(1, count + 1)]
    for place in range(1, 7):
        word = str(kinds.get("ET" + str(place), "#NONE")) if isinstance(kinds, dict) else "#NONE"
        own = "$ET" + str(place) + "_"
        members = data.get(own + "AX")
        names = [str(v).lstrip("#") for v in members.values()] if isinstance(members, dict) else []
        names = [name for name in names if name in free]
        if word == "#NONE" or not names:
            continue
        free = [name for name in free if name not in names]
        kind = _KINDS.get(word.lstrip("#").split("_")[0], "positioner")
        frames = _frames(data, config, place, kind)
        title = data.text(own + "NAME") or word.lstrip("#")
        axes = tuple(_axis(data, name) for name in names)
        found.append(ExternalKinematic(title, kind, axes, frames))
    found += [ExternalKinematic(name, "", (_axis(data, name),), {}) for name in free]
    return tuple(found)


def _axis(data: Variables, name: str) -> ExternalAxisEntry:
    index = 6 + int(name[1:])
    low, high = data.number("$SOFTN_END", index), data.number("$SOFTP_END", index)
    limits = (low, high) if low is not None and high is not None and low < high else None
    return ExternalAxisEntry(name, data.number("$AXIS_TYPE", index) == 1.0, limits)


def _frames(
    data: Variables, config: Variables | None, place: int, kind: str
) -> dict[str, tuple[float, ...]]:
    own = "$ET" + str(place) + "_"
    names = [own + part for part in ("TA1KR", "TA2A1", "TA3A2", "TFLA3", "TPINFL")]
    names += ["$ERSYSROOT"] if kind == "rail" else []
    found = {name: data.parts(name, _FRAME) for name in names}
    if kind == "positioner" and config is not None:
        for index in config.indices("MACHINE_DEF"):
            machine = config.get("MACHINE_DEF", index)
            root = machine.get("ROOT") if isinstance(machine, dict) else None
            if isinstance(root, dict) and index > 1 and any(root.values()):
                found[f"MACHINE_DEF[{index}].ROOT"] = [
                    float(root.get(k, 0)) for k in _FRAME.split()
                ]
    return {name: tuple(frame) for name, frame in found.items() if frame is not None}
