"""What was edited: pins of tags and frames of bases, as the files that ``convert`` takes."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

from postproc.cell import base_location, edited_cell, load_cell
from postproc.files import read_bytes
from postproc.records import dataclass

Frame = tuple[tuple[float, ...], tuple[float, ...]]
"""``xyz_mm`` and ``abc_deg`` of a base in the robot root."""


@dataclass(frozen=True, slots=True)
class Edits:
    """All that differs from the files given: tag to spin [deg], place of a base to its frame."""

    pins: Mapping[str, float] = field(default_factory=dict)
    frames: Mapping[int, Frame] = field(default_factory=dict)

    def pinned(self, tag: str, spin_deg: float | None) -> Edits:
        """Return the edits with a tag pinned to a spin [deg], or with ``None`` not any more."""
        others = {name: spin for name, spin in self.pins.items() if name != tag}
        return replace(self, pins=others if spin_deg is None else {**others, tag: spin_deg})

    def moved(self, base: int, xyz_mm: Sequence[float], abc_deg: Sequence[float]) -> Edits:
        """Return the edits with a base at another place."""
        frame = tuple(map(float, xyz_mm)), tuple(map(float, abc_deg))
        return replace(self, frames={**self.frames, base: frame})

    def pins_csv(self) -> bytes:
        """Return the pins as ``convert --pins`` reads them."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["tag", "spin_deg"])
        writer.writerows([name, f"{spin:z.6g}"] for name, spin in self.pins.items())
        return stream.getvalue().encode()

    def cell_toml(self, path: Path) -> bytes:
        """Return the cell file with the frames that were edited, as it stands at ``moved_file``.

        Raises:
            CellError: as ``load_cell``.
            ReadError: if the file is missing or unreadable.
        """
        if not self.frames:
            return read_bytes(path)
        cell = load_cell(path)
        changes = {
            (*base_location(cell, base), "frame", key): list(values)
            for base, frame in sorted(self.frames.items())
            for key, values in zip(("xyz_mm", "abc_deg"), frame, strict=True)
        }
        return edited_cell(cell, changes, moved_file(path, self))


def moved_file(cell: Path, edits: Edits) -> Path:
    """Return where the cell with these edits stands: beside the one given, or that one itself."""
    return cell.with_name(f"{cell.stem}.moved.toml") if edits.frames else cell


def pins_file(cell: Path, source: Path) -> Path:
    """Return where the pins of an input stand: beside the cell."""
    return cell.with_name(f"{source.stem}.pins.csv")
