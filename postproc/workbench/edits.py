"""What was edited: pins of tags and places of parts, tools, fixtures, as ``convert`` takes them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import (
    Cell,
    cell_changes,
    edited_cell,
    frame_document,
    load_cell,
    parse_cell,
    refitted,
)
from postproc.files import read_bytes
from postproc.geometry import inverse, transform_from_kuka
from postproc.kinematics import build
from postproc.records import dataclass
from postproc.toml import Location

PART, TOOL, FIXTURE = "part", "tool", "fixture"
KINDS = (PART, TOOL, FIXTURE)
"""What can be moved: the frame of a base in the robot root, a tool on the flange by its TCP, an
obstacle in the world."""
Thing = tuple[str, int]
"""A kind and a place in the cell."""
Frame = tuple[tuple[float, ...], tuple[float, ...]]
"""``xyz_mm`` and ``abc_deg``."""


@dataclass(frozen=True, slots=True)
class Edits:
    """All that differs from the files given: tag to spin [deg], things to their frames.

    ``keys``: of the cell file, changed before things were moved.
    """

    pins: Mapping[str, float] = field(default_factory=dict)
    frames: Mapping[Thing, Frame] = field(default_factory=dict)
    keys: Mapping[Location, object] = field(default_factory=dict)

    @property
    def of_cell(self) -> bool:
        """Whether the cell file differs."""
        return bool(self.frames or self.keys)

    def cured(self, path: Path, changes: Mapping[Location, object]) -> Edits:
        """Return the edits with keys of the cell file changed, whatever is moved now."""
        return replace(self, frames={}, keys={**self._changes(path), **changes})

    def _changes(self, path: Path) -> dict[Location, object]:
        """Return what differs in the cell file."""
        cell = load_cell(path)
        before = parse_cell(edited_cell(cell, self.keys, path), path) if self.keys else cell
        there = before
        for thing, (xyz, abc) in sorted(self.frames.items()):
            there = placed(there, thing, transform_from_kuka(xyz, abc))
        return {**self.keys, **cell_changes(before, there)}

    def pinned(self, tag: str, spin_deg: float | None) -> Edits:
        """Return the edits with a tag pinned to a spin [deg], or with ``None`` not any more."""
        others = {name: spin for name, spin in self.pins.items() if name != tag}
        return replace(self, pins=others if spin_deg is None else {**others, tag: spin_deg})

    def moved(self, thing: Thing, xyz_mm: Sequence[float], abc_deg: Sequence[float]) -> Edits:
        """Return the edits with a thing at another place."""
        frame = tuple(map(float, xyz_mm)), tuple(map(float, abc_deg))
        return replace(self, frames={**self.frames, thing: frame})

    def pins_csv(self) -> bytes:
        """Return the pins as ``convert --pins`` reads them."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["tag", "spin_deg"])
        writer.writerows([name, f"{spin:z.6g}"] for name, spin in self.pins.items())
        return stream.getvalue().encode()

    def cell_toml(self, path: Path) -> bytes:
        """Return the cell file with the places that were edited, as it stands at ``moved_file``."""
        if not self.of_cell:
            return read_bytes(path)
        return edited_cell(load_cell(path), self._changes(path), moved_file(path, self))


def things(cell: Cell) -> dict[Thing, str]:
    """Return what can be moved of a cell, with its name."""
    found = {(PART, k): f"base {base.number} {base.name}" for k, base in enumerate(cell.bases)}
    found |= {(TOOL, k): f"tool {tool.number} {tool.name}" for k, tool in enumerate(cell.tools)}
    return found | {(FIXTURE, k): solid.name for k, solid in enumerate(cell.obstacles)}


def frame_of(cell: Cell, thing: Thing) -> dict[str, list[float]]:
    """Return the frame of a thing as the cell file has it."""
    kind, k = thing
    if kind == PART:
        return frame_document(cell.bases[k].T_robroot_base)
    is_tool = kind == TOOL
    return frame_document(cell.tools[k].T_flange_tcp if is_tool else cell.obstacles[k].T_owner_mesh)


def carrier_of(cell: Cell, thing: Thing) -> FloatArray:
    """Return where (4, 4) this frame counts from: of a tool in the last link, else in the world."""
    if thing[0] == TOOL:
        arm = build(cell.robot)
        zero = np.zeros(6)
        return np.asarray(inverse(arm.link_frames(zero)[-1]) @ arm.fk(zero))
    return np.asarray(cell.robot.T_world_robroot if thing[0] == PART else np.eye(4))


def placed(cell: Cell, thing: Thing, T: FloatArray) -> Cell:
    """Return a cell with a thing at a frame (4, 4); a tool takes its solids with it."""
    kind, k = thing
    if kind == PART:
        bases = list(cell.bases)
        bases[k] = replace(bases[k], T_robroot_base=T)
        return replace(cell, bases=tuple(bases))
    if kind == FIXTURE:
        solids = list(cell.obstacles)
        solids[k] = replace(solids[k], T_owner_mesh=T)
        return replace(cell, obstacles=tuple(solids))
    tools = list(cell.tools)
    D = T @ inverse(tools[k].T_flange_tcp)
    meshes = tuple(replace(solid, T_owner_mesh=D @ solid.T_owner_mesh) for solid in tools[k].meshes)
    moved = replace(tools[k], T_flange_tcp=T, meshes=meshes)
    axis = moved.known_axis
    tools[k] = moved if axis is None else refitted(moved, T, axis)
    return replace(cell, tools=tuple(tools))


def moved_file(cell: Path, edits: Edits) -> Path:
    """Return where the cell with these edits stands: beside the one given, or that one itself."""
    return cell.with_name(f"{cell.stem}.moved.toml") if edits.of_cell else cell


def pins_file(cell: Path, source: Path) -> Path:
    """Return where the pins of an input stand: beside the cell."""
    return cell.with_name(f"{source.stem}.pins.csv")
