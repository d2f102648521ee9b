"""TOML files with the line of every key, so that an error can point at it.

``tomllib`` gives values without their place. Since it has already accepted the text, the scanner
below may assume valid TOML and only has to follow keys, strings, brackets and table headers.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from postproc.errors import PostprocError, SourceRef
from postproc.files import read_bytes, text_of
from postproc.records import dataclass

Location = tuple[str | int, ...]
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^,\]}#\n]*")
_STRINGS = (
    re.compile(r'"""(?:\\.|[^\\])*?"""(?:"{0,2})', re.DOTALL),
    re.compile(r"'''.*?'''(?:'{0,2})", re.DOTALL),
    re.compile(r'"(?:\\.|[^"\\\n])*"'),
    re.compile(r"'[^'\n]*'"),
)
_DEEPEST = 40
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(
    r"(?<![A-Za-z0-9_-])" + _PART + r"(?:[ \t]*+\.[ \t]*+" + _PART + r"){" + str(_DEEPEST) + "}"
)
"""A dotted key of more parts; the time to read one grows with the square of them. No part begins
within a run of letters: a search from each of them takes the square of a long text."""
MOST_BYTES = 1 << 26
"""No file that people or this package write comes near; tomllib takes 20 times the memory."""


@dataclass(frozen=True, slots=True)
class TomlText:
    """A parsed TOML file: values, and the line of each key and of each entry of a list."""

    path: str
    data: dict[str, Any]
    lines: Mapping[Location, int]
    text: tuple[str, ...]

    def source(self, location: Location = ()) -> SourceRef:
        """Return file and line of a key, or of the nearest table around it that has one."""
        while location and location not in self.lines:
            location = location[:-1]
        line = self.lines.get(location, 1)
        content = self.text[line - 1].strip() if 0 < line <= len(self.text) else ""
        return SourceRef(self.path, line, content)


def load_toml(path: str | Path, error: type[PostprocError], code: str) -> TomlText:
    """Read a TOML file; what is none raises ``error`` with ``code`` and the line."""
    return parse_toml(read_bytes(path), path, error, code)


def parse_toml(raw: bytes, path: str | Path, error: type[PostprocError], code: str) -> TomlText:
    """Read the bytes of a TOML file; as ``load_toml``, with ``path`` for the errors only."""
    if len(raw) > MOST_BYTES:
        text = f"{len(raw)} bytes, expected at most {MOST_BYTES}"
        raise error(code, text, SourceRef(str(path)))
    text = text_of(raw, path, code, error).replace("\r\n", "\n")
    lines = tuple(text.split("\n"))
    if deep := _DEEP_KEY.search(text):
        where = SourceRef(str(path), text.count("\n", 0, deep.start()) + 1)
        raise error(code, f"a dotted key of more than {_DEEPEST} parts", where)
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as problem:
        message, line = _where(str(problem), len(lines))
        raise error(code, f"not valid TOML: {message}", SourceRef(str(path), line)) from None
    except RecursionError:
        raise error(code, "lists are nested too deeply", SourceRef(str(path))) from None
    if _depth(data) > _DEEPEST:
        raise error(code, "lists are nested too deeply", SourceRef(str(path)))
    return TomlText(str(path), data, Scanner(text).scan(), lines)


def _where(message: str, last_line: int) -> tuple[str, int]:
    found = re.search(r"\s*\(at line (\d+), column (\d+)\)", message)
    if found:
        return f"{message[: found.start()]}, column {found.group(2)}", int(found.group(1))
    return message.replace(" (at end of document)", " at the end of the file"), max(last_line, 1)


def _depth(value: object) -> int:
    deepest, waiting = 0, [(value, 1)]
    while waiting:
        current, depth = waiting.pop()
        deepest = max(deepest, depth)
        inner = list(current.values()) if isinstance(current, dict) else current
        if isinstance(inner, list):
            waiting.extend((entry, depth + 1) for entry in inner)
    return deepest


class Scanner:
    """Follows valid TOML text and notes the line of every key and list entry."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Location, int] = {}
        self.spans: dict[Location, tuple[int, int]] = {}
        """Where the value of each key and list entry stands in the text."""
        self.headers: dict[Location, int] = {}
        """Where the header of each table ends."""
        self.counts: dict[Location, int] = {}
        self._line_at, self._line = 0, 1

    def scan(self) -> dict[Location, int]:
        """Return the line of every location."""
        table: Location = ()
        while self._skip() < len(self.text):
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._assignment(table)
        return self.lines

    def _skip(self) -> int:
        """Pass blanks, line ends and comments; return the position."""
        text = self.text
        while self.at < len(text) and text[self.at] in " \t\r\n#":
            if text[self.at] == "#":
                end = text.find("\n", self.at)
                self.at = len(text) if end < 0 else end
            else:
                self.at += 1
        return self.at

    def _note(self, location: Location) -> None:
        self._line += self.text.count("\n", self._line_at, self.at)
        self._line_at = self.at
        self.lines.setdefault(location, self._line)

    def _header(self) -> Location:
        is_list = self.text.startswith("[[", self.at)
        self.at += 2 if is_list else 1
        parts = self._key()
        location: Location = ()
        for place, part in enumerate(parts):
            location += (part,)
            last = place == len(parts) - 1
            if last and is_list:
                self._note(location)
                self.counts[location] = self.counts.get(location, 0) + 1
            if location in self.counts:
                location += (self.counts[location] - 1,)
        self._note(location)
        self._skip()
        self.at += 2 if is_list else 1
        self.headers[location] = self.at
        return location

    def _assignment(self, table: Location) -> None:
        start = self.at
        parts = self._key()
        end, self.at = self.at, start
        for count in range(1, len(parts) + 1):
            self._note(table + parts[:count])
        self.at = end + 1  # past the equals sign
        self._value(table + parts)

    def _key(self) -> tuple[str, ...]:
        """Read a dotted key and stop at what follows it (``=`` or ``]``)."""
        parts: list[str] = []
        while True:
            self._skip()
            quoted = self._string()
            if quoted is not None:
                parts.append(str(next(iter(tomllib.loads(f"k = {quoted}").values()))))
            else:
                found = _BARE_KEY.match(self.text, self.at)
                if found is None:
                    return tuple(parts)
                parts.append(found.group())
                self.at = found.end()
            self._skip()
            if not self.text.startswith(".", self.at):
                return tuple(parts)
            self.at += 1

    def _string(self) -> str | None:
        for pattern in _STRINGS:
            found = pattern.match(self.text, self.at)
            if found:
                self.at = found.end()
                return found.group()
        return None

    def _value(self, location: Location) -> None:
        start = self._skip()
        opening = self.text[self.at : self.at + 1]
        if opening == "[":
            self._list(location)
        elif opening == "{":
            self._inline(location)
        elif self._string() is None:
            found = _SCALAR.match(self.text, self.at)
            self.at = found.end() if found else self.at + 1
        self.spans[location] = (start, self.at)

    def _list(self, location: Location) -> None:
        self.at += 1
        index = 0
        while self._skip() < len(self.text) and self.text[self.at] != "]":
            self._note((*location, index))
            self._value((*location, index))
            index += 1
            self._skip()
            if self.text.startswith(",", self.at):
                self.at += 1
        self.at += 1

    def _inline(self, location: Location) -> None:
        self.at += 1
        while self._skip() < len(self.text) and self.text[self.at] != "}":
            self._assignment(location)
            self._skip()
            if self.text.startswith(",", self.at):
                self.at += 1
        self.at += 1
