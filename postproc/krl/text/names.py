"""Legal, unique KRL names for what the CAM system calls by any name it likes.

A name has at most 24 characters, prefixes (``XP1``) and suffixes (``_001``) included, of letters,
digits and underscore; it does not begin with a digit, is no keyword and no module of the
controller, and is unique whatever its case: all modules of the controller share one name space.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable

from postproc.errors import EmitError
from postproc.krl.text.comments import ascii_text

NAME_LENGTH = 24
"""Longest KRL name."""
MARK_LENGTH = 4
"""Characters of the mark at the end of a shortened name."""
LEGAL_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,23}\Z")

_WORDS = """
AND ANIN ANOUT B_AND B_EXOR B_NOT B_OR BOOL BRAKE BY C_DIS C_ORI C_PTP C_SPL C_VEL CA CASE
CAST_FROM CAST_TO CCLOSE CHANNEL CHAR CIRC CIRC_REL CONFIRM CONST CONST_KEY CONTINUE COPEN CREAD
CWRITE DECL DEF DEFAULT DEFDAT DEFFCT DELAY DIGIN DISTANCE DO ELSE END ENDDAT
ENDFCT ENDFOR ENDIF ENDLOOP ENDSPLINE ENDSWITCH ENDWHILE ENUM EXIT EXOR EXT EXTFCT EXTP FALSE
FOR GLOBAL GOTO HALT IF IMPORT IN INT INTERRUPT IS LIN LIN_REL LOOP MAXIMUM MINIMUM NOT OFF ON
ONSTART OR OUT PATH PRIO PTP PTP_REL PTP_SPLINE PUBLIC PULSE REAL REPEAT RESUME RETURN SCIRC
SCIRC_REL SEC SIGNAL SLIN SLIN_REL SPL SPL_REL SPLINE SPTP SPTP_REL SREAD STEP STRUC SWITCH
SWRITE SYNC THEN TIME_BLOCK TO TRIGGER TRUE UNTIL WAIT WHEN WHILE WITH AXIS E6AXIS E6POS FRAME
POS LOAD INERTIA FDAT PDAT LDAT STATE_T
"""
KEYWORDS = frozenset(_WORDS.split())
"""Words of the language and of its predefined types."""

_MODULES = """
BAS BASISTECH_EXT CELL CONFIG CUSTOM DIAG ERR_MSG FLT_SERV GLOBAL_DATA H50 IR_STOPM MACHINE
MASREF MSG_DEMO MSGLIB NEW_SERV OPTION P00 P00_EXT ROBCOR SPS SPS_USER TM_USER USER_GLOBAL
USERSAW USERSPOT WEAV_DEF XHOME XHOME1 XHOME2 CON PRN AUX NUL COM1 COM2 COM3 COM4 COM5 COM6 COM7
COM8 COM9 LPT1 LPT2 LPT3 LPT4 LPT5 LPT6 LPT7 LPT8 LPT9
"""
SYSTEM_MODULES = frozenset(_MODULES.split())
"""Modules and routines of a delivered controller, and file names its Windows refuses."""


def is_legal(name: str) -> bool:
    """Whether a module, routine or variable of ours may be called so."""
    return bool(LEGAL_NAME.match(name)) and name.upper() not in KEYWORDS | SYSTEM_MODULES


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

    Args:
        reserved: names taken before the first call, in any case.
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
        """Return a new name for ``wanted``, so short that prefix and suffixes fit.

        Args:
            wanted: name in the CAM system, any text.
            suffixes: endings that will be put behind it (``_001``); those names are taken too.
            prefix: put before the name at its uses (``X`` before a point); counts in the length.
            fallback: name for a text without any legal character.

        Raises:
            EmitError: EMT301 if prefix and suffix leave less than eight characters.
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
