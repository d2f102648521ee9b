"""Row 5: every name that is used is declared; every point that is declared is used."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import PurePath

from postproc.errors import listed
from postproc.krl import text as krl
from postproc.krl.rules.expressions import NAMELESS, move_values, values_of
from postproc.krl.rules.naming import BUILT_IN, global_names
from postproc.krl.rules.part import Part
from postproc.krl.rules.scope import DEFINES
from postproc.krl.rules.subject import ERROR, NOTE, WARNING, Subject
from postproc.records import dataclass

_SIMPLE = re.compile(r"(?!(?:TRUE|FALSE)\Z)[A-Za-z_]\w*\Z", re.ASCII | re.IGNORECASE)
_FORM_DATA = frozenset({"FDAT_ACT", "PDAT_ACT", "LDAT_ACT"})
_POINT_TYPES = frozenset({"E6POS", "POS", "FRAME", "E6AXIS", "AXIS"})
_EXTERNAL = re.compile(r"\s*(?:[A-Za-z_]\w*\s+)?([A-Za-z_]\w*)\s*(?:\(|$)")
_CONFIG = """
HOME XHOME XHOME1 XHOME2 XHOME3 XHOME4 XHOME5 FHOME PDEFAULT LDEFAULT SDEFAULT FDAT_ACT PDAT_ACT
LDAT_ACT TOOL_DATA BASE_DATA LOAD_DATA TOOL_NAME BASE_NAME TOOL_TYPE BASE_TYPE MACHINE_DEF
DEF_ADVANCE DEF_VEL_CP DEF_ACC_CP DEF_VEL_PTP DEF_ACC_PTP DEF_VEL_ORI1 DEF_VEL_ORI2 DEF_ACC_ORI1
DEF_ACC_ORI2 DEF_APO_CPTP DEF_APO_CDIS DEF_APO_CVEL DEF_APO_CORI DEF_CIRC_TYP DEF_ORI_TYP MAX_TOOL
MAX_BASE LOAD_A3_DATA ERSYSROOT BASIS_SUGG_T LAST_BASIS
"""
CONFIG_NAMES = frozenset(_CONFIG.split())
"""Data of a delivered $config.dat and of the basis package."""
_ROUTINES = """
USERSPOT USERSAW P00 P00_EXTERN CELL MASREF ERR_CLEAR H50 GLOBAL_POINTS SET_CD_PARAMS
INV ERSYS FRAME SVEL_JOINT SVEL_CP STOOL STOOL2 SBASE SLOAD
SAPO SAPO_PTP SAPO_CP SACC_JOINT SACC_CP SIPO_MODE SORI_TYP SGEAR_JERK SJERK USE_CM_PRO_VALUES
MSGNOTIFY MSGDIALOG MSGQUIT SET_USR_MSG CLEAR_USR_MSG EXISTS_MSG CLEAR_MSG GET_MSGBUFFER TIMER_LIMIT
"""
CONTROLLER_ROUTINES = BUILT_IN | frozenset(_ROUTINES.split())
"""Routines and functions of a delivered controller."""
_IMPORT = re.compile(
    r"(?:DECL\s+)?IMPORT\s.*?([A-Za-z_]\w*)\s*(?:\[[^\]]*\])?\s+IS\b", re.IGNORECASE
)
_OPTIONS = ("RSI", "EKI")
"""Names of options begin so: sensor interface, Ethernet."""
_MANY = 3
"""So many modules that use a name, or names that a module uses, are no slip of the pen."""
HOOK_PREFIX = "PP_"
"""The integrator's routines are called so unless the cell names them otherwise."""


def declared(subject: Subject) -> None:
    """Row 5: every name that is used is declared; every point that is declared is used."""
    known_data = {name.upper() for name in subject.options.names} | CONFIG_NAMES
    known_calls = {name.upper() for name in subject.options.routines} | CONTROLLER_ROUTINES
    for module in subject.modules:
        for name, _, _ in global_names(module):
            known_data.add(name.upper())
        known_data |= _data_names(module) if not module.routines else _global_types(module)
    missing: list[_Missing] = []
    for module in subject.modules:
        own = _data_names(module)
        used: set[str] = set()
        for part in subject.parts_of(module):
            part_known = known_data | own | _local_names(part)
            found = _check_uses(part, part_known, known_calls)
            used |= found.used
            missing += found.missing
        _unused_points(subject, module, used)
    if subject.options.is_project:
        _of_options(subject, missing)
    else:
        _of_single_modules(subject, missing)


