"""Tools and bases of ``$config.dat``: those that are used, with name, kind and load."""

from __future__ import annotations

from dataclasses import replace

from postproc.backup.external import old_external_bases
from postproc.backup.variables import FRAME, Variables, numbers_of
from postproc.records import dataclass

_OLD_EXTERNAL = 16
"""FDAT.BASE_NO of a KRC2 is this and the number of its EX_BASE: ``bas.src`` of V4.1.7."""


@dataclass(frozen=True, slots=True)
class ToolEntry:
    """A tool: frame X Y Z A B C in the flange [mm, deg], load where it was entered.

    ``kind``: ``#BASE`` for a tool on the flange, ``#TCP`` for a workpiece on it (the tool stands in
    the room), ``#NONE`` or empty where the pad never set it. ``mass_kg`` is None where the
    controller takes the rated load. ``cog`` X Y Z A B C [mm, deg], ``inertia_kg_m2`` X Y Z.
    """

    number: int
    name: str
    frame: tuple[float, ...]
    kind: str
    mass_kg: float | None = None
    cog: tuple[float, ...] | None = None
    inertia_kg_m2: tuple[float, ...] | None = None

    @property
    def is_carried(self) -> bool:
        """Whether the robot carries this tool."""
        return self.kind != "#TCP"


@dataclass(frozen=True, slots=True)
class BaseEntry:
    """A base: frame X Y Z A B C in the world [mm, deg].

    ``kind``: ``#TCP`` for a tool that stands in the room; ``parent``: the kinematic that carries
    it, empty for the world; ``system``: such as ``EASYS`` where it is one of this controller: the
    frame is then one in its flange.
    """

    number: int
    name: str
    frame: tuple[float, ...]
    kind: str
    parent: str = ""
    system: str = ""


def tool_entries(config: Variables) -> tuple[ToolEntry, ...]:
    """Return the tools that are used: a frame that is not zero, a name, a kind or a load."""
    found = []
    for number in config.indices("TOOL_DATA"):
        frame = config.parts("TOOL_DATA", FRAME, number)
        name, kind = config.text("TOOL_NAME", number), str(config.get("TOOL_TYPE", number) or "")
        load = config.get("LOAD_DATA", number)
        mass = numbers_of(load, "M")
        weighed = mass is not None and mass[0] >= 0.0
        is_used = any(frame or ()) or name or kind not in ("", "#NONE") or weighed
        if number < 1 or frame is None or not is_used:
            continue
        entry = ToolEntry(number, name, tuple(frame), kind)
        if mass is not None and weighed:
            cog, inertia = numbers_of(load.get("CM"), FRAME), numbers_of(load.get("J"), "X Y Z")
            is_inertia = inertia is not None and any(inertia) and min(inertia) >= 0.0
            entry = replace(
                entry,
                mass_kg=mass[0],
                cog=tuple(cog) if cog is not None else None,
                inertia_kg_m2=tuple(inertia) if inertia is not None and is_inertia else None,
            )
        found.append(entry)
    return tuple(found)


def base_entries(config: Variables) -> tuple[BaseEntry, ...]:
    """Return the bases that are used: a frame that is not zero, a name or a kind."""
    found = []
    for number in config.indices("BASE_DATA"):
        frame = config.parts("BASE_DATA", FRAME, number)
        name, kind = config.text("BASE_NAME", number), str(config.get("BASE_TYPE", number) or "")
        is_used = any(frame or ()) or name or kind not in ("", "#NONE")
        if number < 1 or frame is None or not is_used:
            continue
        found.append(BaseEntry(number, name, tuple(frame), kind, *_parent(config, number)))
    for index, _, offset in old_external_bases(config):
        system = str(config.get("EX_AX_DATA", index)["EX_KIN"]).lstrip("#")
        number = _OLD_EXTERNAL + index
        found.append(BaseEntry(number, "", tuple(offset), "#BASE", system, system))
    return tuple(found)


def _parent(config: Variables, number: int) -> tuple[str, str]:
    """Return name and system of the kinematic that carries a base, empty for the world."""
    held = config.get("MACHINE_FRAME_DAT", number)
    index = numbers_of(held, "MACH_DEF_INDEX")
    parent = str(held.get("PARENT", "")).strip() if isinstance(held, dict) else ""
    if index is None or index[0] <= 0.0 or parent.upper() in ("", "WORLD"):
        return "", ""
    machine, own = config.get("MACHINE_DEF", int(index[0])), config.get("MACHINE_DEF", 1)
    if not isinstance(machine, dict):
        return parent, ""
    controller = own.get("COOP_KRC_INDEX") if isinstance(own, dict) else None
    is_own = machine.get("COOP_KRC_INDEX") in (None, 0, controller)
    return parent, str(machine.get("MECH_TYPE", "")).lstrip("#") if is_own else ""
