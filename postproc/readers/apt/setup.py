"""What takes several lines of a CL file: coordinate systems, and statements of one tool."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from math import isnan
from typing import NamedTuple

import numpy as np

from postproc.arrays import NONE, FloatArray, IntArray
from postproc.geometry import orthonormalised
from postproc.model import CamSetup, CamTool, Event
from postproc.readers.apt.statement import Statement, bounded
from postproc.readers.base import tool_changes
from postproc.readers.text import Faults
from postproc.records import dataclass

AXIS_NORM_GAP = 1e-3
"""How far the length of a unit vector in a file may be from one."""
ROW = 4
"""Numbers in a row of a 3x4 matrix."""
_TILT_GAP = 1e-4


def rotation(R: FloatArray, faults: Faults, line: int, text: str = "") -> FloatArray:
    """Return the nearest rotation of a matrix that is one up to rounding, else raise APT063."""
    if float(np.abs(R.T @ R - np.eye(3)).max()) > AXIS_NORM_GAP or np.linalg.det(R) < 0.0:
        message = "axes that are not at right angles, not of length 1 or left-handed"
        raise faults.error("APT063", message, line, text)
    return R if np.array_equal(R.T @ R, np.eye(3)) else orthonormalised(R)


class TiltedTable:
    """The setup plane of CAMWorks: ROTABL by ROTABL, begun anew by TLAXIS or a feature's start.

    A feature may end without undoing its angles, so each start counts from the untilted table.
    """

    def __init__(self) -> None:
        self.R: FloatArray = np.eye(3)
        self.tilt_axis: FloatArray | None = None
        self._line = 0

    @property
    def is_moving(self) -> bool:
        """Whether ROTABL came since the tilt was last checked."""
        return self._line > 0

    def reset(self) -> bool:
        """Begin a feature with the table untilted; return whether it was tilted."""
        was_tilted = not np.array_equal(self.R, np.eye(3))
        self.R = np.eye(3)
        return was_tilted

    def rotate(self, R: FloatArray, line: int) -> None:
        """Tilt further."""
        self.R = self.R @ R
        if np.allclose(self.R, np.eye(3), atol=AXIS_NORM_GAP * 1e-3):
            self.R = np.eye(3)
        self._line = line

    def check(self, faults: Faults) -> None:
        """Compare the tilt with TLAXIS before points are taken."""
        if self.tilt_axis is not None and not np.array_equal(self.R, np.eye(3)):
            gap = float(np.linalg.norm(self.R[:, 2] - self.tilt_axis))
            if gap > _TILT_GAP:
                text = "ROTABL and TLAXIS do not give the same tool axis"
                raise faults.error("APT061", text, self._line)
        self._line = 0


class SetupTable:
    """Distinct setups of a file, and from which line on each holds."""

    def __init__(self) -> None:
        self.setups: list[CamSetup] = []
        self._lines: list[int] = []
        self._calls: list[int] = []

    def call(self, setup: CamSetup) -> CamSetup:
        """Let a setup hold from its line on; return it as it was first seen."""
        same = [known.name == setup.name and _is_same(known, setup) for known in self.setups]
        index = same.index(True) if any(same) else len(self.setups)
        if index == len(self.setups):
            self.setups.append(setup)
        self._lines.append(setup.line)
        self._calls.append(index)
        return self.setups[index]

    def place(
        self, word: str, line: int, R: FloatArray, t: FloatArray, *, carried: bool, name: str = ""
    ) -> None:
        """Let a setup hold that the file places by ``p_part = R p_setup + t`` [m].

        One without a name is numbered among the places that the word gives it: ``MSYS_1``,
        ``MSYS_2``; a cell may call it ``MCS_2`` or ``2`` as well.
        """
        matrix = np.column_stack([R, t]) + 0.0
        setup = CamSetup(name, line, tuple(map(tuple, matrix.tolist())), carried)
        if not name:
            own = [known for known in self.setups if known.name.startswith(f"{word}_")]
            same = next((known for known in own if _is_same(known, setup)), None)
            number = f"{len(own) + 1}"
            name, aliases = f"{word}_{number}", (f"MCS_{number}", number)
            setup = same or replace(setup, name=name, aliases=aliases)
        self.call(replace(setup, line=line))

    def column(self, line: IntArray) -> IntArray | None:
        """Return the setup (n,) that holds at lines (n,), -1 before the first; None without any."""
        if not self.setups:
            return None
        calls = np.array([-1, *self._calls], dtype=np.int32)
        column: IntArray = calls[np.searchsorted(self._lines, line, side="right")]
        return column


def _is_same(a: CamSetup, b: CamSetup) -> bool:
    """Return whether two setups lie at one place, as far as the file says where."""
    if a.matrix is None or b.matrix is None:
        return a.matrix is b.matrix
    return a.carried == b.carried and np.allclose(a.matrix, b.matrix, rtol=0.0, atol=1e-9)


class MatrixComment:
    """CATIA's ``$$*CATIA0`` comment: a name line, then three comment rows of a 3x4 matrix."""

    def __init__(self) -> None:
        self._line = 0
        self._rows: list[list[float]] = []
        self.name = ""
        """What stands in front of the rows."""

    @property
    def is_open(self) -> bool:
        """Whether rows are still to come."""
        return self._line > 0

    def begin(self, line: int) -> None:
        """Begin at a ``$$*CATIA0`` line."""
        self._line, self._rows, self.name = line, [], ""

    def row(self, text: str, faults: Faults) -> tuple[FloatArray, FloatArray] | None:
        """Take a comment line; the third row of numbers gives rotation and origin, as written."""
        numbers = [bounded(part) for part in text.replace(",", " ").split()]
        if len(numbers) != ROW or None in numbers:
            self.name = self.name or text.strip()
            return None
        self._rows.append([float(v) for v in numbers if v is not None])
        if len(self._rows) < 3:
            return None
        matrix = np.array(self._rows)
        line, self._line = self._line, 0
        return rotation(matrix[:, :3], faults, line), matrix[:, 3]

    def check_closed(self, faults: Faults) -> None:
        """Complain if a statement comes before the third row."""
        if self._line:
            text = "$$*CATIA0 is not followed by a 3x4 matrix in comments"
            raise faults.error("APT064", text, self._line)


