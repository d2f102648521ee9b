"""Reading emitted text with nothing but regular expressions: no code under test is used."""

from __future__ import annotations

import re

NUMBER = r"-?\d+\.\d+"
MOTION = re.compile(r"\s*(S?PTP|S?LIN|S?CIRC|SPL)\b")
HEADER = re.compile(r"&(ACCESS|REL|PARAM|COMMENT|USER)\b")
INSTRUCTION = re.compile(
    r"\s*(?:"
    r"(?:PTP|LIN|CIRC|SPTP|SLIN|SCIRC|SPL)\b .+"
    r"|SPLINE(?: WITH .+)?|ENDSPLINE(?: C_SPL)?"
    r"|[$A-Z_][$\w.\[\]]*=.+"
    r"|[A-Za-z_]\w*\(.*\)"
    r"|WAIT SEC \d+\.\d+"
    r"|TRIGGER WHEN (?:DISTANCE|PATH)=0(?: ONSTART)? DELAY=0 DO \w+\(.*\) PRIO=-1"
    r"|GLOBAL INTERRUPT DECL 3 WHEN \$STOPMESS==TRUE DO IR_STOPM\(\)|INTERRUPT ON 3"
    r"|DEF \w+\( \)|END|HALT"
    r")\s*\Z"
)


def lines(files: dict[str, bytes], name: str) -> list[str]:
    """Lines of a file."""
    return files[name].decode("ascii").split("\r\n")[:-1]


def code(files: dict[str, bytes], name: str) -> list[str]:
    """Instructions of a file: comments, header and empty lines left out."""
    found = []
    for line in lines(files, name):
        text = line.partition(";")[0].strip()
        if text and not text.startswith("&"):
            found.append(text)
    return found


def motions(files: dict[str, bytes], name: str) -> list[str]:
    """Motion instructions of a file."""
    return [line for line in code(files, name) if MOTION.match(line)]


def sources(files: dict[str, bytes]) -> list[str]:
    """Names of the .src files in order."""
    return [name for name in files if name.endswith(".src")]


def numbers(line: str) -> list[float]:
    """All numbers with a decimal point in a line."""
    return [float(text) for text in re.findall(NUMBER, line)]
