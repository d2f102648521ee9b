"""A KRL program as data: what the emitters fill, the renderer prints and the reader returns.

Units are KRL's own, as the field names say: mm, degrees, m/s, milliseconds. A routine is a FLAT
list of statements in the order of its lines: ``IF`` and ``ENDIF``, ``;FOLD`` and ``;ENDFOLD``,
``SPLINE`` and ``ENDSPLINE`` are statements of their own, so that a program with an unbalanced block
can be represented, and lint can say where it is unbalanced. What the reader does not know is kept
as ``Raw``.

Two statements are equal when they say the same: the source line does not count.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum
from typing import TypeAlias

from postproc.errors import Finding
from postproc.krl.text.source import TextFacts
from postproc.records import record

_RANGE = re.compile(r"(.+?)=(.+?)\bTO\b(.+?)(?:\bSTEP\b(.+))?$", re.IGNORECASE)
_THEN = re.compile(r"\bTHEN\s*$", re.IGNORECASE)

# --------------------------------------------------------------------------------------- values


_Number: TypeAlias = float | None
Six: TypeAlias = tuple[_Number, _Number, _Number, _Number, _Number, _Number]
"""What a point says first; None where it does not."""


@record(frozen=True, slots=True)
class Pose:
    """A FRAME, POS or E6POS literal; ``None`` marks a component that is not written.

    ``type_name`` is the prefix inside the braces (``{E6POS: X 1}``), empty without one.
    ``external``: E1..Ek in order [mm or deg].
    """

    x_mm: float | None = None
    y_mm: float | None = None
    z_mm: float | None = None
    a_deg: float | None = None
    b_deg: float | None = None
    c_deg: float | None = None
    status: int | None = None
    turn: int | None = None
    external: tuple[float, ...] = ()
    type_name: str = ""

    @property
    def six(self) -> Six:
        """X, Y, Z, A, B, C [mm, deg]."""
        return self.x_mm, self.y_mm, self.z_mm, self.a_deg, self.b_deg, self.c_deg

    @property
    def is_complete(self) -> bool:
        """Whether X, Y, Z, A, B and C are all written."""
        return None not in self.six


@record(frozen=True, slots=True)
class Axes:
    """An AXIS or E6AXIS literal; ``None`` marks a component that is not written."""

    a1_deg: float | None = None
    a2_deg: float | None = None
    a3_deg: float | None = None
    a4_deg: float | None = None
    a5_deg: float | None = None
    a6_deg: float | None = None
    external: tuple[float, ...] = ()
    type_name: str = ""

    @property
    def six(self) -> Six:
        """A1..A6 [deg]."""
        return self.a1_deg, self.a2_deg, self.a3_deg, self.a4_deg, self.a5_deg, self.a6_deg

    @property
    def is_complete(self) -> bool:
        """Whether A1..A6 are all written."""
        return None not in self.six


@record(frozen=True, slots=True)
class Text:
    """A character string literal, without its quotes."""

    value: str


@record(frozen=True, slots=True)
class Enum:
    """An enumeration constant such as ``#BASE``, without the hash mark."""

    name: str


@record(frozen=True, slots=True)
class Expr:
    """Anything else with a value: a variable, a function call, a formula, ``a:b``; as written."""

    text: str


@record(frozen=True, slots=True)
class Aggregate:
    """A structure literal that is neither a pose nor axes: LOAD, FDAT, PDAT, LDAT and any other.

    Component names are as written, without the brackets of an array (``POINT2[]``): those stay part
    of the name. Poses and axes with components that are not numbers are kept here as well.
    """

    fields: tuple[tuple[str, Value], ...]
    type_name: str = ""

    def get(self, name: str) -> Value | None:
        """Return a component by name, whatever its case; None if it is not written."""
        wanted = name.upper()
        return next((value for key, value in self.fields if key.upper() == wanted), None)


