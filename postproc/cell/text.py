"""A new cell file as text: every key of the schema, with its default and its meaning beside it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from postproc.cell.schema import CellFile, Placement, tables_in
from postproc.toml import toml_value

Values = Mapping[str, Any]
_WIDTH = 100


_LONG_FORM = {"tool": "tools", "workpiece": "bases"}
"""Table of one entry -> list that stands instead of it."""


def cell_text(values: Values, remarks: Mapping[str, Sequence[str]] | None = None) -> str:
    """Return the text of a cell file with every table; keys without a value stand as comments.

    ``values``: what differs from the defaults, nested by table, such as ``{"robot": {"model":
    "kuka_kr500_r2830"}}``; a list of tables has an entry for each. ``remarks``: comments by table,
    those of the file under ``""``, those of the first entry of a list under ``tools.0``.
    """
    said = remarks or {}
    lines = [*_comments(said.get("", ())), 'schema = "postproc.cell/1"']
    lines += _keys({"name": CellFile.model_fields["name"]}, values)
    for key, field in CellFile.model_fields.items():
        kind = next(iter(tables_in(field.annotation)), None)
        name = field.alias or key
        other = next((short for short, long in _LONG_FORM.items() if long == name), "")
        if kind is None or values.get(_LONG_FORM.get(name, "")) or (other and not values.get(name)):
            continue
        if isinstance(values.get(name), list) and values[name]:
            lines += _entries(name, kind, values[name], said)
            continue
        table = list(_table(name, kind, field, values.get(name)))
        words = [
            *said.get(name, ()),
            *(said.get(_LONG_FORM[name], ()) if name in _LONG_FORM else ()),
        ]
        lines += [*table[:2], *_comments(words), *table[2:]]
    return "\n".join(lines) + "\n"


def _comments(remarks: Sequence[str]) -> Iterator[str]:
    for remark in remarks:
        yield from textwrap.wrap(
            " ".join(remark.split()), _WIDTH, initial_indent="# ", subsequent_indent="#   "
        )


def _entries(
    name: str,
    kind: type[BaseModel],
    entries: Sequence[Values],
    remarks: Mapping[str, Sequence[str]],
) -> Iterator[str]:
    """Yield the tables of a list: of each entry what is given, other keys once in the first."""
    if remarks.get(name):
        yield ""
        yield from _comments(remarks[name])
    fields = kind.model_fields
    for place, entry in enumerate(entries):
        yield ""
        yield f"[[{name}]]"
        yield from _comments(remarks.get(f"{name}.{place}", ()))
        given = {key: field for key, field in fields.items() if key in entry}
        yield from _keys(given if place else fields, entry)


def _table(
    name: str, kind: type[BaseModel], field: FieldInfo, values: Values | None
) -> Iterator[str]:
    standard = field.default
    is_list = standard == []
    heading = f"[[{name}]]" if is_list else f"[{name}]"
    is_there = not is_list and (values is not None or standard is not None)
    comment = field.description or (kind.__doc__ or "").splitlines()[0]
    yield ""
    yield f"{'' if is_there else '# '}{heading}  # {comment}"
    inner: dict[str, tuple[type[BaseModel], FieldInfo]] = {}
    plain: dict[str, FieldInfo] = {}
    for key, entry in kind.model_fields.items():
        table = next(iter(tables_in(entry.annotation)), None)
        if table is None or issubclass(table, Placement) or entry.default in ([], None):
            plain[key] = entry
        else:
            inner[key] = (table, entry)
    shown = {**(standard if isinstance(standard, dict) else {}), **(values or {})}
    for line in _keys(plain, shown):
        yield line if is_there or line.startswith("#") else f"# {line}"
    for key, (table, entry) in inner.items():
        yield from _table(f"{name}.{key}", table, entry, shown.get(key))


def _keys(fields: Mapping[str, FieldInfo], values: Values) -> Iterator[str]:
    for key, field in fields.items():
        value = values.get(key, None if field.is_required() else field.default)
        if isinstance(value, BaseModel):
            value = value.model_dump()
        has_value = value not in (None, [], {})
        text = toml_value(value) if has_value else "..."
        line = f"{'' if has_value else '# '}{key} = {text}"
        if len(line) + len(str(field.description)) + len("  # ") <= _WIDTH:
            yield f"{line}  # {field.description}"
        else:
            yield from textwrap.wrap(
                str(field.description), _WIDTH, initial_indent="# ", subsequent_indent="# "
            )
            yield line
