"""One difference of two programs, and what still counts as none."""

from __future__ import annotations

from typing import Any

from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class DiffTolerance:
    """What still counts as the same: ``position`` [mm], ``angle`` [deg], ``speed`` share."""

    position_mm: float = 0.001
    angle_deg: float = 0.001
    speed: float = 1e-5


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference; a line is None where the other program has nothing."""

    kind: str
    detail: str
    old_line: int | None
    new_line: int | None
    distance_mm: float | None = None
    angle_deg: float | None = None
    old_file: str = ""
    new_file: str = ""
    position_mm: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    """Old and new target of a moved Cartesian motion, for drawing."""

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        return {
            "kind": self.kind,
            "old_line": self.old_line,
            "new_line": self.new_line,
            "detail": self.detail,
            "distance_mm": None if self.distance_mm is None else round(self.distance_mm, 6),
            "angle_deg": None if self.angle_deg is None else round(self.angle_deg, 6),
            "old_file": self.old_file,
            "new_file": self.new_file,
        }

    def __str__(self) -> str:
        """Return ``OLD:LINE -> NEW:LINE: kind: detail``."""
        old = f"{self.old_file}:{self.old_line}" if self.old_line is not None else "-"
        new = f"{self.new_file}:{self.new_line}" if self.new_line is not None else "-"
        return f"{old} -> {new}: {self.kind}: {self.detail}"
