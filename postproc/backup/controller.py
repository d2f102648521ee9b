"""What a backup says of a controller: arm, limits, tools, bases, home, in KUKA's units."""

from __future__ import annotations

import configparser
import re
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path, PurePosixPath

from postproc.arrays import FloatArray
from postproc.backup.archive import Archive, open_archive
from postproc.backup.external import ExternalKinematic, external_kinematics
from postproc.backup.frames import BaseEntry, ToolEntry, base_entries, tool_entries
from postproc.backup.machine import Machine, machine_of
from postproc.backup.variables import Variables, decoded, matrix, read_variables
from postproc.errors import ReadError, SourceRef
from postproc.records import dataclass

_SOFTWARE = re.compile(r"\bV?(\d{1,2})\.(\d{1,2})(?:\.\d+)*(?:\s*SP\s*\d+)?", re.IGNORECASE)
_CONNECTION = re.compile(r'ConnectionString="([^"]*)"')
_HOMES = ("XHOME", "XHOME1", "XHOME2", "XHOME3", "XHOME4", "XHOME5")

_ASSIGNED = re.compile(
    r"^[^;\"\n]*?\b(TOOL_DATA|BASE_DATA|LOAD_DATA)\s*\[\s*(\w+)\s*\](?:\s*\.\s*\w+)?\s*=(?!=)",
    re.IGNORECASE | re.MULTILINE,
)
_SUFFIXES = (".src", ".sub")


@dataclass(frozen=True, slots=True)
class Controller:
    """One controller.

    Args:
        path: the backup as given by the caller.
        machine: lengths, limits and speeds of the arm.
        tools, bases: what is used, by number.
        homes: name to A1..A6 [deg] of the home positions.
        externals: external kinematics.
        software: such as ``V8.6.5``, empty where nothing says it.
        robot_name, serial: as the controller calls the robot.
        notes: what a person should know of the files.
        rewritten: names of data that programs assign, such as ``TOOL_DATA[11]``.
    """

    path: str
    machine: Machine
    tools: tuple[ToolEntry, ...] = ()
    bases: tuple[BaseEntry, ...] = ()
    homes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    externals: tuple[ExternalKinematic, ...] = ()
    software: str = ""
    robot_name: str = ""
    serial: str = ""
    notes: tuple[str, ...] = ()
    rewritten: tuple[str, ...] = ()

    @property
    def rails(self) -> tuple[ExternalKinematic, ...]:
        """Kinematics that carry the robot and that a cell can have: one or none."""
        found = [e for e in self.externals if e.kind == "rail"]
        return tuple(found) if len(found) == 1 and not found[0].unknown else ()

    @property
    def positioners(self) -> tuple[ExternalKinematic, ...]:
        """Kinematics that turn the workpiece and that a cell can have: one or none.

        It is the only one of the controller, and one on which a base hangs.
        """
        found = [e for e in self.externals if e.kind == "positioner"]
        is_one = len(found) == 1 and not found[0].unknown
        hangs = is_one and any(base.system == found[0].system for base in self.bases)
        return tuple(found) if hangs else ()

    @property
    def root(self) -> tuple[float, ...]:
        """X Y Z A B C [mm, deg] of the robot root in the world with its rail at 0."""
        flanges = [rail.flange for rail in self.rails if rail.flange is not None]
        return flanges[0] if flanges else self.machine.root

    def T_world_base(self, base: BaseEntry) -> FloatArray | None:
        """Return a base in the world with a positioner at 0, None if it cannot be one of a cell.

        The bases of a cell with a positioner turn with it, so those that stand still are none.
        """
        if base.kind == "#TCP":
            return None
        if not self.positioners:
            return None if base.parent else matrix(base.frame)
        (positioner,) = self.positioners
        if base.system != positioner.system or positioner.flange is None:
            return None
        return matrix(positioner.flange) @ matrix(base.frame)

    @property
    def kss(self) -> tuple[int, int] | None:
        """Major and minor number of the system software, None where nothing says it."""
        match = _SOFTWARE.search(self.software)
        return (int(match[1]), int(match[2])) if match else None


def read_backup(path: str | Path) -> Controller:
    """Return what a backup says; BAK001 to BAK007 where it cannot be used."""
    archive = open_archive(path)
    layout = find_files(archive, str(path))
    data = read_variables(archive, layout.machine)
    config = read_variables(archive, layout.config) if layout.config else None
    robcor = read_variables(archive, layout.robcor) if layout.robcor else None
    machine = machine_of(data, robcor)
    info = _archive_info(archive, layout)
    notes = list(machine.notes)
    if config is None:
        notes.append("no R1/System/$config.dat: tools, bases, loads and home are not known")
    last = info.get("lastdisk", "")
    if last.isdecimal() and int(last):
        notes.append(f"one of {int(last) + 1} disks: the others may hold more")
    return Controller(
        path=str(path),
        machine=machine,
        tools=tool_entries(config) if config else (),
        bases=base_entries(config) if config else (),
        homes=_homes(config, data),
        externals=external_kinematics(data, config),
        software=info.get("version", "") or _software(archive, data),
        robot_name=info.get("robname", ""),
        serial=info.get("irserialnr", ""),
        notes=tuple(notes),
        rewritten=rewritten_data(archive, layout),
    )


