"""The modules of a program on disk: a file and those beside it that it calls."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from postproc.errors import KrlError, SourceRef
from postproc.krl import Call, Interrupt, KrlModule, Statement, Trigger, parse_module


def load_program(src_path: str | Path) -> tuple[KrlModule, ...]:
    """Return a module and those in the same folder that it calls or that set its frames.

    Raises:
        KrlError: if a file is no KRL; KRL008 if the file has no routine.
    """
    path = Path(src_path)
    main = parse_module(path)
    if not main.routines:
        raise KrlError("KRL008", "no routine to run, expected a .src file", SourceRef(str(path)))
    folder = {
        other.stem.upper(): other
        for other in sorted(path.parent.glob("*"))
        if other.suffix.lower() == ".src" and other.is_file()
    }
    found = {main.name.upper(): main}
    waiting = [main]
    while waiting:
        for name in sorted(called_names(waiting.pop())):
            if name in folder and name not in found:
                found[name] = parse_module(folder[name])
                waiting.append(found[name])
    for name, other in folder.items():
        if name not in found and name.endswith("_SETUP") and _sets_frames(other):
            found[name] = parse_module(other)
    return tuple(found.values())


def called_names(module: KrlModule) -> set[str]:
    """Return the names, in upper case, of all routines that a module calls."""
    names: set[str] = set()
    for routine in module.routines:
        names |= set(_calls(routine.statements))
    return names


def _calls(statements: Iterable[Statement]) -> Iterable[str]:
    for statement in statements:
        if isinstance(statement, Trigger | Interrupt) and statement.action is not None:
            yield from _calls((statement.action,))
        elif isinstance(statement, Call):
            yield statement.name.upper()


def _sets_frames(path: Path) -> bool:
    content = path.read_bytes()
    return b"TOOL_DATA[" in content or b"BASE_DATA[" in content
