"""Row 23: folds are balanced; the three texts of an inline form say the same."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import chain

from postproc.krl import text as krl
from postproc.krl.rules.part import Part, bas, number
from postproc.krl.rules.subject import WARNING, Subject
from postproc.records import dataclass

_FORM = re.compile(r"\s*(S?PTP|S?LIN|S?CIRC)\s+([A-Za-z_]\w*)(.*?)(?:;\s*%\{|%\{|$)", re.IGNORECASE)
_TOOL = re.compile(r"Tool\[(\d+)\]", re.IGNORECASE)
_BASE = re.compile(r"Base\[(\d+)\]", re.IGNORECASE)
_SPEED = re.compile(r"Vel=\s*([0-9.]+)", re.IGNORECASE)
_POINT_DATA = re.compile(r"2:([A-Za-z_]\w*)")
_BLEND_DATA = re.compile(r"3:(C_[A-Z]+)?")
_SPEED_DATA = re.compile(r"5:([0-9.]+)")
_TEXTS = (krl.Comment, krl.FoldBegin, krl.FoldEnd, krl.Blank)
_FORM_TARGETS = frozenset({"$BWDSTART", "PDAT_ACT", "LDAT_ACT", "FDAT_ACT", "$H_POS"})
_FORM_CALLS = frozenset({"BAS", "SET_CD_PARAMS"})


@dataclass(frozen=True, slots=True)
class Form:
    """An inline form: its visible text and the code within."""

    part: Part
    head: krl.FoldBegin
    code: tuple[krl.Statement, ...]


def folds(subject: Subject) -> None:
    """Row 23: every FOLD has its ENDFOLD; a fold may hold whole routines."""
    for module in subject.modules:
        parts = (
            (*part.of_kinds(krl.FoldBegin, krl.FoldEnd), *part.routine.after)
            for part in subject.parts_of(module)
        )
        _balance(subject, module.src_path, [*module.before, *chain.from_iterable(parts)])
        if module.data is not None:
            _balance(subject, module.dat_path, module.data.statements)


def _balance(subject: Subject, path: str, statements: Sequence[krl.Statement]) -> None:
    stack: list[krl.FoldBegin] = []
    for statement in statements:
        if isinstance(statement, krl.FoldBegin):
            stack.append(statement)
        elif isinstance(statement, krl.FoldEnd):
            if stack:
                stack.pop()
            else:
                subject.add(23, WARNING, path, statement.line, "ENDFOLD without FOLD")
    for fold in stack:
        subject.add(23, WARNING, path, fold.line, "FOLD without ENDFOLD: the pad shows a mess")


def forms(subject: Subject) -> None:
    """Row 23: visible text, form parameters, code and frame data agree; nothing typed in."""
    for part in subject.parts:
        for form in _forms(part):
            moves = [statement for statement in form.code if isinstance(statement, krl.Move)]
            if len(moves) != 1:
                part.warn(23, form.head.line, f"an inline form with {len(moves)} motions")
                continue
            _texts(form, moves[0])
            _frames(form, moves[0])
            _typed_in(form)


def _forms(part: Part) -> Iterator[Form]:
    """Yield the inline forms: folds whose text begins with a motion and a form's marks."""
    statements = part.routine.statements
    for index, statement in zip(part.places(krl.FoldBegin), part.of(krl.FoldBegin), strict=True):
        if not _is_form(statement.text):
            continue
        depth, end = 1, index + 1
        while end < len(statements) and depth:
            depth += isinstance(statements[end], krl.FoldBegin) - isinstance(
                statements[end], krl.FoldEnd
            )
            end += 1
        code = tuple(s for s in statements[index + 1 : end] if not isinstance(s, _TEXTS))
        yield Form(part, statement, code)


def _is_form(text: str) -> bool:
    return bool(_FORM.match(text)) and ("Vel=" in text or "%MKUKATPBASIS" in text)


