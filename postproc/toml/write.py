"""Values as TOML text: numbers in full precision, one row of a matrix per line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.errors import DataError


def toml_table(table: Mapping[str, Any]) -> list[str]:
    """Return one ``key = value`` text per key, in the table's order.

    Raises:
        DataError: MOD007 if a value has no form in TOML.
    """
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items()]


def toml_key(name: str) -> str:
    """Return a key, quoted where TOML asks for it."""
    plain = all(c.isascii() and (c.isalnum() or c in "_-") for c in name)
    return name if plain and name else _text(name)


def toml_value(value: object) -> str:
    """Return a value: text, number, list, mapping or numpy array.

    Raises:
        DataError: MOD007 if it has no form in TOML.
    """
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_table(value)) + " }"
    if isinstance(value, (list, tuple)):
        return _list(value)
    return _scalar(value)


def _list(values: list[Any] | tuple[Any, ...]) -> str:
    rows = [toml_value(value) for value in values]
    if any(isinstance(value, (list, tuple, np.ndarray)) for value in values):
        return "[\n" + "".join(f"  {row},\n" for row in rows) + "]"
    return "[" + ", ".join(rows) + "]"


def _scalar(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (int, float)):
        return repr(value)
    raise DataError("MOD007", f"a model cannot hold {type(value).__name__} {value!r}")


def _text(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    shown = (c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped)
    return '"' + "".join(shown) + '"'
