"""Short and long form of tools and setups in a cell file, and the CAM names that they claim."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence

from postproc.cell.schema import CellFile, HooksTable, ToolTable, WorkpieceTable
from postproc.errors import CellError
from postproc.names import is_legal
from postproc.toml import Location, TomlText

_FORMS = (("tool", "tools", "TOOL"), ("workpiece", "bases", "BASE"))


def cam_key(name: str | int) -> str:
    """Return a CAM number or name as it is compared: ``07``, ``7`` and ``7.0`` are one.

    >>> cam_key("007"), cam_key(7), cam_key(" Drill_635 ")
    ('7', '7', 'DRILL_635')
    """
    text = str(name).strip().upper()
    number = re.fullmatch(r"0*(\d+)(\.0*)?", text)
    return number[1] if number else text


def check_forms(toml: TomlText, file: CellFile) -> None:
    """Refuse both forms at once, and entries that cannot be told apart: CEL012 to CEL014."""
    for short, form, what in _FORMS:
        if form not in file.model_fields_set:
            continue
        if short in file.model_fields_set:
            text = f"both [{short}] and [[{form}]] are given, expected one of them"
            raise CellError("CEL012", text, toml.source((form,)))
        entries: Sequence[ToolTable | WorkpieceTable] = getattr(file, form)
        if not entries:
            text = f"{form} is empty, expected at least one entry"
            raise CellError("CEL012", text, toml.source((form,)))
        _told_apart(toml, form, what, entries)
    _check_hooks(toml, file)
    _check_routines(toml, file)
    if len(file.tools) > 1 and file.krl.inertia is not None:
        at: Location = ("krl", "inertia_kg_m2")
        text = "krl.inertia_kg_m2 is of one tool: give each of tools its own inertia_kg_m2"
        raise CellError("CEL012", text, toml.source(at))


def _check_hooks(toml: TomlText, file: CellFile) -> None:
    """Refuse routines of nothing, and steps of a hole that mean something else."""
    steps, own = file.process.hole, HooksTable.model_fields
    if file.process.unit_feeds and not steps:
        text = 'process.hole is empty: with feed_by = "unit" nothing would drill'
        raise CellError("CEL014", text, toml.source(("process", "hole")))
    for place, name in enumerate(steps):
        if name in own or steps.index(name) != place:
            why = "appears twice" if name not in own else "is called by the CAM file"
            source = toml.source(("process", "hole", place))
            raise CellError("CEL014", f"process.hole: {name!r} {why}", source)
    for name in file.krl.hooks:
        if name not in own and name not in steps:
            known = sorted([*own, *steps])
            nearest = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.0)[0]
            text = f"unknown key 'krl.hooks.{name}', the nearest known one is {nearest!r}"
            hint = f"keys known here: {', '.join(known)}"
            raise CellError("CEL002", text, toml.source(("krl", "hooks", name)), hint=hint)
    every = routines(file.krl.hooks, steps)
    for name in file.krl.stops_advance or ():
        if name not in every:
            text = f"krl.hooks.stops_advance: no routine {name!r}, expected of {', '.join(every)}"
            raise CellError("CEL014", text, toml.source(("krl", "hooks", "stops_advance")))


def routines(hooks: Mapping[str, str], hole: Sequence[str]) -> dict[str, str]:
    """Return the routine of each hook and of each step of a hole, by its key in krl.hooks."""
    return {name: f"PP_{name.upper()}" for name in hole} | dict(hooks)


def _check_routines(toml: TomlText, file: CellFile) -> None:
    """Refuse routines that KRL takes for something else, and one routine for two things."""
    keys: dict[str, str] = {}
    for key, name in routines(file.krl.hooks, file.process.hole).items():
        at: Location = ("krl", "hooks", key)
        if not is_legal(name):
            text = f"krl.hooks.{key}: {name!r} is a KRL word, expected another name"
            raise CellError("CEL017", text, toml.source(at))
        other = keys.setdefault(name.upper(), key)
        if other != key:
            at = at if at in toml.lines else ("krl", "hooks", other)
            text = f"krl.hooks.{other} and krl.hooks.{key} are both {name!r}, expected two routines"
            raise CellError("CEL017", text, toml.source(at))


def _told_apart(
    toml: TomlText, form: str, what: str, entries: Sequence[ToolTable | WorkpieceTable]
) -> None:
    numbers: dict[int, int] = {}
    claims: dict[str, int] = {}
    for place, entry in enumerate(entries):
        other = numbers.setdefault(entry.number, place)
        if other != place:
            text = f"{form}: entries {other + 1} and {place + 1} are both {what} {entry.number}"
            raise CellError("CEL013", text, toml.source((form, place)))
        for name in entry.cam:
            other = claims.setdefault(cam_key(name), place)
            if other != place:
                text = f"{form}: entries {other + 1} and {place + 1} both list {str(name)!r}"
                raise CellError("CEL013", text, toml.source((form, place, "cam")))
