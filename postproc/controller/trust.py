"""What a program may do unseen: hooks, accepted names, idle statements."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Set

from postproc import krl
from postproc.controller.library import COMMAND_CHANNEL, QUIET, READING, SILENT, is_still

_MAX_DEPTH = 5
"""Calls within calls that are looked into for whether they do nothing."""
_DATA = frozenset({"FDAT_ACT", "PDAT_ACT", "LDAT_ACT", "TOOL_DATA", "BASE_DATA", "LOAD_DATA"})
_JUMPS = ("GOTO", "EXIT", "RETURN", "RESUME")


def is_quiet(statement: krl.Raw) -> bool:
    """Return whether an instruction that is kept as written has nothing to do with motion."""
    return statement.word in QUIET and COMMAND_CHANNEL not in statement.text.upper()


def reading(statement: krl.Raw) -> Iterator[krl.Value | None]:
    """Yield what an instruction that is kept as written may write into."""
    if statement.word in READING:
        _, _, arguments = statement.text.partition("(")
        yield from (krl.Expr(text.strip()) for text in arguments.rstrip(") ").split(","))


class Trust:
    """Tells what needs no following.

    Args:
        hooks: routines of the integrator, in upper case.
        accept: names of what is taken on trust, in upper case.
        resolve: returns the routine that a name calls here, None if it is not in the files.
    """

    def __init__(
        self,
        hooks: Set[str],
        accept: Set[str],
        resolve: Callable[[str], tuple[krl.KrlModule, krl.Routine] | None],
    ) -> None:
        self._hooks, self._accept, self._resolve = hooks, accept, resolve

    def accepts(self, name: str) -> bool:
        """Return whether what has this name is taken on trust, an index aside."""
        name = " ".join(name.upper().split())
        return bool(self._accept) and (
            name in self._accept or name.partition("[")[0] in self._accept
        )

    def is_hook(self, action: krl.Statement) -> bool:
        """Return whether a statement calls the integrator's process, or what is accepted.

        A hook whose lines are in these files has to be idle as well: nobody waits for it here.
        """
        if not isinstance(action, krl.Call):
            return False
        name = action.name.upper()
        if self.accepts(name):
            return True
        return name in self._hooks and (self._resolve(name) is None or self._is_idle_body(name, 0))

    def is_idle(self, statement: krl.Statement, depth: int = 0) -> bool:
        """Return whether a statement neither moves the arm nor changes how it moves."""
        if isinstance(statement, krl.Assign):
            target = statement.target.upper()
            if target.startswith("$"):
                return is_still(target)
            return target.partition("[")[0].partition(".")[0] not in _DATA
        if isinstance(statement, krl.Call):
            return self._is_idle_call(statement.name.upper(), depth)
        if isinstance(statement, krl.Control):
            return statement.word not in _JUMPS
        if isinstance(statement, krl.Raw):
            return is_quiet(statement)
        return not isinstance(statement, krl.Move | krl.SplineBegin | krl.Interrupt | krl.Trigger)

    def assigned(
        self, statements: Iterable[krl.Statement], depth: int = 0
    ) -> Iterator[krl.Value | None]:
        """Yield the variables that statements may write into, as they are written."""
        for statement in statements:
            if isinstance(statement, krl.Assign):
                yield krl.Expr(statement.target)
            elif isinstance(statement, krl.Call):
                name = statement.name.upper()
                found = self._resolve(name)
                if found is not None and depth < _MAX_DEPTH:
                    yield from self.assigned(found[1].statements, depth + 1)
                elif found is not None or name in SILENT:
                    yield from statement.arguments
            elif isinstance(statement, krl.Raw):
                yield from reading(statement)

    def _is_idle_call(self, name: str, depth: int) -> bool:
        if name == "PULSE" or name in SILENT or self.accepts(name):
            return True
        return name not in self._hooks and self._is_idle_body(name, depth)

    def _is_idle_body(self, name: str, depth: int) -> bool:
        found = self._resolve(name)
        return (
            found is not None
            and depth < _MAX_DEPTH
            and all(self.is_idle(item, depth + 1) for item in found[1].statements)
        )
