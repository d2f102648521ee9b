"""Text from outside (CAM names, messages) made safe for the only place it may stand: a comment."""

from __future__ import annotations

import unicodedata

COMMENT_LENGTH = 100
"""Longest comment that is made of outside text; a line of a program stays below 250 characters."""
_SIGNIFICANT = str.maketrans({";": ",", "%": "/", "\\": "/", '"': "'", "`": "'"})
_FOLD_WORDS = ("FOLD", "ENDFOLD", "PARAMS")


_BY_SOUND = """
а a б b в v г g д d е e ё yo ж zh з z и i й y к k л l м m н n о o п p р r с s т t у u ф f х kh ц ts
ч ch ш sh щ shch ы y э e ю yu я ya і i ї yi є ye ґ g њ nj љ lj ђ dj ћ c џ dzh ј j
ß ss æ ae œ oe ł l đ d ı i
"""
_PAIRS = dict(zip(_BY_SOUND.split()[::2], _BY_SOUND.split()[1::2], strict=True))
_UPPER = {k.upper(): v.capitalize() for k, v in _PAIRS.items() if k != "ß" and k != "ı"}
_LATIN = str.maketrans({**_PAIRS, **_UPPER, **dict.fromkeys("ъьЪЬ", "")})
"""Letters without ASCII beneath an accent: Cyrillic by sound, ligatures; not the diameter sign."""


def ascii_text(text: str) -> str:
    """Return one line of printable ASCII: accents dropped, Cyrillic by sound, the rest ``?``."""
    one_line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    composed = unicodedata.normalize("NFC", one_line)
    plain = unicodedata.normalize("NFKD", composed.translate(_LATIN))
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
