"""What two motions are run with: the state of the controller, the CAM line of the comments."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from postproc.arrays import IndexArray
from postproc.controller import Settings, Trace
from postproc.krl import Comment, KrlModule, Move, system_variable

_KINDS = {"$VEL.CP": "speed", "$VEL_AXIS": "speed", "$APO": "approximation"}


class StateDifference(NamedTuple):
    """One variable of the state, or the ``tool``, ``base``, ``load``, and what became of it."""

    name: str
    before: str
    after: str

    @property
    def kind(self) -> str:
        """The kind of ``diff``."""
        plain = self.name.partition("[")[0]
        if plain in ("tool", "base"):
            return plain
        return _KINDS.get(plain) or _KINDS.get(plain.partition(".")[0], "settings")

    def __str__(self) -> str:
        """Return what became of it, with its unit."""
        variable = system_variable(self.name)
        unit = f" {variable.unit}" if variable is not None and variable.unit else ""
        return f"{self.name} {self.before} became {self.after}{unit}"


def state_differences(
    old: Trace, new: Trace, a: Settings, b: Settings, share: float
) -> tuple[StateDifference, ...]:
    """Return all that differs; numbers are the same up to a share of them."""
    return (*_variables(a, b, share), *_frames(old, new, a, b))


def _variables(a: Settings, b: Settings, share: float) -> Iterator[StateDifference]:
    before, after = dict(a.system), dict(b.system)
    found: dict[tuple[str, str, str], list[str]] = {}
    for name in sorted(before.keys() | after.keys()):
        x, y = before.get(name, "unset"), after.get(name, "unset")
        if isinstance(x, float) and isinstance(y, float):
            is_same = abs(x - y) <= share * max(abs(x), abs(y), 1e-12)
        else:
            is_same = x == y
        if not is_same:
            found.setdefault((name.partition("[")[0], _text(x), _text(y)), []).append(name)
    for (plain, x, y), names in found.items():
        yield StateDifference(names[0] if len(names) == 1 else plain, x, y)


def _text(value: float | str) -> str:
    return f"{value:g}" if isinstance(value, float) else value


def _frames(old: Trace, new: Trace, a: Settings, b: Settings) -> Iterator[StateDifference]:
    for name, frames in (("tool", (old.tools, new.tools)), ("base", (old.bases, new.bases))):
        numbers = getattr(a, f"{name}_number"), getattr(b, f"{name}_number")
        if numbers[0] != numbers[1]:
            before, after = (str(n) if n >= 0 else "frame" for n in numbers)
            yield StateDifference(name, before, after)
        elif np.abs(frames[0][getattr(a, name)] - frames[1][getattr(b, name)]).max() > 1e-6:
            yield StateDifference(name, "frame", "another frame")
    loads = a.load_number, b.load_number
    if loads[0] != loads[1] and loads != (a.tool_number, b.tool_number):
        before, after = (str(n) if n >= 0 else "own" for n in loads)
        yield StateDifference("load", before, after)


_CAM_LINE = re.compile(r"CAM line (\d{1,9})\b")


def cam_lines(modules: Sequence[KrlModule], trace: Trace) -> IndexArray:
    """Return the CAM line (m,) of every motion, 0 where no comment names one.

    It stands behind the motion or, of an inline form, on the line before it.
    """
    known: dict[tuple[str, int], int] = {}
    for module in modules:
        for routine in module.routines:
            before = 0
            for statement in routine.statements:
                if isinstance(statement, Comment):
                    before = _named(statement.text) or before
                elif isinstance(statement, Move):
                    known[module.src_path, statement.line] = _named(statement.comment) or before
                    before = 0
    places = zip(trace.file.tolist(), trace.line.tolist(), strict=True)
    found = [known.get((trace.files[file], line), 0) for file, line in places]
    return np.array(found, dtype=np.int64)


def _named(comment: str) -> int:
    match = _CAM_LINE.match(comment.strip())
    return int(match.group(1)) if match else 0