@dataclass(frozen=True, slots=True)
class _Missing:
    """A name that is used and defined nowhere: where first, whether a routine or a taught point."""

    module: krl.KrlModule
    name: str
    is_call: bool
    line: int
    is_taught: bool = False


@dataclass(frozen=True, slots=True)
class _Uses:
    used: set[str]
    missing: list[_Missing]


def _of_single_modules(subject: Subject, missing: list[_Missing]) -> None:
    """Report missing names; one warning for all of a module that is part of something larger."""
    is_part = len({i.name for i in missing if not i.is_call and not i.is_taught}) >= _MANY
    for module in subject.modules:
        own = [item for item in missing if item.module is module]
        routines = [i for i in own if i.is_call and not i.name.startswith(HOOK_PREFIX)]
        data = [item for item in own if not item.is_call]
        is_optional = any(item.name.startswith(_OPTIONS) for item in routines)
        many = routines and len({item.name for item in data}) >= _MANY
        if data and (is_part or is_optional or many):
            names = _listed([item.name for item in (*routines, *data)])
            message = f"defined in modules that are not among these files: {names}"
            hint = "give the folder R1 of the controller, or --config $config.dat"
            line = min(item.line for item in own)
            subject.add(5, WARNING, module.src_path, line, message, hint)
            own = [i for i in own if i.is_call and i.name.startswith(HOOK_PREFIX)]
        for item in own:
            _undeclared(subject, item)


def _of_options(subject: Subject, missing: list[_Missing]) -> None:
    """Report missing names of a whole controller, those of its options in one warning."""
    users: dict[str, set[str]] = {}
    for item in missing:
        users.setdefault(item.name, set()).add(item.module.src_path)
    elsewhere = {
        i.name
        for i in missing
        if not i.is_call and (_is_system(i.module) or len(users[i.name]) >= _MANY)
    }
    first = next((item for item in missing if item.name in elsewhere), None)
    if first is not None:
        message = f"of options that are not among these files: {_listed(sorted(elsewhere))}"
        subject.add(5, WARNING, first.module.src_path, first.line, message)
    named: set[str] = set()
    for item in missing:
        if item.name not in elsewhere and not (item.is_call and item.name in named):
            _undeclared(subject, item)
            named.add(item.name)


def _is_system(module: krl.KrlModule) -> bool:
    folders = [part.upper() for part in PurePath(module.src_path).parts[:-1]]
    return bool({"SYSTEM", "TP"} & set(folders))


def _listed(names: list[str]) -> str:
    return listed(list(dict.fromkeys(names)), 8)


def _global_types(module: krl.KrlModule) -> set[str]:
    """Return signals and types that a data list makes known to all modules."""
    found: set[str] = set()
    for statement in module.listed:
        if isinstance(statement, krl.Raw) and statement.text.upper().startswith("GLOBAL"):
            found |= _defined_by(statement)
    return found


def _data_names(module: krl.KrlModule) -> set[str]:
    names: set[str] = set()
    for statement in module.listed:
        names |= _defined_by(statement)
    return names


def _local_names(part: Part) -> set[str]:
    names = {parameter.name.upper() for parameter in part.routine.parameters}
    return names.union(*map(_defined_by, part.of_kinds(krl.Declaration, krl.Raw)))


def _defined_by(statement: krl.Statement) -> set[str]:
    if isinstance(statement, krl.Declaration):
        return {variable.name.upper() for variable in statement.variables}
    if isinstance(statement, krl.Raw):
        found = DEFINES.match(statement.text)
        if found and found.group(1).upper() != "STRUC":
            return {found.group(2).upper()}
        imported = _IMPORT.match(statement.text)
        return {imported.group(1).upper()} if imported else set()
    return set()


