"""Tokens of one KRL line, and where its comment begins."""

from __future__ import annotations

import re
from enum import IntEnum
from typing import NamedTuple


class KrlSyntaxError(ValueError):
    """A line is not KRL; the reader turns it into a finding with file and line."""


class TokenKind(IntEnum):
    """What a token is."""

    NUMBER = 0
    BITS = 1
    """``'B101'`` or ``'H1F'``."""
    STRING = 2
    NAME = 3
    ENUM = 4
    """``#BASE``."""
    OPERATOR = 5
    END = 6


class Token(NamedTuple):
    """Kind, text as written and where it stands in the line."""

    kind: TokenKind
    text: str
    start: int
    end: int


_TOKEN = re.compile(
    r"""\s*(?:
      ((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w$]))   # 1 number
    | ('[BbHh][0-9A-Fa-f]+')                             # 2 bits
    | ("[^"]*")                                          # 3 string
    | ([$A-Za-z_][$\w]*)                                 # 4 name
    | (\#\s*[A-Za-z_$][$\w]*)                            # 5 enumeration constant
    | (==|<>|<=|>=|[-+*/:<>=(),.\[\]{}?])                # 6 operator
    )""",
    re.VERBOSE | re.ASCII,
)
_KINDS = (
    TokenKind.END,
    TokenKind.NUMBER,
    TokenKind.BITS,
    TokenKind.STRING,
    TokenKind.NAME,
    TokenKind.ENUM,
    TokenKind.OPERATOR,
)


def split_comment(line: str) -> tuple[str, str]:
    """Return code and comment (without its ``;``) of a line; a ``;`` in a string is text."""
    if ";" not in line:
        return line, ""
    if '"' not in line:
        code, _, comment = line.partition(";")
        return code, comment
    quoted = False
    for position, character in enumerate(line):
        if character == '"':
            quoted = not quoted
        elif character == ";" and not quoted:
            return line[:position], line[position + 1 :]
    return line, ""


def tokenise(text: str) -> list[Token]:
    """Return the tokens of a line of code, closed by an END token."""
    tokens: list[Token] = []
    position, length = 0, len(text.rstrip())
    while position < length:
        match = _TOKEN.match(text, position)
        if match is None or match.lastindex is None:
            raise KrlSyntaxError(_strange(text, position))
        kind = _KINDS[match.lastindex]
        tokens.append(Token(kind, match.group(match.lastindex), *match.span(match.lastindex)))
        position = match.end()
    tokens.append(Token(TokenKind.END, "", length, length))
    return tokens


def _strange(text: str, position: int) -> str:
    rest = text[position:].lstrip()
    if rest[:1] == '"':
        return "a string is not closed"
    if rest[:1].isdigit():
        return f"{rest.split()[0]!r} is no number"
    return f"{rest[:1]!r} does not belong here"
