"""Tools of a CL file: the statements that describe one tool, in any order, put together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from math import isnan
from typing import NamedTuple

import numpy as np

from postproc.arrays import NONE, IntArray
from postproc.model import CamTool, Event
from postproc.readers.apt.statement import Statement
from postproc.readers.changes import tool_changes
from postproc.records import dataclass

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

        Args:
            place: of the statement.
            statement: says it.
            line: of the statement.
            said: number, name and data.
            loads: whether it puts the tool into the spindle; others describe it.
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
        """Find the tool of each call, before ``column`` and ``changes`` are asked.

        Args:
            end: of the file.

        Yields:
            Calls that more than one tool fits, and why; the one called last is taken.
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
            text = call.statement.text
            yield call.place, replace(event, index=call.place.tag, text=text)


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