Value: TypeAlias = float | int | bool | Text | Enum | Expr | Pose | Axes | Aggregate
"""A Python float is a REAL, an int an INT, a bool a BOOL."""


# ----------------------------------------------------------------------------------- statements


@record(frozen=True, slots=True, kw_only=True)
class Statement:
    """One line of a routine or data list.

    ``comment``: what follows the ``;`` at the end of the line, empty without one. ``line``: 1-based
    line of the file it was read from, 0 for a statement that was never in a file.
    """

    comment: str = ""
    line: int = field(default=0, compare=False)


class MoveWord(StrEnum):
    """The motion instructions."""

    PTP = "PTP"
    LIN = "LIN"
    CIRC = "CIRC"
    PTP_REL = "PTP_REL"
    LIN_REL = "LIN_REL"
    CIRC_REL = "CIRC_REL"
    SPTP = "SPTP"
    SLIN = "SLIN"
    SCIRC = "SCIRC"
    SPL = "SPL"
    SPTP_REL = "SPTP_REL"
    SLIN_REL = "SLIN_REL"
    SCIRC_REL = "SCIRC_REL"
    SPL_REL = "SPL_REL"

    is_spline: bool
    """Whether this is one of the newer motions, which do not blend with the classic ones."""
    is_axis_motion: bool
    """Whether the robot moves point to point, free of a path."""
    is_circular: bool
    """Whether the motion has an auxiliary point."""
    is_relative: bool
    """Whether the target is a shift from where the robot is."""

    def __init__(self, word: str) -> None:
        self.is_spline = word.startswith("S")
        self.is_axis_motion = "PTP" in word
        self.is_circular = "CIRC" in word
        self.is_relative = word.endswith("_REL")


@record(frozen=True, slots=True)
class Move(Statement):
    """A motion.

    Args:
        word: which one.
        target: end point: a literal, or an expression such as a point name.
        auxiliary: point on the way of a circular motion.
        angle_deg: value of ``CA``, the arc angle, or None.
        blend: ``C_DIS``, ``C_PTP``, ... in the order written, empty = exact stop.
        settings: what follows ``WITH``.
        frame: ``#BASE`` or ``#TOOL`` behind a relative motion, without the hash mark.
    """

    word: MoveWord
    target: Value
    auxiliary: Value | None = None
    angle_deg: Value | None = None
    blend: tuple[str, ...] = ()
    settings: tuple[Assign, ...] = ()
    frame: str = ""


@record(frozen=True, slots=True)
class SplineBegin(Statement):
    """``SPLINE`` or ``PTP_SPLINE``, the head of a block."""

    word: str = "SPLINE"
    settings: tuple[Assign, ...] = ()


@record(frozen=True, slots=True)
class SplineEnd(Statement):
    """``ENDSPLINE`` with its approximation."""

    blend: tuple[str, ...] = ()


@record(frozen=True, slots=True)
class Assign(Statement):
    """``target = value``; ``target`` as written, upper case for system variables (``$VEL.CP``)."""

    target: str
    value: Value


@record(frozen=True, slots=True)
class Call(Statement):
    """A call of a routine, ``BAS`` among them; an argument left out is None."""

    name: str
    arguments: tuple[Value | None, ...] = ()


@record(frozen=True, slots=True)
class WaitSec(Statement):
    """``WAIT SEC`` with seconds."""

    seconds: Value


@record(frozen=True, slots=True)
class WaitFor(Statement):
    """``WAIT FOR`` a condition, as written."""

    condition: str


@record(frozen=True, slots=True)
class Halt(Statement):
    """``HALT``: the program stands until the operator starts it again."""


@record(frozen=True, slots=True)
class Continue(Statement):
    """``CONTINUE``: the next line does not stop the advance run."""


