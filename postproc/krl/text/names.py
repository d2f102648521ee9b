"""Legal, unique KRL names for what the CAM system calls by any name it likes.

A name has at most 24 characters, prefixes (``XP1``) and suffixes (``_001``) included, of letters,
digits and underscore; it does not begin with a digit, is no keyword and no module of the
controller, and is unique whatever its case: all modules of the controller share one name space.
"""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Iterable

from postproc.errors import EmitError
from postproc.names import NAME_LENGTH, is_legal

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


MARK_LENGTH = 4
"""Characters of the mark at the end of a shortened name."""


def legal_name(text: str, length: int = NAME_LENGTH, fallback: str = "PROGRAM") -> str:
    """Return the legal name nearest to ``text``, at most ``length`` characters; not yet unique.

    Accents are dropped, other illegal characters become ``_``, a leading digit gets ``P_`` before
    it, a keyword or a name of the controller ``_P`` behind it. A name that is too long ends in a
    mark made from the whole of it, so that long names which begin alike stay different, whatever
    process shortens them.
    """
    bare = re.sub(r"[^A-Za-z0-9_]+", "_", ascii_text(text[:1000]))
    name = re.sub(r"_{2,}", "_", bare).strip("_")
    if not name:
        name = fallback
    if name[0].isdigit():
        name = f"P_{name}"
    if len(name) > length:
        mark = hashlib.sha256(name.upper().encode()).hexdigest()[:MARK_LENGTH].upper()
        name = f"{name[: length - MARK_LENGTH - 1].rstrip('_')}_{mark}"
    if not is_legal(name):
        name = f"{name[: length - 2]}_P"
    return name


class NameAllocator:
    """Gives each thing a legal name that nothing else has, and remembers which got which.

    One allocator serves a whole batch; names depend on the order of the calls and on nothing else.
    ``reserved``: names taken before the first call, in any case.
    """

    def __init__(self, reserved: Iterable[str] = ()) -> None:
        self._taken = {name.upper() for name in reserved}
        self._given: list[tuple[str, str]] = []

    @property
    def changes(self) -> tuple[tuple[str, str], ...]:
        """(CAM name, KRL name) of every allocation that gave another name, in order."""
        return tuple(pair for pair in self._given if pair[0] != pair[1])

    def is_free(self, name: str) -> bool:
        """Whether nothing has this name yet, in any case."""
        return name.upper() not in self._taken

    def reserve(self, names: Iterable[str]) -> None:
        """Take names that something else has: nothing gets them from now on."""
        self._taken.update(name.upper() for name in names)

    def allocate(
        self, wanted: str, suffixes: Iterable[str] = (), prefix: str = "", fallback: str = "PROGRAM"
    ) -> str:
        """Return a new name for ``wanted``, any text, so short that prefix and suffixes fit.

        The suffixes will be put behind it (``_001``), those names are taken too; ``prefix`` is put
        before it at its uses (``X`` before a point). ``fallback`` is for a text without any legal
        character. EMT301 if less than eight characters are left.
        """
        endings = tuple(suffixes)
        length = NAME_LENGTH - len(prefix) - max((len(ending) for ending in endings), default=0)
        if length < 8:
            raise EmitError("EMT301", f"no room for a name beside prefix {prefix!r} and suffixes")
        base = legal_name(wanted, length, fallback)
        name, count = base, 1
        while not self._all_free(name, endings):
            count += 1
            tail = f"_{count}"
            name = base[: length - len(tail)].rstrip("_") + tail
        self._taken.update((name.upper(), *((name + ending).upper() for ending in endings)))
        self._given.append((wanted, name))
        return name

    def _all_free(self, name: str, endings: tuple[str, ...]) -> bool:
        return self.is_free(name) and all(
            self.is_free(name + e) and is_legal(name + e) for e in endings
        )
