"""The rules that make mutants of KRL text."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_MOTION = re.compile(r"^S?(PTP|LIN|CIRC|SPL)\b")
_DECLARED = re.compile(r"^\s*(?:GLOBAL\s+)?DECL\s+(?:GLOBAL\s+)?(\w+)\s+[^=]*=\s*\{", re.IGNORECASE)
_NUMBER = r"(-?\d+(?:\.\d+)?(?:E[-+]?\d+)?)"
SHIFTS = {
    "X": 0.5, "Y": 0.5, "Z": 0.5, "A": 1.0, "B": 1.0, "C": 1.0,
    "A1": 0.2, "A2": 0.2, "A3": 0.2, "A4": 0.5, "A5": 0.5, "A6": 0.5, "E1": 1.0, "E2": 1.0,
}  # fmt: skip
"""What is added to a component of a point [mm or deg]."""
SETTINGS = {
    r"^\$VEL\.CP=": ("{0}*1.02", "{0}*0.5", "{0}*20"),
    r"^\$APO\.CDIS=": ("500.0",),
    r"^\$APO\.CORI=": ("180.0",),
    r"^\$VEL\.ORI[12]=": ("1000.0",),
    r"^\$ADVANCE=": ("9",),
    r"^BAS\(#VEL_PTP,": ("100", "0"),
    r"^BAS\(#TOOL,": ("{0}+1", "0"),
    r"^BAS\(#BASE,": ("{0}+1", "0"),
    r"^WAIT SEC ": ("1000000000.0", "0.0"),
    r"^PP_SPINDLE_ON\(": ("-{0}", "{0}*10"),
    r"^PP_COOLANT_ON\(": ("{0}+1",),
    r"^PP_TOOL_CHANGE\(": ("{0}+1",),
}
"""Lines that set a number: what becomes of it."""
INSERTED = (
    "BAS(#EX_BASE,1)",
    "BAS(#BASE,0)",
    "BAS(#TOOL,0)",
    "BAS(#INITMOV,0)",
    "$OV_PRO=100",
    "$LOAD.M=0",
    "$SOFTN_END[1]=170.0",
    "$SOFTP_END[2]=0.0",
    "$CIRC_TYPE=#PATH",
    "$APO.CORI=180.0",
    "$APO.CDIS=500.0",
    "$VEL_AXIS[1]=1",
    "$VEL_AXIS[4]=100",
    "$ACC_AXIS[1]=1",
    "$VEL.CP=3.0",
    "$ORI_TYPE=#CONSTANT",
    "$ORI_TYPE=#JOINT",
    "$IPO_MODE=#TCP",
    "$TOOL=$NULLFRAME",
    "$BASE=$NULLFRAME",
    "$ROBROOT=$NULLFRAME",
    "PTP_REL {A1 5.0}",
    "LIN_REL {Z -20.0}",
    "LIN_REL {X 30.0} #TOOL",
    "WAIT SEC 1000000000",
    "INTERRUPT OFF 3",
    "INTERRUPT DECL 9 WHEN $IN[1]==TRUE DO ELSEWHERE()",
    "ELSEWHERE()",
    "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $VEL.CP=2.0",
    "IF $IN[1] THEN\nLIN_REL {Z -5.0}\nENDIF",
    "LOOP\nWAIT SEC 0.1\nENDLOOP",
    "WHILE TRUE\nWAIT SEC 0.1\nENDWHILE",
    "PP_SPINDLE_OFF()",
    "PP_SPINDLE_ON(1200)",
    "PP_COOLANT_OFF()",
    "PP_TOOL_CHANGE(4)",
    "INTERRUPT OFF",
    "ASYPTP {E1 0.0}",
)
"""Lines that are put in."""
WORDS = (
    (r"^LIN\b", "PTP"),
    (r"^PTP\b", "LIN"),
    (r"^CIRC \{[^}]*\},", "LIN "),
    (r"#VAR\b", "#CONSTANT"),
    (r"^\$ORI_TYPE=#VAR", "$ORI_TYPE=#JOINT"),
    (r"^\$CIRC_TYPE=#BASE", "$CIRC_TYPE=#PATH"),
    (r"^\$IPO_MODE=#BASE", "$IPO_MODE=#TCP"),
    (r"^(LIN \{[^}]*\})(?! C_DIS)", r"\1 C_DIS"),
    (r"^INTERRUPT ON 3", "INTERRUPT OFF 3"),
)
"""Words that become others."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One changed text: the rule, the line (1-based) in ``file``, the line before and after."""

    rule: str
    file: str
    line: int
    before: str
    after: str
    files: Mapping[str, bytes]


