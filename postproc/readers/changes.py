"""Changes of the tool, as events: they follow from which tool each tag has, whatever the format."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.model import CamTool, Event, EventKind


def tool_changes(
    tool: AnyIntArray, tools: Sequence[CamTool], line: AnyIntArray, *, with_first: bool
) -> list[Event]:
    """Return an event wherever another tool works than before.

    Args:
        tool: (n,) indices into ``tools``, -1 where none is called: the one before stays.
        tools: distinct tools.
        line: (n,) where the tool is called.
        with_first: whether the first tool is changed to, too; else it is in the spindle already.

    Returns:
        Events in order, with number and name of the tool.
    """
    called = np.flatnonzero(tool >= 0)
    changed = called[np.diff(tool[called], prepend=-1) != 0]
    return [
        Event(i, EventKind.TOOL_CHANGE, float(new.number), new.name, int(line[i]))
        for i in changed[0 if with_first else 1 :].tolist()
        for new in [tools[tool[i]]]
    ]
