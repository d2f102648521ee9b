"""Text from outside (CAM names, messages) made safe for the only place it may stand: a comment."""

from __future__ import annotations

import unicodedata

COMMENT_LENGTH = 100
"""Longest comment that is made of outside text; a line of a program stays below 250 characters."""
_SIGNIFICANT = str.maketrans({";": ",", "%": "/", "\\": "/", '"': "'", "`": "'"})
_FOLD_WORDS = ("FOLD", "ENDFOLD", "PARAMS")


def ascii_text(text: str) -> str:
    """Return one line of printable ASCII: accents dropped, other characters as ``?``."""
    one_line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    plain = unicodedata.normalize("NFKD", one_line)
    bare = "".join(c for c in plain if not unicodedata.combining(c))
    return " ".join(bare.encode("ascii", "replace").decode("ascii").split())


def comment_text(text: str, limit: int = COMMENT_LENGTH) -> str:
    """Return outside text as it may follow a ``;``: it cannot end the comment or mean anything.

    One line of printable ASCII, at most ``limit`` characters; ``;``, ``%``, quotes and backslashes
    (which the pad reads as form parameters) are replaced; it never begins a fold.
    """
    safe = ascii_text(text[: 20 * limit]).translate(_SIGNIFICANT).strip()
    if safe.upper().startswith(_FOLD_WORDS):
        safe = "'" + safe
    return safe if len(safe) <= limit else safe[: limit - 3].rstrip() + "..."
