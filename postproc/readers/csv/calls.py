"""What rows of a point list name: operations, tools and bases."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from postproc.arrays import NONE, IntArray
from postproc.model import CamSetup, CamTool, Event, Operation
from postproc.readers.changes import tool_changes
from postproc.readers.text import Faults, parse_number


def operation_runs(
    names: list[str] | None, line: IntArray
) -> tuple[IntArray, tuple[Operation, ...]]:
    """Return the operation (n,) of each row; an empty name goes on with the one before."""
    n = len(line)
    if names is None:
        return np.full(n, NONE, dtype=np.int32), ()
    runs: list[Operation] = []
    index: list[int] = []
    for name, same in groupby(names):
        if name and not (runs and runs[-1].name == name):
            runs.append(Operation(name, int(line[len(index)])))
        index += [len(runs) - 1] * sum(1 for _ in same)
    return np.array(index, dtype=np.int32), tuple(runs)


def tool_calls(
    names: list[str] | None, line: IntArray, faults: Faults
) -> tuple[IntArray, tuple[CamTool, ...], tuple[Event, ...]]:
    """Return the tool (n,) of each row, the distinct tools, and an event for every change.

    Raises:
        ReadError: CSV033 for a number that no tool can have.
    """
    n = len(line)
    if names is None:
        return np.full(n, NONE, dtype=np.int32), (), ()
    index: dict[tuple[int, str], int] = {}
    tools: list[CamTool] = []
    column = np.full(n, NONE, dtype=np.int32)
    row = 0
    for name, same in groupby(names):
        stop = row + sum(1 for _ in same)
        if name:
            key = _tool_key(name, int(line[row]), faults)
            if key not in index:
                index[key] = len(tools)
                tools.append(CamTool(*key, line=int(line[row])))
            column[row:stop] = index[key]
        row = stop
    return column, tuple(tools), tuple(tool_changes(column, tools, line, with_first=True))


def _tool_key(text: str, line: int, faults: Faults) -> tuple[int, str]:
    """Return number and name of a tool: a text that is no number is a name."""
    number = parse_number(text)
    if number is None:
        return 0, text
    if number < 0.0 or number != round(number):
        raise faults.error("CSV033", "a tool number must be whole", line)
    return int(number), "" if number > 0.0 else text


def setup_calls(
    names: list[str] | None, line: IntArray
) -> tuple[IntArray | None, tuple[CamSetup, ...]]:
    """Return the setup (n,) of each row, None without such a column, and the distinct setups."""
    if names is None:
        return None, ()
    index: dict[str, int] = {}
    setups: list[CamSetup] = []
    for name, at in zip(names, line.tolist(), strict=True):
        if name and name not in index:
            index[name] = len(setups)
            setups.append(CamSetup(name, at))
    column = np.array([index.get(name, NONE) for name in names], dtype=np.int32)
    return column, tuple(setups)
