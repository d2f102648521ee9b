"""Tools of a CL file: the statements that describe one tool, in any order, put together."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import isnan

import numpy as np

from postproc.arrays import IntArray
from postproc.model import CamTool

NO_NUMBER = 0


@dataclass(slots=True)
class ToolTable:
    """Distinct tools, and from which tag on each is in the spindle.

    Statements about a tool (number, cutter data, name) that stand between the same two motions
    describe one tool; a number seen before brings back what was said about it then.
    """

    tools: list[CamTool] = field(default_factory=list)
    _tags: list[int] = field(default_factory=list)
    _calls: list[CamTool] = field(default_factory=list)
    number: int = NO_NUMBER
    loaded: bool = False
    lengths: dict[int, tuple[float, int]] = field(default_factory=dict)
    """LENGTH of a tool number where it was first given, in units of the file, and the line."""

    def update(self, tag: int, line: int, **data: float | str | int) -> CamTool:
        """Begin the tool that works from ``tag`` on, or complete it."""
        if not self._tags or self._tags[-1] != tag:
            self._tags.append(tag)
            self._calls.append(CamTool(NO_NUMBER, line=line))
        changes = {name: value for name, value in data.items() if value not in ("", None)}
        tool = replace(self._calls[-1], **changes)  # type: ignore[arg-type]
        self._calls[-1] = tool
        return tool

    @property
    def diameter(self) -> float:
        """Diameter [m] of the tool in force, NaN if not given."""
        return self._calls[-1].diameter if self._calls else float("nan")

    def column(self, n: int) -> IntArray:
        """Return the tool (n,) in force at each of n tags, -1 before the first; fills ``tools``."""
        indices: list[int] = []
        for call in self._calls:
            indices.append(self._index(call, indices[-1] if indices else -1))
        counts = np.diff(np.array([0, *self._tags, n]))
        return np.repeat(np.array([-1, *indices], dtype=np.int32), counts)

    def _index(self, call: CamTool, current: int) -> int:
        if call.number == NO_NUMBER:
            call = replace(call, number=self._number_of(call, current))
        for i, tool in enumerate(self.tools):
            if _is_same(tool, call):
                self.tools[i] = _completed(tool, call)
                return i
        self.tools.append(call)
        return len(self.tools) - 1

    def _number_of(self, call: CamTool, current: int) -> int:
        """Return the number of a tool that is only described: that of the same name, else kept."""
        named = [tool for tool in reversed(self.tools) if call.name and tool.name == call.name]
        if named:
            return named[0].number
        return self.tools[current].number if current >= 0 and not call.name else NO_NUMBER


def _is_same(tool: CamTool, call: CamTool) -> bool:
    if tool.number != call.number:
        return False
    if call.number == NO_NUMBER and call.name != tool.name:
        return False
    pairs = ((tool.diameter, call.diameter), (tool.corner_radius, call.corner_radius))
    return all(isnan(a) or isnan(b) or a == b for a, b in pairs)


def _completed(tool: CamTool, call: CamTool) -> CamTool:
    return replace(
        tool,
        name=tool.name or call.name,
        diameter=call.diameter if isnan(tool.diameter) else tool.diameter,
        corner_radius=call.corner_radius if isnan(tool.corner_radius) else tool.corner_radius,
        length=call.length if isnan(tool.length) else tool.length,
    )
