"""Literals in statements, for the checks of every point."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.krl.text import Assign, Declaration, Move, Pose, Statement


def poses_of(statement: Statement) -> Iterator[Pose]:
    """Yield the pose literals of a motion, an assignment or a declaration."""
    kind = type(statement)
    if kind is Move:
        target = statement.target  # type: ignore[attr-defined]
        if type(target) is Pose:
            yield target
        auxiliary = statement.auxiliary  # type: ignore[attr-defined]
        if type(auxiliary) is Pose:
            yield auxiliary
    elif isinstance(statement, Declaration):
        for variable in statement.variables:
            if isinstance(variable.value, Pose):
                yield variable.value
    elif isinstance(statement, Assign) and isinstance(statement.value, Pose):
        yield statement.value