def _archive_info(archive: Archive, layout: Layout) -> dict[str, str]:
    """Return the keys of am.ini, empty where there is none or it is no INI."""
    if not layout.info:
        return {}
    parser = configparser.RawConfigParser(strict=False, interpolation=None, allow_no_value=True)
    try:
        parser.read_string(decoded(archive.read(layout.info)))
    except (configparser.Error, ValueError):
        return {}
    found = [item for section in parser.sections() for item in parser.items(section)]
    return {key: _line(value) for key, value in found if value}


def _line(text: str) -> str:
    return " ".join(re.sub(r"[^\x20-\x7e\xa0-\uffff]", " ", text).split())[:100]


def _software(archive: Archive, data: Variables) -> str:
    """Return the version from WorkVisual's folder, else from the machine data."""
    for name in archive.names("connections.xml"):
        match = _CONNECTION.search(decoded(archive.read(name)))
        parts = match[1].split(";") if match else []
        for part in parts:
            if re.fullmatch(r"V\d+\.\d+(\.\d+)*", part):  # beside host names: never copied
                return part
    _, _, version = data.text("$V_R1MADA").rpartition("/KUKA")
    return f"V{version}" if re.fullmatch(r"\d+\.\d+(\.\d+)*", version) else ""


def _homes(config: Variables | None, data: Variables) -> dict[str, tuple[float, ...]]:
    keys = "A1 A2 A3 A4 A5 A6"
    found: dict[str, tuple[float, ...]] = {}
    for name in _HOMES:
        angles = config.parts(name, keys) if config else None
        if angles is not None:
            found[name] = tuple(angles)
    angles = data.parts("$H_POS", keys)
    if angles is not None and any(angles):
        found["$H_POS"] = tuple(angles)
    return found


def rewritten_data(archive: Archive, layout: Layout) -> tuple[str, ...]:
    """Return the data that some program assigns: ``TOOL_DATA[11]``, ``BASE_DATA[any]``.

    Files too large or broken are left out: they only serve a remark.
    """
    root = f"{layout.root}/".lower()
    found: set[tuple[str, int]] = set()
    for name in archive.sizes:
        if not (name.lower().startswith(root) and name.lower().endswith(_SUFFIXES)):
            continue
        try:
            text = decoded(archive.read(name))
        except ReadError:
            continue
        for match in _ASSIGNED.finditer(text):
            index = int(match[2]) if match[2].isdigit() and len(match[2]) < 4 else 0
            found.add((match[1].upper(), index))
    return tuple(f"{name}[{index or 'any'}]" for name, index in sorted(found))


@dataclass(frozen=True, slots=True)
class Layout:
    """Paths in the archive; empty for what is not there. ``root``: the folder R1."""

    machine: str
    config: str
    robcor: str
    info: str
    root: str


def find_files(archive: Archive, path: str) -> Layout:
    """Return where the robot's files are; BAK006 for no robot or several."""
    found = archive.names("R1", "Mada", "$machine.dat") or _of_bare_folder(archive)
    if len(found) != 1:
        raise ReadError("BAK006", *_wrong_count(archive, found, path))
    root = PurePosixPath(found[0]).parents[1]
    return Layout(
        machine=found[0],
        config=_inside(archive, root, "System", "$config.dat"),
        robcor=_inside(archive, root, "Mada", "$robcor.dat"),
        info=next(iter(sorted(archive.names("am.ini"), key=len)), ""),
        root=root.as_posix(),
    )


def _of_bare_folder(archive: Archive) -> list[str]:
    """Return machine data of an R1 whose folder has another name, those of STEU left aside."""
    return [
        name
        for name in archive.names("Mada", "$machine.dat")
        if "steu" not in [part.lower() for part in PurePosixPath(name).parts]
    ]


def _inside(archive: Archive, root: PurePosixPath, *tail: str) -> str:
    wanted = str(root.joinpath(*tail)).lower()
    return next((name for name in archive.names(*tail) if name.lower() == wanted), "")


def _wrong_count(archive: Archive, found: list[str], path: str) -> tuple[str, SourceRef, str]:
    source = SourceRef(path)
    if found:
        text = f"{len(found)} robots in it, expected one: {', '.join(sorted(found)[:5])}"
        return text, source, "give the folder of one of them"
    inner = [name for name in archive.sizes if name.lower().endswith(".zip")]
    hint = f"it holds the archive {inner[0]}: give that one" if inner else ""
    text = "no R1/Mada/$machine.dat in it, expected the backup of a KRC controller"
    return text, source, hint or "an archive of the controller, a KrcDiag, or the folder R1"
