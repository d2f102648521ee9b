"""A new cell file as text: every key of the schema, with its default and its meaning beside it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from types import NoneType
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from postproc.cell.schema import CellFile, Placement
from postproc.toml import toml_value

Values = Mapping[str, Any]
_WIDTH = 100


def cell_text(values: Values) -> str:
    """Return the text of a cell file.

    Args:
        values: what differs from the defaults, nested by table, such as
            ``{"robot": {"model": "kuka_kr500_r2830"}}``.

    Returns:
        TOML that holds every table; keys without a value stand there as comments.
    """
    lines = ['schema = "postproc.cell/1"']
    lines += _keys({"name": CellFile.model_fields["name"]}, values)
    for key, field in CellFile.model_fields.items():
        kind = _table_of(field)
        name = field.alias or key
        if kind is not None:
            lines += _table(name, kind, field, values.get(name))
    return "\n".join(lines) + "\n"


def _table(
    name: str, kind: type[BaseModel], field: FieldInfo, values: Values | None
) -> Iterator[str]:
    is_list = field.default == []
    heading = f"[[{name}]]" if is_list else f"[{name}]"
    is_there = not is_list and (values is not None or field.default is not None)
    comment = field.description or (kind.__doc__ or "").splitlines()[0]
    yield ""
    yield f"{'' if is_there else '# '}{heading}  # {comment}"
    inner: dict[str, tuple[type[BaseModel], FieldInfo]] = {}
    plain: dict[str, FieldInfo] = {}
    for key, entry in kind.model_fields.items():
        table = _table_of(entry)
        if table is None or issubclass(table, Placement) or entry.default in ([], None):
            plain[key] = entry
        else:
            inner[key] = (table, entry)
    defaults = field.default if isinstance(field.default, BaseModel) else None
    shown = dict(values or {})
    if defaults is not None:
        shown = {**defaults.model_dump(include=defaults.model_fields_set), **shown}
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


def _table_of(field: FieldInfo) -> type[BaseModel] | None:
    """Return the class of a field that is a table or a list of tables."""
    waiting: list[Any] = [field.annotation]
    while waiting:
        current = waiting.pop()
        if isinstance(current, type) and issubclass(current, BaseModel):
            return current
        waiting.extend(part for part in get_args(current) if part is not NoneType)
    return None
