"""Writing values as TOML text, and changing those of a text; all else in it stays as it stands."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from postproc.errors import DataError
from postproc.toml.text import Location, Scanner


def edited(text: str, changes: Mapping[Location, object]) -> str:
    """Return a TOML text with values changed or added by place, as ``("bases", 0, "frame")``.

    Of a table the keys given change, others stay. MOD007 if a value has no form in TOML, CEL042 if
    it has no place in this text.
    """
    expected = tomllib.loads(text)
    result = text
    for location, value in changes.items():
        for place, leaf in _leaves(location, value, expected):
            result = _with(result, place, leaf)
            expected = _put(expected, place, leaf)
    if tomllib.loads(result) != expected:
        raise DataError("CEL042", f"the keys {_words(changes)} cannot be changed in this text")
    return result


def _words(changes: Mapping[Location, object]) -> str:
    return ", ".join(".".join(map(str, location)) for location in changes)


def _leaves(location: Location, value: object, data: Any) -> list[tuple[Location, object]]:  # noqa: ANN401 - any value
    """Return the values to set: of a table that is there already, each key by itself."""
    there = data
    for part in location:
        try:
            there = there[part]
        except (KeyError, IndexError, TypeError):
            return [(location, value)]
    if isinstance(value, Mapping) and isinstance(there, dict):
        return [
            leaf for key, part in value.items() for leaf in _leaves((*location, key), part, data)
        ]
    return [(location, value)]


def _put(data: Any, location: Location, value: object) -> Any:  # noqa: ANN401 - any value
    result = deepcopy(data)
    there = result
    for part in location[:-1]:
        there = there.setdefault(part, {}) if isinstance(there, dict) else there[part]
    there[location[-1]] = tomllib.loads(f"value = {toml_value(value)}")["value"]
    return result


def _with(text: str, location: Location, value: object) -> str:
    scanner = Scanner(text)
    lines = scanner.scan()
    if location in scanner.spans:
        start, end = scanner.spans[location]
        tail = text[start:end]
        end -= len(tail) - len(tail.rstrip())  # blanks before a comment stay
        return text[:start] + toml_value(value) + text[end:]
    owner = next(
        location[:count]
        for count in range(len(location) - 1, -1, -1)
        if not count or location[:count] in scanner.headers or location[:count] in scanner.spans
    )
    key = ".".join(toml_key(str(part)) for part in location[len(owner) :])
    entry = f"{key} = {toml_value(value)}"
    if owner in scanner.spans and owner not in scanner.headers:
        end = scanner.spans[owner][1] - 1
        inside = text[:end].rstrip()
        comma = " " if inside.endswith(("{", ",")) else ", "
        return f"{inside}{comma}{entry} {text[end:]}"
    if not owner and len(location) > 1 and location[:1] not in lines:
        table = ".".join(toml_key(str(part)) for part in location[:-1])
        return (
            f"{text.rstrip()}\n\n[{table}]\n{toml_key(str(location[-1]))} = {toml_value(value)}\n"
        )
    if not owner:
        return f"{entry}\n{text}"
    end = text.find("\n", scanner.headers[owner])
    return f"{text}\n{entry}\n" if end < 0 else f"{text[: end + 1]}{entry}\n{text[end + 1 :]}"


def toml_table(table: Mapping[str, Any]) -> list[str]:
    """Return one ``key = value`` text per key, in the table's order."""
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items()]


def toml_key(name: str) -> str:
    """Return a key, quoted where TOML asks for it."""
    plain = all(c.isascii() and (c.isalnum() or c in "_-") for c in name)
    return name if plain and name else _text(name)


def toml_value(value: object) -> str:
    """Return a value, text, number, list, mapping or numpy array: MOD007 for any other."""
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