@record(frozen=True, slots=True)
class Trigger(Statement):
    """``TRIGGER WHEN DISTANCE|PATH = where DELAY = ms DO action [PRIO = n]``.

    ``word`` is ``DISTANCE`` or ``PATH``; ``where`` is 0 or 1 for a distance, mm for a path;
    ``on_start``: ``PATH ... ONSTART``.
    """

    word: str
    where: Value
    delay_ms: Value
    action: Statement
    priority: Value | None = None
    on_start: bool = False


@record(frozen=True, slots=True)
class Interrupt(Statement):
    """``INTERRUPT DECL|ON|OFF|ENABLE|DISABLE``; condition and action only with ``DECL``."""

    word: str
    number: Value | None = None
    condition: str = ""
    action: Statement | None = None
    is_global: bool = False


@record(frozen=True, slots=True)
class Control(Statement):
    """A line of program control: ``word`` in upper case and the rest of the line as written.

    Words: IF ELSE ENDIF FOR ENDFOR LOOP ENDLOOP WHILE ENDWHILE REPEAT UNTIL SWITCH CASE DEFAULT
    ENDSWITCH EXIT GOTO RETURN RESUME BRAKE, and LABEL with the label's name as text (``name:``).
    """

    word: str
    text: str = ""

    @property
    def expressions(self) -> tuple[str, ...]:
        """Its condition or value; of FOR the variable, the first, the last value and the step."""
        text = self.text.strip()
        if self.word == "IF":
            return (_THEN.sub("", text),)
        if self.word == "FOR":
            found = _RANGE.match(text)
            return tuple(part for part in found.groups() if part) if found else ()
        is_one = self.word in ("WHILE", "UNTIL", "SWITCH", "RETURN") and text
        return (text,) if is_one else ()


@record(frozen=True, slots=True)
class Variable:
    """A declared name; ``dimension`` is the text between its brackets, None without brackets."""

    name: str
    dimension: str | None = None
    value: Value | None = None


@record(frozen=True, slots=True)
class Declaration(Statement):
    """``[DECL] [GLOBAL] [CONST] type name[, name]``, in a data list also with a value."""

    type_name: str
    variables: tuple[Variable, ...]
    is_global: bool = False
    is_const: bool = False
    has_decl: bool = True


@record(frozen=True, slots=True)
class External(Statement):
    """``EXT name(...)`` or ``EXTFCT``: ``text`` is the whole line behind the word."""

    text: str
    word: str = "EXT"


@record(frozen=True, slots=True)
class FoldBegin(Statement):
    """``;FOLD text``: everything behind the word, form parameters included."""

    text: str = ""


@record(frozen=True, slots=True)
class FoldEnd(Statement):
    """``;ENDFOLD text``."""

    text: str = ""


@record(frozen=True, slots=True)
class Comment(Statement):
    """A line that is only a comment; ``text`` is all that follows the ``;``."""

    text: str


@record(frozen=True, slots=True)
class Blank(Statement):
    """An empty line."""


@record(frozen=True, slots=True)
class Raw(Statement):
    """A line that is none of the above, without its indentation and trailing comment."""

    text: str

    @property
    def word(self) -> str:
        """Its first word in upper case, empty where there is none."""
        return next(iter(self.text.upper().replace("(", " ").split()), "")


# ------------------------------------------------------------------------------------- modules


@record(frozen=True, slots=True)
class Parameter:
    """A parameter of a routine; ``mode`` is ``IN``, ``OUT`` or empty."""

    name: str
    mode: str = ""
    dimension: str | None = None


@record(frozen=True, slots=True)
class Routine:
    """``DEF name(...)`` or ``DEFFCT type name(...)`` up to its ``END``.

    ``statements``: declarations included, in order. ``after``: comments and empty lines between
    its ``END`` and the next routine. ``is_closed`` is False when the file ends before ``END``.
    """

    name: str
    statements: tuple[Statement, ...]
    parameters: tuple[Parameter, ...] = ()
    result_type: str | None = None
    is_global: bool = False
    after: tuple[Statement, ...] = ()
    is_closed: bool = True
    comment: str = ""
    line: int = field(default=0, compare=False)
    end_line: int = field(default=0, compare=False)


