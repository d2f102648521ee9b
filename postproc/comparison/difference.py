"""One difference of two programs, what counts as none, and a group: one line of a review."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from postproc.arrays import FloatArray
from postproc.errors import listed
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
    old_line: int | None = None
    new_line: int | None = None
    distance_mm: float | None = None
    angle_deg: float | None = None
    old_file: str = ""
    new_file: str = ""
    position_mm: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    """Old and new target of a moved Cartesian motion, for drawing."""

    @classmethod
    def of(cls, kind: str, detail: str, file: str, line: int | None, *, is_old: bool) -> Difference:
        """Return the difference that something is which only one program has."""
        if is_old:
            return cls(kind, detail, old_line=line, old_file=file)
        return cls(kind, detail, new_line=line, new_file=file)

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


KINDS = ("cell", "order", "removed", "added", "moved", "process", "state", "posture", "spin")
"""Worst first: what changes all motions, then which work is done and where, then how."""
SHOWN = 10
"""So many lines an answer has at most; the JSON document has all."""
NAMED = 4
"""So many objects are named in a line of text; all stand in ``ids``."""


@dataclass(frozen=True, slots=True)
class Group:
    """One line of a review: ``count`` differences of a kind, the objects, the worst of them."""

    kind: str
    count: int
    ids: tuple[str, ...]
    worst: dict[str, Any]
    text: str

    def of_program(self, name: str) -> Group:
        """Return the group with the name of its program, of several."""
        ids = tuple(f"{name} {one}" for one in self.ids)
        worst = (
            {**self.worst, "id": f"{name} {self.worst['id']}"} if "id" in self.worst else self.worst
        )
        return Group(self.kind, self.count, ids, worst, f"{name}: {self.text}")

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        return {**asdict(self), "ids": list(self.ids)}


def group_lines(groups: Sequence[Group], most: int = SHOWN) -> list[str]:
    """Return at most so many lines of text."""
    lines = [f"{group.kind}: {group.text}" for group in groups]
    if len(lines) > most:
        lines[most - 1 :] = [f"and {len(lines) - most + 1} more groups, see --json"]
    return lines


def names(ids: Sequence[str]) -> str:
    """Return the first few of many ids, with what they are said once."""
    return listed([ids[0], *(i.removeprefix("CAM line ") for i in ids[1:])], NAMED)


def tidy(value: float) -> float:
    """Return a number with the digits that count, and no -0."""
    return round(float(value), 4) + 0.0


def xyz(values: FloatArray) -> list[float]:
    """Return the coordinates (3,) as they are told."""
    return [tidy(v) for v in values]


def vector(values: Sequence[float]) -> str:
    """Return coordinates as text."""
    return "(" + ", ".join(f"{v:g}" for v in values) + ")"