def _check_uses(part: Part, known: set[str], known_calls: set[str]) -> _Uses:
    module = part.module
    external = {
        found.group(1).upper()
        for item in part.of(krl.External)
        if (found := _EXTERNAL.match(item.text))
    }
    for item in module.listed:
        if isinstance(item, krl.External) and (found := _EXTERNAL.match(item.text)):
            external.add(found.group(1).upper())
    used: set[str] = set()
    missing: dict[str, _Missing] = {}
    taught = set(_taught(part.different))
    for name, is_call, line in _uses(part.different):
        used.add(name)
        if name in missing or name.startswith("$"):
            continue
        if is_call:
            ok = name in known_calls or name in external or name in known
            ok = ok or part.subject.called(name, module) is not None
        else:
            ok = name in known
        if not ok:
            missing[name] = _Missing(module, name, is_call, line, name in taught)
    return _Uses(used, list(missing.values()))


def _taught(statements: Iterable[krl.Statement]) -> Iterator[str]:
    """Yield the names of points that are moved to and of the data of their forms."""
    for statement in statements:
        value: krl.Value | None = None
        if isinstance(statement, krl.Move):
            value = statement.target
        elif isinstance(statement, krl.Assign) and statement.target.upper() in _FORM_DATA:
            value = statement.value
        if isinstance(value, krl.Expr):
            yield value.text.strip().upper()


def _undeclared(subject: Subject, item: _Missing) -> None:
    path, line = item.module.src_path, item.line
    if not item.is_call:
        message = f"{item.name} is used and not declared"
        subject.add(5, ERROR, path, line, message, hint="declare it in the .dat")
        return
    if len(item.name) > krl.NAME_LENGTH:
        message = (
            f"{item.name} has {len(item.name)} characters, at most {krl.NAME_LENGTH} are legal"
        )
        subject.add(4, ERROR, path, line, message)
        return
    severity = NOTE if item.name.startswith(HOOK_PREFIX) else WARNING
    message = f"routine {item.name} is not among these files: it must be on the controller"
    subject.add(5, severity, path, line, message)


def _unused_points(subject: Subject, module: krl.KrlModule, used: set[str]) -> None:
    if module.data is None or not module.routines:
        return
    unused = [
        (variable.name, statement.line)
        for statement in module.data.statements
        if isinstance(statement, krl.Declaration)
        and statement.type_name.upper() in _POINT_TYPES
        and not statement.is_global
        for variable in statement.variables
        if variable.name.upper() not in used
    ]
    if unused:
        message = f"points that nothing uses: {listed([name for name, _ in unused], 5)}"
        subject.add(5, NOTE, module.dat_path, unused[0][1], message)


def _uses(statements: Iterable[krl.Statement]) -> Iterator[tuple[str, bool, int]]:
    """Yield (name in upper case, whether it is called, first line) of everything that is used."""
    said: set[str] = set()
    for statement in statements:
        kind = type(statement)
        if kind is krl.Move:
            values: Iterable[krl.Value | None] = move_values(statement)  # type: ignore[arg-type]
        else:
            values, texts = values_of(statement)
            if kind is krl.Call:
                yield statement.name.upper(), True, statement.line  # type: ignore[attr-defined]
            for text in texts:
                if text not in said:
                    said.add(text)
                    yield from _names_of_text(text, statement.line)
            if isinstance(statement, krl.Trigger | krl.Interrupt) and statement.action is not None:
                for name, is_call, _ in _uses((statement.action,)):
                    yield name, is_call, statement.line
        for value in values:
            if type(value) not in NAMELESS:
                yield from _names_of_value(value, statement.line)


def _names_of_value(value: krl.Value | None, line: int) -> Iterator[tuple[str, bool, int]]:
    if isinstance(value, krl.Expr):
        yield from _names_of_text(value.text, line)
    elif isinstance(value, krl.Aggregate):
        for _, item in value.fields:
            yield from _names_of_value(item, line)


def _names_of_text(text: str, line: int) -> Iterator[tuple[str, bool, int]]:
    text = text.strip()
    if _SIMPLE.match(text):
        yield text.upper(), False, line
        return
    try:
        for name, is_call in krl.names_in(krl.parse_expression(text)):
            yield name, is_call, line
    except krl.KrlSyntaxError:
        return  # row 1 has it