def mutants(files: Mapping[str, bytes], each: int | None = None, seed: int = 0) -> Iterator[Mutant]:
    """Yield the mutants of a program, file by file.

    Args:
        files: content by file name.
        each: at most so many of each rule in a file, drawn at random; None: all.
        seed: of the draw.
    """
    rng = random.Random(seed)
    for name, content in files.items():
        lines = content.decode("ascii").split("\r\n")
        is_data = name.lower().endswith(".dat")
        by_rule: dict[str, list[tuple[int, list[str], list[str]]]] = {}
        for rule, *change in _data_changes(lines) if is_data else _changes(lines):
            by_rule.setdefault(rule, []).append(tuple(change))
        for rule, changes in by_rule.items():
            few = changes if each is None else rng.sample(changes, min(each, len(changes)))
            for number, before, after in few:
                changed = [*lines[: number - 1], *after, *lines[number - 1 + len(before) :]]
                text = "\r\n".join(changed).encode("ascii")
                one, other = "\n".join(before), "\n".join(after)
                yield Mutant(rule, name, number, one, other, {**files, name: text})


def _data_changes(lines: list[str]) -> Iterator[tuple[str, int, list[str], list[str]]]:
    """Yield rule, line, lines before and after of a data list: values changed, lines lost."""
    for number, line in enumerate(lines, 1):
        if not (found := _DECLARED.match(line)):
            continue
        kind = found[1].upper()
        yield f"lost: {kind}", number, [line], []
        for match in re.finditer(rf"([{{,] ?)(\w+) {_NUMBER}", line):
            value = float(match[3])
            for change, new in (("+", value + SHIFTS.get(match[2], 1.0)), ("*", 1.5 * value)):
                if f"{new:.5f}" != f"{value:.5f}":
                    number_text = f"{new:g}" if new.is_integer() else f"{new:.5f}"
                    start, end = match.start(), match.end()
                    text = f"{line[:start]}{match[1]}{match[2]} {number_text}{line[end:]}"
                    yield f"data: {match[2]} of {kind} {change}", number, [line], [text]


def _changes(lines: list[str]) -> Iterator[tuple[str, int, list[str], list[str]]]:
    """Yield rule, line, lines before and after."""
    for number, line in enumerate(lines, 1):
        code = line.partition(";")[0].strip()
        if not code or code.startswith("&"):
            continue
        yield f"lost: {_kind(code)}", number, [line], []
        if _MOTION.match(code):
            yield from _moved(line, number)
            for text in INSERTED:
                yield f"put in: {text.splitlines()[0]}", number, [line], [*text.split("\n"), line]
            following = lines[number] if number < len(lines) else ""
            if _MOTION.match(following) and following != line:
                yield "swapped motions", number, [line, following], [following, line]
        yield from _set(line, number)
        for pattern, word in WORDS:
            new_line = re.sub(pattern, word, line, count=1)
            if new_line != line:
                yield f"word: {pattern} -> {word}", number, [line], [new_line]


def _set(line: str, number: int) -> Iterator[tuple[str, int, list[str], list[str]]]:
    for pattern, changes in SETTINGS.items():
        found = re.match(pattern + _NUMBER, line.strip())
        for change in changes if found else ():
            value = float(found[1]) if found else 0.0
            new = eval(change.format(value), {"__builtins__": {}})
            text = f"{new:g}" if float(new).is_integer() else f"{new:.6f}"
            if float(text) != value:
                changed = re.sub("(" + pattern + ")" + _NUMBER, rf"\g<1>{text}", line, count=1)
                yield f"set: {pattern.strip('^')} {change}", number, [line], [changed]


def _moved(line: str, number: int) -> Iterator[tuple[str, int, list[str], list[str]]]:
    kind = line.split()[0]
    for name, shift in SHIFTS.items():
        matches = list(re.finditer(rf"([{{,] ?){name} {_NUMBER}", line))
        for match in matches[-1:]:
            value = float(match[2]) + shift
            new = line[: match.start()] + f"{match[1]}{name} {value:.5f}" + line[match.end() :]
            yield f"moved: {name} of {kind}", number, [line], [new]


def _kind(code: str) -> str:
    return re.split(r"[\s{=(]", code, maxsplit=1)[0] + (
        f"({code.partition('(')[2].partition(',')[0].partition(')')[0]})"
        if code.startswith("BAS")
        else ""
    )


MUST_CATCH = tuple(
    f"put in: {line}"
    for line in (
        "BAS(#EX_BASE,1)",
        "$OV_PRO=100",
        "$SOFTN_END[1]=170.0",
        "$SOFTP_END[2]=0.0",
        "$APO.CORI=180.0",
        "$VEL_AXIS[1]=1",
        "$VEL_AXIS[4]=100",
        "$ACC_AXIS[1]=1",
        "$ROBROOT=$NULLFRAME",
        "WAIT SEC 1000000000",
        "INTERRUPT OFF 3",
        "INTERRUPT OFF",
        "ASYPTP {E1 0.0}",
        "INTERRUPT DECL 9 WHEN $IN[1]==TRUE DO ELSEWHERE()",
        "ELSEWHERE()",
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $VEL.CP=2.0",
        "IF $IN[1] THEN",
        "LOOP",
        "WHILE TRUE",
    )
)
"""Rules of which every single mutant must be noticed, wherever it stands."""
