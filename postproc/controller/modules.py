"""The modules of a program on disk: a file and those beside it that it calls."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import field
from pathlib import Path

from postproc.errors import KrlError, SourceRef
from postproc.krl import Call, Interrupt, KrlModule, Statement, Trigger, parse_module, require_sound
from postproc.records import dataclass

_ROOT = "R1"
"""Folder of a controller below which every module is known by its name."""
_OF_THE_MAKER = frozenset({"SYSTEM", "TP", "MADA"})
"""Folders in it whose routines are not the user's; those of the forms are followed anyway."""
_CONFIG = "$CONFIG.DAT"
"""List of what is global on a controller: frames, the data of its home position."""
_GLOBAL = re.compile(
    rb"^[ \t]*GLOBAL[ \t]+DEF(?:FCT[ \t]+\w+(?:\[[^\]\n]*\])?)?[ \t]+([A-Za-z_]\w*)", re.I | re.M
)
_BRACKET = re.compile(rb"([A-Za-z_][A-Za-z_0-9]*)[ \t]*\(")


def load_program(src_path: str | Path, *, on_controller: bool = False) -> tuple[KrlModule, ...]:
    """Return a module and those in the same folder that it calls or that set its frames.

    ``on_controller``: with files that declare GLOBAL what it calls, and those that it calls
    elsewhere in the backup of a controller that the file lies in, and the global data there. Where
    two files have a name, neither is taken; all that declare a routine are. KRL008 if the file has
    no routine.
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
    root = next((up for up in path.resolve().parents if up.name.upper() == _ROOT), None)
    tree = _Tree.of(root) if on_controller and root is not None else _Tree()
    known = {**tree.sources, **folder}
    shared = _global_routines(known.values()) if on_controller else {}
    found = {main.name.upper(): main}
    waiting = [main]
    while waiting:
        module = waiting.pop()
        names = called_names(module) | (_functions(module) if on_controller else set())
        names -= {routine.name.upper() for routine in module.routines}
        for name in sorted(names):
            for path in [known[name]] if name in known else shared.get(name, ()):
                stem = path.stem.upper()
                if stem not in found:
                    found[stem] = parse_module(path)
                    waiting.append(found[stem])
    for data in filter(None, map(_sound_list, tree.data)):
        found.setdefault(data.name.upper(), data)
    for name, other in folder.items():
        if name not in found and name.endswith("_SETUP") and _sets_frames(other):
            found[name] = parse_module(other)
    return tuple(found.values())


@dataclass(frozen=True, slots=True)
class _Tree:
    """Modules of a controller by name, and its lists of global data."""

    sources: Mapping[str, Path] = field(default_factory=dict)
    data: tuple[Path, ...] = ()

    @classmethod
    def of(cls, root: Path) -> _Tree:
        files = sorted(path for path in root.rglob("*") if path.suffix.lower() in (".src", ".dat"))
        own = [path for path in files if not _is_of_the_maker(path, root)]
        stems = Counter(path.stem.upper() for path in own if path.suffix.lower() == ".src")
        by_name = {path.stem.upper(): path for path in own if path.suffix.lower() == ".src"}
        sources = {name: path for name, path in by_name.items() if stems[name] == 1}
        lists = [path for path in own if path.stem.upper() not in stems]
        config = [path for path in files if path.name.upper() == _CONFIG]
        return cls(sources, tuple([*config[:1], *lists]))


def _sound_list(path: Path) -> KrlModule | None:
    """Return a list of global data, None for one that a controller could not load."""
    try:
        module = parse_module(path)
        require_sound([module])
    except KrlError:
        return None
    return module


def _is_of_the_maker(path: Path, root: Path) -> bool:
    folders = path.relative_to(root).parts[:-1]
    return bool(_OF_THE_MAKER.intersection(folder.upper() for folder in folders))


def _global_routines(paths: Iterable[Path]) -> dict[str, list[Path]]:
    """Return which files declare which routines GLOBAL, names in upper case."""
    found: dict[str, list[Path]] = {}
    for path in paths:
        for name in {name.upper() for name in _GLOBAL.findall(path.read_bytes())}:
            found.setdefault(name.decode("ascii"), []).append(path)
    return found


def _functions(module: KrlModule) -> set[str]:
    """Return the names, in upper case, in front of brackets: of functions and of arrays."""
    content = Path(module.src_path).read_bytes() if module.src_path else b""
    return {name.decode("ascii").upper() for name in _BRACKET.findall(content)}


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
