"""One line of KRL code to one statement."""

from __future__ import annotations

import re
from collections.abc import Callable
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
    """Return the statement of a line of code (not empty, no indentation, comment cut off).

    Raises:
        KrlSyntaxError: if the line is no KRL statement.
    """
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
        return handler(code, comment, line)
    if word in KNOWN_RAW and not _is_assignment(code, word):
        return krl.Raw(text=code, comment=comment, line=line)
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
        return _declaration(code, comment, line)
    name, arguments, value = found
    if arguments is not None:
        return krl.Call(name=name, arguments=arguments, comment=comment, line=line)
    return krl.Assign(target=name, value=value, comment=comment, line=line)


@lru_cache(maxsize=4096)
def _assignment_or_call(
    code: str,
) -> tuple[str, tuple[krl.Value | None, ...] | None, krl.Value] | None:
    """Return name, arguments of a call (None: none), value of an assignment; None: neither.

    Programs repeat such lines a thousand times.
    """
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
    if not parser.accept("="):
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


def _declaration(code: str, comment: str, line: int) -> krl.Statement:
    parser = ExpressionParser(code)
    flags = set()
    while parser.word() in ("DECL", "GLOBAL", "CONST"):
        flags.add(parser.take().text.upper())
    type_name = parser.take()
    if type_name.kind is not TokenKind.NAME:
        raise KrlSyntaxError("a declaration needs a type")
    if type_name.text.upper() in ("STRUC", "ENUM", "SIGNAL"):
        return krl.Raw(text=code, comment=comment, line=line)
    variables = [_variable(parser)]
    while parser.accept(","):
        variables.append(_variable(parser))
    parser.finish()
    return krl.Declaration(
        type_name=type_name.text,
        variables=tuple(variables),
        is_global="GLOBAL" in flags,
        is_const="CONST" in flags,
        has_decl="DECL" in flags,
        comment=comment,
        line=line,
    )


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


def _prefixed(code: str, comment: str, line: int) -> krl.Statement:
    """GLOBAL and DECL stand before declarations, GLOBAL also before an interrupt."""
    words = code.upper().split(None, 2)
    if words[:2] == ["GLOBAL", "INTERRUPT"]:
        return _interrupt(code, comment, line)
    return _declaration(code, comment, line)


# ------------------------------------------------------------------------------ waits, triggers


def _wait(code: str, comment: str, line: int) -> krl.Statement:
    parser = ExpressionParser(code)
    parser.take()
    word = parser.word()
    if word == "SEC":
        parser.take()
        seconds = parser.value()
        parser.finish()
        return krl.WaitSec(seconds=seconds, comment=comment, line=line)
    if word != "FOR":
        raise KrlSyntaxError("WAIT needs SEC or FOR")
    start = parser.take().end
    parser.expression()
    parser.finish()
    return krl.WaitFor(condition=code[start:].strip(), comment=comment, line=line)


def _halt(code: str, comment: str, line: int) -> krl.Statement:
    _alone(code)
    return krl.Halt(comment=comment, line=line)


def _continue(code: str, comment: str, line: int) -> krl.Statement:
    _alone(code)
    return krl.Continue(comment=comment, line=line)


def _alone(code: str) -> None:
    parser = ExpressionParser(code)
    parser.take()
    parser.finish()


def _trigger(code: str, comment: str, line: int) -> krl.Statement:
    parser = ExpressionParser(code)
    parser.take()
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
    action = parse_statement(code[start : parser.token.start].strip() or "?", "", line)
    priority: krl.Value | None = None
    if parser.accept("PRIO"):
        parser.expect("=")
        priority = parser.value()
    parser.finish()
    return krl.Trigger(
        word=word,
        where=where,
        delay_ms=delay,
        action=action,
        priority=priority,
        on_start=on_start,
        comment=comment,
        line=line,
    )


def _at_priority(parser: ExpressionParser) -> bool:
    return parser.word() == "PRIO" and parser.tokens[parser.at + 1].text == "="


def _interrupt(code: str, comment: str, line: int) -> krl.Statement:
    parser = ExpressionParser(code)
    is_global = parser.accept("GLOBAL")
    parser.expect("INTERRUPT")
    word = parser.word()
    if word == "DECL":
        parser.take()
        priority = parser.value()
        parser.expect("WHEN")
        start = parser.token.start
        parser.expression()
        condition = code[start : parser.token.start].strip()
        parser.expect("DO")
        action = parse_statement(code[parser.token.start :].strip() or "?", "", line)
        return krl.Interrupt(
            word=word,
            number=priority,
            condition=condition,
            action=action,
            is_global=is_global,
            comment=comment,
            line=line,
        )
    if word not in ("ON", "OFF", "ENABLE", "DISABLE"):
        raise KrlSyntaxError("INTERRUPT needs DECL, ON, OFF, ENABLE or DISABLE")
    parser.take()
    value = None if parser.token.kind is TokenKind.END else parser.value()
    parser.finish()
    return krl.Interrupt(word=word, number=value, comment=comment, line=line)


# ------------------------------------------------------------------------------------- control


def _control(code: str, comment: str, line: int) -> krl.Statement:
    parser = ExpressionParser(code)
    word = parser.take().text.upper()
    _CONTROL[word](parser)
    parser.finish()
    return krl.Control(word=word, text=code[len(word) :].strip(), comment=comment, line=line)


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


_CONTROL: dict[str, Callable[[ExpressionParser], None]] = {
    "IF": _if,
    "ELSE": _no_more,
    "ENDIF": _no_more,
    "FOR": _for,
    "ENDFOR": _no_more,
    "LOOP": _no_more,
    "ENDLOOP": _no_more,
    "WHILE": _condition,
    "ENDWHILE": _no_more,
    "REPEAT": _no_more,
    "UNTIL": _condition,
    "SWITCH": _condition,
    "CASE": _case,
    "DEFAULT": _no_more,
    "ENDSWITCH": _no_more,
    "EXIT": _no_more,
    "GOTO": _goto,
    "RETURN": _optional,
    "RESUME": _no_more,
    "BRAKE": _optional,
}


def _external(code: str, comment: str, line: int) -> krl.Statement:
    word, _, text = code.partition(" ")
    return krl.External(text=text.strip(), word=word.upper(), comment=comment, line=line)


_Handler = Callable[[str, str, int], krl.Statement]
_HANDLERS: dict[str, _Handler] = {
    **dict.fromkeys(MOVES, move),
    **dict.fromkeys(_CONTROL, _control),
    "SPLINE": spline,
    "PTP_SPLINE": spline,
    "ENDSPLINE": end_spline,
    "WAIT": _wait,
    "HALT": _halt,
    "CONTINUE": _continue,
    "TRIGGER": _trigger,
    "INTERRUPT": _interrupt,
    "GLOBAL": _prefixed,
    "DECL": _declaration,
    "CONST": _declaration,
    "EXT": _external,
    "EXTFCT": _external,
    "EXTP": _external,
    "EXTFCTP": _external,
}