@record(frozen=True, slots=True)
class DataList:
    """``DEFDAT name [PUBLIC]`` up to ``ENDDAT``: the module's .dat file.

    ``attributes``: header lines without ``&``. ``before``: lines between header and ``DEFDAT``.
    """

    name: str
    statements: tuple[Statement, ...] = ()
    is_public: bool = False
    attributes: tuple[str, ...] = ()
    before: tuple[Statement, ...] = ()
    is_closed: bool = True
    comment: str = ""
    line: int = field(default=0, compare=False)
    end_line: int = field(default=0, compare=False)

    def values(self) -> Iterator[tuple[str, Value, int]]:
        """Yield target, value and line of all that the list gives a value, in its order.

        A target is a name, or as written in an assignment: ``TOOL_DATA[3]``.
        """
        for statement in self.statements:
            if isinstance(statement, Assign):
                yield statement.target, statement.value, statement.line
            elif isinstance(statement, Declaration):
                for variable in statement.variables:
                    if variable.value is not None:
                        yield variable.name, variable.value, statement.line


@record(frozen=True, slots=True)
class KrlModule:
    """A module: ``name.src`` and, where it has data, ``name.dat``.

    Args:
        name: base name of the files; the first routine and the data list should be called so.
        routines: the first is the one that a caller by the module's name gets.
        data: the .dat file, None without one.
        attributes: header lines of the .src without ``&`` (``ACCESS RVP``).
        before: comments and empty lines between header and the first ``DEF``.
        src_path: file names as given by the reader, empty for an emitted module; dat_path likewise.
        problems: lines that the reader could not take (kept as ``Raw``), for a module it has read.
        src_facts: how the files are written (line ends, encoding), for a module it has read.
    """

    name: str
    routines: tuple[Routine, ...]
    data: DataList | None = None
    attributes: tuple[str, ...] = ()
    before: tuple[Statement, ...] = ()
    src_path: str = field(default="", compare=False)
    dat_path: str = field(default="", compare=False)
    problems: tuple[Finding, ...] = field(default=(), compare=False)
    src_facts: TextFacts | None = field(default=None, compare=False)
    dat_facts: TextFacts | None = field(default=None, compare=False)

    @property
    def listed(self) -> tuple[Statement, ...]:
        """The statements of the data list, none without one."""
        return () if self.data is None else self.data.statements

    @property
    def main(self) -> Routine:
        """The first routine."""
        return self.routines[0]

    def routine(self, name: str) -> Routine | None:
        """Return a routine by name, whatever its case."""
        wanted = name.upper()
        return next((item for item in self.routines if item.name.upper() == wanted), None)


FIELDS: dict[type[Pose] | type[Axes], dict[str, str]] = {
    Pose: dict(X="x_mm", Y="y_mm", Z="z_mm", A="a_deg", B="b_deg", C="c_deg", S="status", T="turn"),
    Axes: {f"A{i}": f"a{i}_deg" for i in range(1, 7)},
}
"""Components of a point, and the fields that hold them; E1..E6 stand in ``external``."""
CLOSERS = {
    "IF": "ENDIF",
    "FOR": "ENDFOR",
    "LOOP": "ENDLOOP",
    "WHILE": "ENDWHILE",
    "REPEAT": "UNTIL",
    "SWITCH": "ENDSWITCH",
}
"""Words that open a block of lines, and those that close it."""
OPENERS = {closer: opener for opener, closer in CLOSERS.items()}
BRANCHES = {"ELSE": "IF", "CASE": "SWITCH", "DEFAULT": "SWITCH"}
"""Words that part a block, and the word that opens it."""
LOOPS = frozenset({"FOR", "LOOP", "WHILE", "REPEAT"})