def _texts(form: Form, move: krl.Move) -> None:
    part, line = form.part, form.head.line
    visible = _FORM.match(form.head.text)
    if visible is None:
        return
    word, name, rest = visible.group(1, 2, 3)
    if word.upper() != move.word.value:
        message = f"the form shows {word}, the code is {move.word.value}"
        goes_alike = word.upper().removeprefix("S") == move.word.value.removeprefix("S")
        (part.warn if goes_alike else part.error)(23, line, message)
    target = move.target.text.upper() if isinstance(move.target, krl.Expr) else ""
    if not _same_point(target, name):
        part.error(23, line, f"the form shows {name}, the code goes to {target or 'a literal'}")
    if bool(re.search(r"\bCONT\b", rest, re.IGNORECASE)) != bool(move.blend):
        shown = "CONT" if not move.blend else "no CONT"
        part.error(23, line, f"the form shows {shown}, the code does not")
    _speed(form, rest)
    _parameters(form, name, move)


def _same_point(a: str, b: str) -> bool:
    """Return whether two names are of one point; the code has an X in front of the form's."""
    return a.upper().removeprefix("X") == b.upper().removeprefix("X")


def _speed(form: Form, rest: str) -> None:
    shown = _SPEED.search(rest)
    if not shown:
        return
    for statement in form.code:
        command, argument = bas(statement)
        if command not in ("PTP_PARAMS", "CP_PARAMS", "VEL_PTP", "VEL_CP"):
            continue
        value = number(argument)
        if value is not None and abs(value - float(shown.group(1))) > 1e-6:
            message = f"the form shows Vel={shown.group(1)}, the code sets {value:g}"
            form.part.error(23, statement.line, message)


def _parameters(form: Form, name: str, move: krl.Move) -> None:
    """The ``%P`` data of forms up to KSS 8.5."""
    _, mark, data = form.head.text.partition("%P")
    if not mark:
        return
    part, line = form.part, form.head.line
    point = _POINT_DATA.search(data)
    if point and not _same_point(point.group(1), name):
        part.error(23, line, f"the form shows {name}, its parameters say {point.group(1)}")
    blend = _BLEND_DATA.search(data)
    if blend and bool(blend.group(1)) != bool(move.blend):
        part.error(23, line, "parameters and code of the form differ in blending")
    shown, stored = _SPEED.search(form.head.text), _SPEED_DATA.search(data)
    if shown and stored and abs(float(shown.group(1)) - float(stored.group(1))) > 1e-6:
        message = f"the form shows Vel={shown.group(1)}, its parameters say {stored.group(1)}"
        part.error(23, line, message)


def _frames(form: Form, move: krl.Move) -> None:
    """Tool and base as shown must be those of the frame data."""
    fdat = _frame_data(form, move)
    if fdat is None:
        return
    for pattern, field in ((_TOOL, "TOOL_NO"), (_BASE, "BASE_NO")):
        shown = pattern.search(form.head.text)
        stored = number(fdat.get(field))
        if shown and stored is not None and int(shown.group(1)) != stored:
            what = field[:4].lower()
            message = f"the form shows {what} {shown.group(1)}, its frame data say {stored:g}"
            form.part.error(23, form.head.line, message)


def _frame_data(form: Form, move: krl.Move) -> krl.Aggregate | None:
    module: krl.KrlModule = form.part.module
    names = [s.value for s in form.code if isinstance(s, krl.Assign) and s.target == "FDAT_ACT"]
    for setting in move.settings:
        if setting.target == "$TOOL" and isinstance(setting.value, krl.Expr):
            names.append(krl.Expr(setting.value.text.partition("(")[2].partition(")")[0].strip()))
    for name in names:
        value = form.part.subject.value(name, module)
        if isinstance(value, krl.Aggregate):
            return value
    return None


def _typed_in(form: Form) -> None:
    for statement in form.code:
        ok = isinstance(statement, krl.Move)
        if isinstance(statement, krl.Assign):
            ok = statement.target.upper() in _FORM_TARGETS
        elif isinstance(statement, krl.Call):
            ok = statement.name.upper() in _FORM_CALLS
        if not ok:
            message = "a line typed into a form: the next touch-up deletes it"
            form.part.warn(23, statement.line, message)
