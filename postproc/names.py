"""Which names a KRL controller leaves to us."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

NAME_LENGTH = 24
"""Longest KRL name."""
LETTERS = r"^[A-Za-z_][A-Za-z0-9_]{0,23}$"
"""What a KRL name is made of."""

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


@cache
def reserved_names() -> frozenset[str]:
    """Return every name of the language and of a delivered controller, variables without $."""
    here = Path(__file__).parent
    listed = re.sub(r"(?m)^#.*", "", (here / "names.txt").read_text("ascii"))
    table = (here / "krl" / "system.toml").read_text("utf-8")
    variables = " ".join(re.findall(r'\bnames = "([^"]*)"', table))
    structures = " ".join(re.findall(r'(?m)^structures = """([^"]*)"""', table))
    bare = {name.partition(".")[0] for name in variables.split()}
    return KEYWORDS | SYSTEM_MODULES | bare | {*structures.split(), *listed.split()}


def is_legal(name: str) -> bool:
    """Whether a module, routine or variable of ours may be called so."""
    return bool(re.fullmatch(LETTERS, name)) and name.upper() not in reserved_names()
