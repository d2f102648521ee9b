"""Row 27: types exist, and values fit what takes them."""

from __future__ import annotations

from functools import partial

from postproc.krl import text as krl
from postproc.krl.rules.expressions import nodes_of
from postproc.krl.rules.scope import COMPONENTS, LANGUAGE_TYPES, Place, Type, names_of
from postproc.krl.rules.subject import ERROR, WARNING, Subject
from postproc.krl.rules.values import nearest

_CONDITIONS = frozenset({"IF", "WHILE", "UNTIL"})
_POINTS = frozenset({"a pose", "joint angles", ""})


def types(subject: Subject) -> None:
    """Row 27: types exist, values fit what they are given to, motions go to points."""
    for module in subject.modules:
        if module.data is not None:
            for statement in module.data.statements:
                _given(subject, module.dat_path, (module, None), statement)
    for part in subject.parts:
        place = (part.module, part.routine)
        subject.each(part, partial(_given, subject, part.path, place))
        subject.each(part, partial(_elements, subject, part.path, place))
        for step in part.steps:
            if type(step.move.target) is not krl.Pose or step.move.auxiliary is not None:
                _target(subject, part.path, place, step.move)
        for statement in part.of_kinds(krl.Control, krl.WaitFor):
            _condition(subject, part.path, place, statement)
    _unknown(subject)


def _given(subject: Subject, path: str, place: Place, statement: krl.Statement) -> None:
    """Check what declarations and assignments give to variables."""
    if isinstance(statement, krl.Declaration):
        wanted = Type(statement.type_name.upper())
        for variable in statement.variables:
            if variable.value is not None:
                name, value = variable.name, variable.value
                _value(subject, path, place, statement.line, name, wanted, value)
    elif isinstance(statement, krl.Assign):
        kind = _type_of_target(subject, statement.target, place)
        if kind is not None:
            value = statement.value
            _value(subject, path, place, statement.line, statement.target, kind, value)


def _elements(subject: Subject, path: str, place: Place, statement: krl.Statement) -> None:
    """Check that elements of arrays exist."""
    for node in nodes_of(statement, "["):
        if isinstance(node, krl.Reference) and not node.name.startswith("$"):
            has = subject.scope.beyond(node, *place)
            if has:
                message = f"{node.name} has {has}: the program stops there"
                subject.add(27, ERROR, path, statement.line, message)


def _type_of_target(subject: Subject, target: str, place: Place) -> Type | None:
    try:
        node = krl.parse_expression(target)
    except krl.KrlSyntaxError:
        return None
    return subject.scope.type_of(node, *place) if isinstance(node, krl.Reference) else None


def _value(
    subject: Subject, path: str, place: Place, line: int, name: str, wanted: Type, value: krl.Value
) -> None:
    found = subject.scope.mismatch(value, wanted, place)
    if found:
        message = f"{name} is of type {wanted.name} and does not take {found}"
        subject.add(27, ERROR, path, line, message)
    elif isinstance(value, krl.Pose | krl.Axes) and wanted.name in COMPONENTS:
        unknown = [c for c in names_of(value) if c not in COMPONENTS[wanted.name]]
        if unknown:
            subject.add(7, ERROR, path, line, f"{wanted.name} has no component {unknown[0]}")


def _target(subject: Subject, path: str, place: Place, move: krl.Move) -> None:
    """A path leads to poses, a PTP to poses and joint angles."""
    for point in (move.target, move.auxiliary):
        if type(point) is krl.Pose or point is None:
            continue
        if isinstance(point, krl.Axes):
            family = "joint angles"
        elif isinstance(point, krl.Expr):
            kind = _type_of_target(subject, point.text, place)
            family = subject.scope.family(kind)
        else:
            continue
        if family not in _POINTS:
            message = f"{move.word.value} to {_shown(point)}, which is {family}: a point is needed"
            subject.add(27, ERROR, path, move.line, message)
        elif family == "joint angles" and not move.word.is_axis_motion:
            message = f"{move.word.value} to joint angles: only a PTP goes there"
            subject.add(27, ERROR, path, move.line, message)


def _condition(subject: Subject, path: str, place: Place, statement: krl.Statement) -> None:
    """A condition is true or false, and compares an enumeration with its own constants."""
    scope, line = subject.scope, statement.line
    nodes = list(nodes_of(statement, ""))
    is_asked = isinstance(statement, krl.WaitFor) or getattr(statement, "word", "") in _CONDITIONS
    family = scope.family(scope.type_of(nodes[0], *place)) if is_asked and nodes else "BOOL"
    if family not in ("BOOL", ""):
        message = f"a condition that is {family}: it must be true or false"
        subject.add(27, ERROR, path, line, message)
    for node in nodes:
        if isinstance(node, krl.Binary) and node.operator in ("==", "<>"):
            for constant, other in ((node.left, node.right), (node.right, node.left)):
                wanted = scope.type_of(other, *place)
                if isinstance(constant, krl.Enum) and scope.mismatch(constant, wanted, place):
                    message = f"#{constant.name} is compared with a {wanted and wanted.name}"
                    subject.add(27, ERROR, path, line, message)


def _shown(point: krl.Value | None) -> str:
    return point.text if isinstance(point, krl.Expr) else "a literal"


def _unknown(subject: Subject) -> None:
    """Report types that nothing defines: an error where a known one is meant."""
    known = {name.upper() for name in subject.options.names}
    lists = [(m.dat_path, m.data.statements) for m in subject.modules if m.data is not None]
    lines: dict[str, dict[str, int]] = {}
    for path, statements in (*lists, *((p.path, p.of(krl.Declaration)) for p in subject.parts)):
        for statement in statements:
            name = statement.type_name.upper() if isinstance(statement, krl.Declaration) else ""
            if name and name not in known and not subject.scope.is_type(name):
                lines.setdefault(path, {}).setdefault(name, statement.line)
    for path, names in lines.items():
        meant = {name: nearest(name, LANGUAGE_TYPES) for name in names}
        for name, near in meant.items():
            if near:
                subject.add(27, ERROR, path, names[name], f"no type {name}", f"{near} is meant")
        others = [name for name, near in meant.items() if not near]
        if others:
            message = f"types that are not defined in these files: {', '.join(others)}"
            subject.add(27, WARNING, path, names[others[0]], message)
