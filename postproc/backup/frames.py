"""Tools and bases of ``$config.dat``: those that are used, with name, kind and load."""

from __future__ import annotations

from postproc.backup.external import old_external_bases
from postproc.backup.variables import Variables, numbers_of
from postproc.records import dataclass

_FRAME = "X Y Z A B C"
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
    line: int
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
    line: int
    parent: str = ""
    system: str = ""

    @property
    def is_fixed(self) -> bool:
        """Whether it is a workpiece frame that stands still in the world."""
        return self.kind != "#TCP" and not self.parent


def tool_entries(config: Variables) -> tuple[ToolEntry, ...]:
    """Return the tools that are used: a frame that is not zero, a name, a kind or a load."""
    found = []
    for number in config.indices("TOOL_DATA"):
        frame = config.parts("TOOL_DATA", _FRAME, number)
        name, kind = config.text("TOOL_NAME", number), str(config.get("TOOL_TYPE", number) or "")
        load = config.get("LOAD_DATA", number)
        mass = numbers_of(load, "M")
        weighed = mass is not None and mass[0] >= 0.0
        is_used = any(frame or ()) or name or kind not in ("", "#NONE") or weighed
        if number < 1 or frame is None or not is_used:
            continue
        entry = ToolEntry(number, name, tuple(frame), kind, _line(config, "TOOL_DATA", number))
        found.append(_with_load(entry, load) if weighed else entry)
    return tuple(found)


def _with_load(tool: ToolEntry, load: dict[str, object]) -> ToolEntry:
    mass = numbers_of(load, "M")
    cog, inertia = numbers_of(load.get("CM"), _FRAME), numbers_of(load.get("J"), "X Y Z")
    return ToolEntry(
        tool.number,
        tool.name,
        tool.frame,
        tool.kind,
        tool.line,
        mass[0] if mass else None,
        tuple(cog) if cog is not None else None,
        tuple(inertia) if inertia is not None and any(inertia) and min(inertia) >= 0.0 else None,
    )


def base_entries(config: Variables) -> tuple[BaseEntry, ...]:
    """Return the bases that are used: a frame that is not zero, a name or a kind."""
    found = []
    for number in config.indices("BASE_DATA"):
        frame = config.parts("BASE_DATA", _FRAME, number)
        name, kind = config.text("BASE_NAME", number), str(config.get("BASE_TYPE", number) or "")
        is_used = any(frame or ()) or name or kind not in ("", "#NONE")
        if number < 1 or frame is None or not is_used:
            continue
        line, parent = _line(config, "BASE_DATA", number), _parent(config, number)
        found.append(BaseEntry(number, name, tuple(frame), kind, line, *parent))
    for index, _, offset in old_external_bases(config):
        system = str(config.get("EX_AX_DATA", index)["EX_KIN"]).lstrip("#")
        line = _line(config, "EX_AX_DATA", index)
        number = _OLD_EXTERNAL + index
        found.append(BaseEntry(number, "", tuple(offset), "#BASE", line, system, system))
    return tuple(found)


def _line(config: Variables, name: str, number: int) -> int:
    return config.source(name, number).line


def _parent(config: Variables, number: int) -> tuple[str, str]:
    """Return name and system of the kinematic that carries a base, empty for the world.

    ``EX_AX_DATA`` of older controllers says nothing of BASE_DATA: they are bases of their own.
    """
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
