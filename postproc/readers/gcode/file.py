"""G-code of machining centres to a toolpath: the program is run, with its sub-programs.

The tool axis is +z of the coordinates that hold, or that of the head that the cell names. What
moves the machine tool alone (reference positions, tool lengths) is not driven and said; what
changes the path and is not carried out is refused by its code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from postproc.errors import UsageError
from postproc.model import Arcs, ToolPath
from postproc.readers.base import ReadOptions
from postproc.readers.gcode.blocks import block_of
from postproc.readers.gcode.execute import execute
from postproc.readers.gcode.state import Machine, Tag
from postproc.readers.text import Faults, text_blocks
from postproc.records import dataclass

_MOST_CALLED = 500_000
"""So many blocks more than the file has are run at most, those of sub-programs each time."""
_DEEPEST = 10
"""Calls within calls: LinuxCNC's limit; Fanuc has 4 (10 on the 30i)."""
DIALECTS = ("fanuc", "linuxcnc")
_LINUXCNC = ("linuxcnc", "pathpilot", "freecad", "grbl")
_WHOLE = ("kind", "line", "operation", "tool", "arc", "cycle")
_MOST_REPEATS = 9999
"""As many as P or L can say on a Fanuc control."""


@dataclass(frozen=True, slots=True)
class _Call:
    """A sub-program at work: where it begins, how often it is still to run, where it returns."""

    first: int
    left: int
    back: int


def read_file(path: str, options: ReadOptions) -> ToolPath:
    """Return the toolpath of a G-code program; errors have a ``GCD`` code."""
    faults = Faults(path, options.recover)
    lines = _lines(path)
    if options.dialect not in (None, *DIALECTS):
        known = ", ".join(DIALECTS)
        raise UsageError("GCD017", f"no G-code dialect {options.dialect!r}, known are {known}")
    dialect = options.dialect or _dialect(path, lines)
    machine = Machine(options, faults, dialect)
    _run(machine, lines)
    return _toolpath(machine, path)


def _lines(path: str) -> list[str]:
    lines: list[str] = []
    for block in text_blocks(path):
        lines += block.data.decode("latin-1").split("\n")[:-1]
    return lines


def _dialect(path: str, lines: list[str]) -> str:
    head = "\n".join(lines[:30]).lower()
    is_linuxcnc = path.lower().endswith(".ngc") or any(name in head for name in _LINUXCNC)
    return "linuxcnc" if is_linuxcnc else "fanuc"


def _run(machine: Machine, lines: list[str]) -> None:
    faults, at, calls = machine.faults, 0, list[_Call]()
    programs: dict[int, int] | None = None
    for _ in range(len(lines) + _MOST_CALLED):
        if machine.ended or at >= len(lines):
            break
        block = machine.block = block_of(lines[at], at + 1, faults)
        machine.line = block.line
        at += 1
        if not block.words:
            machine.remark = block.comment or machine.remark
            continue
        codes = {word.code for word in block.words}
        if "M98" in codes:
            programs = _programs(lines) if programs is None else programs
            if len(calls) >= _DEEPEST:
                raise faults.error("GCD008", f"calls more than {_DEEPEST} deep", block.line)
            calls.append(_called(machine, programs, at))
            at = calls[-1].first
        elif "M99" in codes:
            if not calls:
                machine.ended = True
            elif calls[-1].left > 1:
                calls[-1] = _Call(calls[-1].first, calls[-1].left - 1, calls[-1].back)
                at = calls[-1].first
            else:
                at = calls.pop().back
        else:
            execute(machine)
    else:
        text = f"calls run more than {_MOST_CALLED} blocks beyond those of the file"
        raise faults.error("GCD008", text, len(lines))
    last = next((line for line in reversed(lines) if line.strip()), "")
    if calls or not (machine.ended or last.strip() == "%"):
        text = "the file ends without M30 or M2, it may be cut off"
        faults.fix("GCD009", text, "it is taken as complete", len(lines))


def _programs(lines: list[str]) -> dict[int, int]:
    """Return the index of the line behind each program number O."""
    found: dict[int, int] = {}
    for index, line in enumerate(lines):
        text = line.strip().upper()
        text = f"O{text[1:]}" if text.startswith(":") else text
        digits = text[1:5].split("(")[0].strip() if text.startswith("O") else ""
        if digits.isdigit():
            found.setdefault(int(digits), index + 1)
    return found


def _called(machine: Machine, programs: dict[int, int], back: int) -> _Call:
    """Return the call of M98: P1234 L2, or P21234 of older controls."""
    said = {word.letter: word.value for word in machine.block.words}
    number, repeats = int(said.get("P", -1.0)), int(said.get("L", said.get("K", 1.0)))
    if number not in programs and number > _MOST_REPEATS:
        repeats, number = divmod(number, 10_000)
    if number not in programs:
        text = f"no sub-program O{number} in this file" if number >= 0 else "M98 without its P"
        raise machine.error("GCD007", text)
    if {"X", "Y", "Z"} & said.keys() or not 1 <= repeats <= _MOST_REPEATS:
        raise machine.error("GCD007", "M98 with a motion or a wrong count")
    return _Call(programs[number], repeats, back)


def _toolpath(machine: Machine, path: str) -> ToolPath:
    arcs, n = machine.arcs, len(machine.tags)
    columns = {name: [getattr(tag, name) for tag in machine.tags] for name in Tag._fields}
    whole: dict[str, Any] = {name: np.array(columns[name], dtype=np.int32) for name in _WHOLE}
    inch = machine.modes.units in ("G20", "G70") or machine.options.units == "inch"
    return ToolPath(
        path=path,
        name=Path(path).stem,
        format="gcode",
        dialect=machine.dialect,
        units="inch" if inch else "mm",
        points=np.array(columns["point"]).reshape(n, 3),
        axes=np.array(columns["axis"]).reshape(n, 3),
        feed=np.array(columns["feed"], dtype=np.float64),
        **whole,
        operations=tuple(machine.operations),
        tools=tuple(machine.tools),
        arcs=Arcs(*map(np.array, zip(*arcs, strict=True))) if arcs else Arcs.none(),
        cycles=tuple(machine.cycles),
        events=tuple(machine.events),
        setup=np.array(columns["setup"], dtype=np.int32) if machine.setups else None,
        setups=tuple(machine.setups),
        largest_blend=np.array(columns["blend"], dtype=np.float64),
        word_uses=machine.uses.all(),
        unknown_words={use.word: len(use.lines) for use in machine.uses.all() if use.refused},
        warnings=machine.faults.warnings,
        recovered=machine.faults.fixes,
    )
