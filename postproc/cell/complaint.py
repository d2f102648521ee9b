"""What is wrong with the tables of a cell file, in words: key, line, and what was expected."""

from __future__ import annotations

import difflib

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from postproc.cell.schema import CellFile, tables_in
from postproc.errors import CellError
from postproc.toml import Location, TomlText

_MOST_EXPLAINED = 100
"""Errors of one file that are put into words: six are shown."""


def complaint(toml: TomlText, problem: ValidationError) -> CellError:
    """Return the first complaint as an error; the others go into the hint.

    Unknown keys come first, since a misspelt key makes a required one look missing; then by line.
    """
    errors = problem.errors(include_url=False)
    found = [_explain(toml, detail) for detail in errors[:_MOST_EXPLAINED]]
    found.sort(key=lambda e: (e.code != "CEL002", e.source.line if e.source else 0))
    first, others = found[0], found[1:]
    hints = [first.hint] if first.hint else []
    if others:
        shown = [f"line {e.source.line if e.source else 1}: {e.message}" for e in others[:5]]
        more = [f"and {len(errors) - 6} more"] if len(others) > 5 else []
        hints.append("also " + "; ".join([*shown, *more]))
    return CellError(first.code, first.message, first.source, "; ".join(hints))


def _explain(toml: TomlText, detail: ErrorDetails) -> CellError:
    location: Location = tuple(detail["loc"])
    if detail["type"] == "extra_forbidden":
        return _unknown_key(toml, location)
    if detail["type"] == "missing":
        table = dotted(location[:-1]) or "the file"
        text = f"{table}: key {location[-1]!r} is missing"
        return CellError("CEL003", text, toml.source(location[:-1]))
    known = location
    while known and known not in toml.lines:
        known = known[:-1]
    message = detail["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    value = detail["input"]
    shown = f", found {_shown(value)}" if not isinstance(value, (dict, BaseModel)) else ""
    if detail["type"] == "value_error":
        shown = ""
    place = f"{dotted(known)}: " if known else ""
    return CellError("CEL004", f"{place}{message}{shown}", toml.source(known))


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _unknown_key(toml: TomlText, location: Location) -> CellError:
    key, names = str(location[-1]), sorted(_known_keys(location[:-1]))
    nearest = difflib.get_close_matches(key.lower(), names, n=1, cutoff=0.0)[0]
    text = f"unknown key {dotted(location)!r}, the nearest known one is {nearest!r}"
    hint = f"keys known here: {', '.join(names)}"
    return CellError("CEL002", text, toml.source(location), hint=hint)


def _known_keys(location: Location) -> set[str]:
    """Return the keys of the table at a location of the file."""
    table: type[BaseModel] = CellFile
    for part in location:
        names = {field.alias or name: field for name, field in table.model_fields.items()}
        field = names.get(str(part))
        inner = tables_in(field.annotation) if field else []
        table = inner[0] if inner else table
    return {field.alias or name for name, field in table.model_fields.items()}


def dotted(location: Location) -> str:
    """Return the place of a key as it is written in messages."""
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")
