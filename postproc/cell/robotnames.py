"""How people and controllers write the name of an arm: spellings of one name made equal."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

_SERIES = re.compile(r"\b(kuka|quantec|fortec|agilus|cybertech|iontec|robot|industrial)\b")
_NO_NAME = re.compile(
    r"c[1-5](sr|vkrc)?|flr|clg|wll|wal|deck|boden|wand|g|s|zh\d.*|\d{3}|krc\d", re.I
)
"""Words of a $TRAFONAME behind the name of the arm: controller, mounting, hand, volts."""


def normal(name: str) -> str:
    """Return a name without case, signs, blanks and the words of series."""
    plain = re.sub(r"[_\s]+", " ", name.lower())
    return re.sub(r"[^a-z0-9]", "", _SERIES.sub("", plain))


def type_of(trafoname: str) -> str:
    """Return the part of a $TRAFONAME that names the arm: ``#KR210R2700_2 C4 FLR``: the first."""
    words = trafoname.strip().lstrip("#").split()
    for end, word in enumerate(words):
        has_number = any(sign.isdigit() for sign in "".join(words[:end]))
        if has_number and _NO_NAME.fullmatch(word):
            return " ".join(words[:end])
    return " ".join(words)


def same_type(a: str, b: str) -> bool:
    """Return whether two $TRAFONAME name the same arm."""
    return normal(type_of(a)) == normal(type_of(b))


def nearest(name: str, names: Sequence[str]) -> list[str]:
    """Return up to five of ``names``, the most like ``name`` first."""
    by_normal = {normal(known): known for known in names}
    close = difflib.get_close_matches(normal(name), by_normal, n=5, cutoff=0.0)
    return [by_normal[key] for key in close]


def candidates(name: str, names: Sequence[str]) -> list[str]:
    """Return those of ``names`` that begin with ``name``, at the end of a number or word."""
    wanted = normal(name)
    return [known for known in names if wanted and _begins(normal(known), wanted)]


def _begins(known: str, wanted: str) -> bool:
    rest = known.removeprefix(wanted)
    if rest == known:
        return False
    return not (wanted[-1].isdigit() and rest[:1].isdigit() and len(rest) > 1)
