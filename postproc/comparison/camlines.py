"""The CAM lines that the comments of a program name."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from postproc.arrays import IndexArray
from postproc.controller import Trace
from postproc.krl import Comment, KrlModule, Move

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
