"""One line of KRL code to one statement."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

from postproc.krl.text import program as krl
from postproc.krl.text.expression import ExpressionParser
from postproc.krl.text.lexer import KrlSyntaxError, TokenKind
from postproc.krl.text.literals import quick_literal
from postproc.krl.text.motion_statements import BLENDS, MOVES, end_spline, move, spline, written

BASIC_TYPES = frozenset({"INT", "REAL", "BOOL", "CHAR", "FRAME", "POS", "E6POS", "AXIS", "E6AXIS"})
_KEPT = """
SIGNAL STRUC ENUM IMPORT CHANNEL ANOUT ANIN DIGIN CONFIRM ON_ERROR_PROCEED ASYPTP ASYCONT ASYSTOP
ASYCANCEL TIME_BLOCK CONST_VEL STOP CCLOSE COPEN CREAD CWRITE SREAD SWRITE ERR_RAISE
"""
KNOWN_RAW = frozenset(_KEPT.split())
"""Instructions that are KRL but say nothing about motion: kept as written."""
_MOVE_FAST = re.compile(
    r"(PTP|LIN|SPTP|SLIN|SPL)(?:\s+([A-Za-z_]\w*)|\s*(\{[^{}\";]*\}))(?:\s+(C_[A-Z]+))?$",
    re.ASCII | re.IGNORECASE,
)
_DECLARE_FAST = re.compile(
    r"DECL\s+(E6POS|POS|FRAME|E6AXIS|AXIS)\s+([A-Za-z_]\w*)\s*=\s*(\{[^{}\";]*\})$",
    re.ASCII | re.IGNORECASE,
)
_NAME = re.compile(r"[$A-Za-z_][$\w]*", re.ASCII)
_LABEL = re.compile(r"([A-Za-z_]\w*)\s*:$", re.ASCII)


def parse_statement(code: str, comment: str, line: int) -> krl.Statement:
    """Return the statement of a line of code (not empty, no indentation, comment cut off)."""
    if code[:1] == "$":  # a variable of the system: no word of the language begins so
        return _assignment_call_or_declaration(code, comment, line)
    match = _MOVE_FAST.match(code)
    if match and (match.group(4) is None or match.group(4).upper() in BLENDS):
        target = _fast_target(match.group(2), match.group(3))
        if target is not None:
            blend = (match.group(4).upper(),) if match.group(4) else ()
            word = MOVES[match.group(1).upper()]
            return krl.Move(word=word, target=target, blend=blend, comment=comment, line=line)
    match = _DECLARE_FAST.match(code)
    if match:
        literal = quick_literal(match.group(3))
        if literal is not None:
            variable = krl.Variable(match.group(2), None, literal)
            return krl.Declaration(
                type_name=match.group(1), variables=(variable,), comment=comment, line=line
            )
    return _parse(code, comment, line)


def _fast_target(name: str | None, literal: str | None) -> krl.Value | None:
    if name is None:
        return quick_literal(literal or "{}")
    return None if name.upper() in BLENDS else krl.Expr(name)


def _parse(code: str, comment: str, line: int) -> krl.Statement:
    found = _NAME.match(code)
    word = found.group().upper() if found else ""
    handler = _HANDLERS.get(word)
    if handler is not None and not _is_assignment(code, word):
        parser = ExpressionParser(code, line)
        parser.take()
        statement = handler(parser)
        parser.finish()
        return replace(statement, comment=comment, line=line)
    if word in KNOWN_RAW and not _is_assignment(code, word):
        return krl.Raw(text=code, comment=comment, line=line)
    if word in _EXTERNAL and not _is_assignment(code, word):
        written_word, _, text = code.partition(" ")
        return krl.External(text.strip(), written_word.upper(), comment=comment, line=line)
    if not word:
        raise KrlSyntaxError(f"{code[:40]!r} is no KRL statement")
    label = _LABEL.match(code)
    if label:
        return krl.Control(word="LABEL", text=label.group(1), comment=comment, line=line)
    return _assignment_call_or_declaration(code, comment, line)


def _is_assignment(code: str, word: str) -> bool:
    rest = code[len(word) :].lstrip()
    return rest.startswith(("=", ".")) and not rest.startswith("==")


# -------------------------------------------------------------------- assignments, calls, DECL


def _assignment_call_or_declaration(code: str, comment: str, line: int) -> krl.Statement:
    found = _assignment_or_call(code)
    if found is None:
        parser = ExpressionParser(code)
        declaration = _declared(parser, set())
        parser.finish()
        return replace(declaration, comment=comment, line=line)
    name, arguments, value = found
    if arguments is not None:
        return krl.Call(name=name, arguments=arguments, comment=comment, line=line)
    return krl.Assign(target=name, value=value, comment=comment, line=line)


@lru_cache(maxsize=4096)
def _assignment_or_call(
    code: str,
) -> tuple[str, tuple[krl.Value | None, ...] | None, krl.Value] | None:
    """Return name, arguments of a call, value of an assignment; None where it is not one."""
    parser = ExpressionParser(code)
    first = parser.tokens[0].text
    second = parser.tokens[1]
    if second.kind is TokenKind.NAME and (first.upper() in BASIC_TYPES or "=" in code):
        return None
    if second.kind is TokenKind.END:
        raise KrlSyntaxError(_bare_word(first))
    parser.take()
    if second.text == "(":
        arguments = _arguments(parser)
        parser.finish()
        return first, arguments, 0
    parser.selectors()
    target = written(code[: parser.token.start])
    if not parser.accept("=") or first.upper() in ("TRUE", "FALSE"):
        raise KrlSyntaxError(f"{code[:40]!r} is no KRL statement")
    value = parser.value()
    parser.finish()
    return target, None, value


def _bare_word(word: str) -> str:
    if word.upper() == "INI":
        return "a bare INI is what the smartPAD shows; in a file the INI fold must stand open"
    return f"{word!r} alone is no statement; a call needs brackets"


def _arguments(parser: ExpressionParser) -> tuple[krl.Value | None, ...]:
    nodes: list[krl.Value | None] = []
    parser.expect("(")
    while True:
        nodes.append(None if parser.token.text in (",", ")") else parser.value())
        if parser.accept(")"):
            break
        parser.expect(",")
    return () if nodes == [None] else tuple(nodes)


def _declaration(parser: ExpressionParser) -> krl.Statement:
    """DECL, GLOBAL and CONST stand before declarations, GLOBAL also before an interrupt."""
    flags = {parser.tokens[0].text.upper()}
    if flags == {"GLOBAL"} and parser.accept("INTERRUPT"):
        interrupt = _interrupt(parser)
        return replace(interrupt, is_global=interrupt.word == "DECL")
    return _declared(parser, flags)


def _declared(parser: ExpressionParser, flags: set[str]) -> krl.Statement:
    while parser.word() in ("DECL", "GLOBAL", "CONST"):
        flags.add(parser.take().text.upper())
    type_name = parser.take()
    if type_name.kind is not TokenKind.NAME:
        raise KrlSyntaxError("a declaration needs a type")
    if type_name.text.upper() in ("STRUC", "ENUM", "SIGNAL"):
        parser.at = len(parser.tokens) - 1
        return krl.Raw(text=parser.text)
    variables = [_variable(parser)]
    while parser.accept(","):
        variables.append(_variable(parser))
    is_global, is_const, has_decl = (flag in flags for flag in ("GLOBAL", "CONST", "DECL"))
    return krl.Declaration(type_name.text, tuple(variables), is_global, is_const, has_decl)


def _variable(parser: ExpressionParser) -> krl.Variable:
    name = parser.take()
    if name.kind is not TokenKind.NAME:
        raise KrlSyntaxError(f"expected a name to declare, found {name.text!r}")
    dimension: str | None = None
    if parser.accept("["):
        start = parser.tokens[parser.at - 1].end
        while parser.token.text not in ("]", ""):
            parser.take()
        dimension = parser.text[start : parser.token.start].strip()
        parser.expect("]")
        # FDAT's POINT2[] and array elements with a value: NAME[2]={...}
    value = parser.value() if parser.accept("=") else None
    return krl.Variable(name.text, dimension, value)


# ------------------------------------------------------------------------------ waits, triggers


def _wait(parser: ExpressionParser) -> krl.Statement:
    word = parser.word()
    if word == "SEC":
        parser.take()
        return krl.WaitSec(parser.value())
    if word != "FOR":
        raise KrlSyntaxError("WAIT needs SEC or FOR")
    start = parser.take().end
    parser.expression()
    return krl.WaitFor(parser.text[start : parser.token.start].strip())


def _trigger(parser: ExpressionParser) -> krl.Statement:
    parser.expect("WHEN")
    word = parser.word()
    if word not in ("DISTANCE", "PATH"):
        raise KrlSyntaxError(f"TRIGGER needs DISTANCE or PATH, found {parser.here()}")
    parser.take()
    on_start = parser.accept("ONSTART")
    parser.expect("=")
    where = parser.value()
    on_start = parser.accept("ONSTART") or on_start
    parser.expect("DELAY")
    parser.expect("=")
    delay = parser.value()
    parser.expect("DO")
    start = parser.token.start
    while parser.token.kind is not TokenKind.END and not _at_priority(parser):
        parser.take()
    action = _action(parser, parser.text[start : parser.token.start])
    priority: krl.Value | None = None
    if parser.accept("PRIO"):
        parser.expect("=")
        priority = parser.value()
    return krl.Trigger(word, where, delay, action, priority, on_start)


def _action(parser: ExpressionParser, code: str) -> krl.Statement:
    """Return the statement behind DO."""
    return parse_statement(code.strip() or "?", "", parser.line)


def _at_priority(parser: ExpressionParser) -> bool:
    return parser.word() == "PRIO" and parser.tokens[parser.at + 1].text == "="


def _interrupt(parser: ExpressionParser) -> krl.Interrupt:
    word = parser.word()
    if word == "DECL":
        parser.take()
        priority = parser.value()
        parser.expect("WHEN")
        start = parser.token.start
        parser.expression()
        condition = parser.text[start : parser.token.start].strip()
        parser.expect("DO")
        action = _action(parser, parser.text[parser.token.start :])
        parser.at = len(parser.tokens) - 1
        return krl.Interrupt(word, priority, condition, action)
    if word not in ("ON", "OFF", "ENABLE", "DISABLE"):
        raise KrlSyntaxError("INTERRUPT needs DECL, ON, OFF, ENABLE or DISABLE")
    parser.take()
    value = None if parser.token.kind is TokenKind.END else parser.value()
    return krl.Interrupt(word, value)


# ------------------------------------------------------------------------------------- control


def _control(parser: ExpressionParser) -> krl.Statement:
    word = parser.tokens[0].text.upper()
    _CONTROL[word](parser)
    return krl.Control(word, parser.text[len(word) :].strip())


def _no_more(parser: ExpressionParser) -> None:
    """Words that stand alone."""


def _condition(parser: ExpressionParser) -> None:
    parser.expression()


def _if(parser: ExpressionParser) -> None:
    parser.expression()
    parser.expect("THEN")


def _for(parser: ExpressionParser) -> None:
    if parser.take().kind is not TokenKind.NAME:
        raise KrlSyntaxError("FOR needs a variable")
    parser.selectors()
    parser.expect("=")
    parser.expression()
    parser.expect("TO")
    parser.expression()
    if parser.accept("STEP"):
        parser.expression()


def _case(parser: ExpressionParser) -> None:
    parser.expression()
    while parser.accept(","):
        parser.expression()


def _optional(parser: ExpressionParser) -> None:
    if parser.token.kind is not TokenKind.END:
        parser.expression()


def _goto(parser: ExpressionParser) -> None:
    if parser.take().kind is not TokenKind.NAME:
        raise KrlSyntaxError("GOTO needs a label")


_ALONE = "ELSE ENDIF ENDFOR LOOP ENDLOOP ENDWHILE REPEAT DEFAULT ENDSWITCH EXIT RESUME"
_CONTROL: dict[str, Callable[[ExpressionParser], None]] = {
    **dict.fromkeys(_ALONE.split(), _no_more),
    **dict.fromkeys(("WHILE", "UNTIL", "SWITCH"), _condition),
    **dict.fromkeys(("RETURN", "BRAKE"), _optional),
    "IF": _if,
    "FOR": _for,
    "CASE": _case,
    "GOTO": _goto,
}


_EXTERNAL = frozenset({"EXT", "EXTFCT", "EXTP", "EXTFCTP"})
_HANDLERS: dict[str, Callable[[ExpressionParser], krl.Statement]] = {
    **dict.fromkeys(MOVES, move),
    **dict.fromkeys(_CONTROL, _control),
    **dict.fromkeys(("SPLINE", "PTP_SPLINE"), spline),
    **dict.fromkeys(("GLOBAL", "DECL", "CONST"), _declaration),
    "ENDSPLINE": end_spline,
    "WAIT": _wait,
    "HALT": lambda _: krl.Halt(),
    "CONTINUE": lambda _: krl.Continue(),
    "TRIGGER": _trigger,
    "INTERRUPT": _interrupt,
}