NO_NUMBER = 0
_NAMES = ("number", "name")
_DATA = ("diameter", "corner_radius", "length")
Said = Mapping[str, float | str]
"""What a file says of a tool: fields of ``CamTool``."""


class Place(NamedTuple):
    """How many tags, splines and events of the file stand before a statement."""

    tag: int
    spline: int
    event: int

    def moves_to(self, later: Place) -> bool:
        """Return whether a motion stands between this place and a later one."""
        return (self.tag, self.spline) != (later.tag, later.spline)


@dataclass(slots=True)
class ToolCall:
    """What the statements between two motions say of one tool.

    ``line``: of the first of them; ``place``, ``statement``, ``at``: of the one that loads the
    tool, with its line, else of the first.
    """

    place: Place
    statement: Statement
    at: int
    line: int
    said: dict[str, float | str] = field(default_factory=dict)
    loads: bool = False


@dataclass(slots=True)
class ToolTable:
    """Distinct tools, and where in the file each of them is called.

    Statements about a tool (number, name, cutter data) that stand between the same two motions
    describe one tool. Tools that differ in number, name or data are different tools. A call that
    says less means the tool at work if that is as it says, else the one that it names or numbers.
    """

    tools: list[CamTool] = field(default_factory=list)
    calls: list[ToolCall] = field(default_factory=list)
    lengths: dict[float | str, tuple[float, int]] = field(default_factory=dict)
    """LENGTH of a tool number or name where it was first given, in units of the file, and the
    line."""
    _column: list[int] = field(default_factory=list)
    """Tool of each call, an index into ``tools``."""

    def update(
        self, place: Place, statement: Statement, line: int, said: Said, *, loads: bool
    ) -> None:
        """Begin the tool that works from a place on, or complete it.

        ``loads``: whether the statement puts the tool into the spindle; others describe it.
        """
        said = {key: value for key, value in said.items() if value not in ("", None)}
        if not said:
            return
        call = self.calls[-1] if self.calls else None
        if call is None or call.place.moves_to(place):
            call = ToolCall(place, statement, line, line)
            self.calls.append(call)
        elif any(
            call.said.get(key, value) != value for key, value in said.items() if key in _NAMES
        ):
            # the tool before was never moved; what follows its number may be of the next one
            kept = {} if "name" in said else _behind("number", call.said)
            call = self.calls[-1] = ToolCall(place, statement, line, line, kept)
        if loads and not call.loads:
            call.place, call.statement, call.at, call.loads = place, statement, line, True
        for key, value in said.items():
            call.said.pop(key, None)
            call.said[key] = value

    @property
    def diameter(self) -> float:
        """Diameter [m] of the tool in force, NaN if not given."""
        return float(self.calls[-1].said.get("diameter", "nan")) if self.calls else float("nan")

    def settle(self, end: Place) -> Iterator[tuple[ToolCall, str]]:
        """Find the tool of each call up to the end, and yield those that several fit, and why.

        It comes before ``column`` and ``changes``; of several, the one called last is taken.
        """
        if self.calls and not self.calls[-1].loads and not self.calls[-1].place.moves_to(end):
            self.calls.pop()
        for call in self.calls:
            current = self._column[-1] if self._column else NONE
            fits = [i for i in range(len(self.tools)) if self._fits(i, call.said, current)]
            if not fits:
                self._column.append(len(self.tools))
                self.tools.append(self._new(call, current))
                continue
            index = current if current in fits else fits[-1]
            if index != current and len(fits) > 1:
                yield call, f"{len(fits)} tools of the file are meant by it as much as each other"
            self._column.append(index)
            self.tools[index] = _completed(self.tools[index], call.said)

    def _fits(self, index: int, said: Said, current: int) -> bool:
        """Return whether a call may mean a tool that was called before."""
        tool = self.tools[index]
        if not all(_agree(getattr(tool, key), said[key]) for key in _DATA if key in said):
            return False
        if index == current:
            return all(getattr(tool, key) == said.get(key, getattr(tool, key)) for key in _NAMES)
        if "name" in said:
            return tool.name == said["name"] and tool.number == said.get("number", tool.number)
        number = said.get("number", self._number(current))
        # cutter data alone, or no number, bring no tool back that has a name
        return tool.number == number and (not tool.name or bool(said.get("number")))

    def _new(self, call: ToolCall, current: int) -> CamTool:
        number = NO_NUMBER if "name" in call.said else self._number(current)
        return CamTool(**{"number": number, **call.said, "line": call.line})  # type: ignore[arg-type]

    def _number(self, index: int) -> int:
        return self.tools[index].number if index >= 0 else NO_NUMBER

    def column(self, n: int) -> IntArray:
        """Return the tool (n,) in force at each of n tags, -1 before the first."""
        counts = np.diff(np.array([0, *(call.place.tag for call in self.calls), n]))
        return np.repeat(np.array([NONE, *self._column], dtype=np.int32), counts)

    def of_spline(self, number: int, tag: int) -> int:
        """Return the tool of a spline, the ``number``-th of the file, before a tag."""
        place = (tag, number)
        behind = sum((call.place.tag, call.place.spline) <= place for call in self.calls)
        return self._column[behind - 1] if behind else NONE

    def changes(self) -> Iterator[tuple[Place, Event]]:
        """Yield the changes of the tool; the first tool of a file is changed to if it is loaded."""
        if not self.calls:
            return
        lines = np.array([call.at for call in self.calls])
        with_first = self.calls[0].loads
        for event in tool_changes(np.array(self._column), self.tools, lines, with_first=with_first):
            call = self.calls[event.index]
            yield call.place, replace(event, index=call.place.tag, text=call.statement.text)


def _behind(key: str, said: Said) -> dict[str, float | str]:
    """Return what was said after ``key`` was."""
    keys = [*said]
    return {later: said[later] for later in keys[keys.index(key) + 1 :]}


def _agree(known: float, said: float | str) -> bool:
    return isnan(known) or known == said


def _completed(tool: CamTool, said: Said) -> CamTool:
    """Return a tool with the data that were not known of it before."""
    known = dict(zip(_DATA, (tool.diameter, tool.corner_radius, tool.length), strict=True))
    added = {key: said[key] for key in _DATA if key in said and isnan(known[key])}
    return replace(tool, **added)  # type: ignore[arg-type]
