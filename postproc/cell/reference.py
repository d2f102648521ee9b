"""The reference page of ``cell.toml``, generated from the schema so that it cannot fall behind."""

from __future__ import annotations

import json
import types
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import Annotated, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, MaxLen, MinLen
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from postproc.cell.schema import CellFile, tables_in

_WORDS = {float: "number", int: "whole number", str: "text", bool: "true or false"}
_HEAD = """# cell.toml

Everything about a cell that a program depends on. Millimetres, degrees, kilograms, newtons.
Relative paths are relative to the file. An unknown key is an error that names the nearest one.
"""


def cell_reference() -> str:
    """Return the reference page of all keys in Markdown: type, range, default, meaning."""
    parts = [_HEAD, "## Top level", "", *_rows(CellFile, of_tables=False)]
    places: dict[type[BaseModel], list[str]] = {}
    for name, table, is_list in _tables(CellFile, ()):
        places.setdefault(table, []).append(f"`[[{name}]]`" if is_list else f"`[{name}]`")
    for table, headings in places.items():
        meaning = (table.__doc__ or "").strip().splitlines()[0]
        parts += ["", f"## {', '.join(headings)}", "", meaning, "", *_rows(table, of_tables=True)]
    return "\n".join(parts) + "\n"


def _tables(
    table: type[BaseModel], path: tuple[str, ...]
) -> Iterator[tuple[str, type[BaseModel], bool]]:
    """Yield dotted name, class and whether it is a list, for each table that has own keys."""
    for key, field in table.model_fields.items():
        for inner in tables_in(field.annotation):
            is_list = "list" in _type_words(field.annotation, ())
            here = (*path, field.alias or key)
            yield ".".join(here), inner, is_list
            yield from _tables(inner, here)


def _rows(table: type[BaseModel], *, of_tables: bool) -> list[str]:
    lines = ["| key | type | default | meaning |", "|---|---|---|---|"]
    for name, field in table.model_fields.items():
        if not of_tables and tables_in(field.annotation):
            continue
        key = field.alias or name
        words = _type_words(field.annotation, field.metadata)
        meaning = (field.description or "").replace("|", "\\|")
        lines.append(f"| `{key}` | {words} | {_default(field)} | {meaning} |")
    return lines


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.default
    is_table = value == {} and bool(tables_in(field.annotation))
    if value is None or is_table or isinstance(value, BaseModel) or value == []:
        return ""
    return f"`{json.dumps(value)}`"


def _type_words(annotation: object, metadata: Sequence[object]) -> str:
    """Return a type and its range in words."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        extra = [m for item in arguments[1:] for m in _flattened(item)]
        return _type_words(arguments[0], [*metadata, *extra])
    if origin in (Union, types.UnionType):
        options = [_type_words(a, metadata) for a in arguments if a is not type(None)]
        return " or ".join(options)
    if isinstance(annotation, type) and issubclass(annotation, StrEnum):
        origin, arguments = Literal, tuple(annotation)
    if origin is Literal:
        return " or ".join(f'`"{value}"`' for value in arguments)
    if origin in (list, dict):
        return _list_words(arguments[0], metadata) if origin is list else "table of numbers"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        keys = ", ".join(f.alias or name for name, f in annotation.model_fields.items())
        return f"table {{ {keys} }}"
    return _WORDS.get(annotation, "value") + _range_words(metadata)  # type: ignore[call-overload, no-any-return]


def _list_words(entry: object, metadata: Sequence[object]) -> str:
    shortest = [m.min_length for m in metadata if isinstance(m, MinLen)]
    longest = [m.max_length for m in metadata if isinstance(m, MaxLen)]
    count = f" of {shortest[0]}" if shortest and shortest == longest else ""
    words = _type_words(entry, ())
    return f"list{count}: {words}"


def _flattened(item: object) -> list[object]:
    return list(item.metadata) if isinstance(item, FieldInfo) else [item]


def _range_words(metadata: Sequence[object]) -> str:
    signs = {Gt: ("gt", ">"), Ge: ("ge", ">="), Le: ("le", "<=")}
    limits = [
        f"{sign} {getattr(m, name):g}"
        for m in metadata
        for kind, (name, sign) in signs.items()
        if isinstance(m, kind)
    ]
    return f" {', '.join(limits)}" if limits else ""
