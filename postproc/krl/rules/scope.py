"""What names stand for: the types of variables, structures and enumerations, as the files say.

A type that the files at hand do not tell is None, and no check says anything about it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from postproc.krl import text as krl
from postproc.krl.system import system_types, system_variables
from postproc.krl.text import components
from postproc.records import record

DEFINES = re.compile(
    r"(?:DECL\s+|GLOBAL\s+)*(SIGNAL|STRUC|ENUM|CHANNEL)\s*:?\s*([A-Za-z_]\w*)(.*)", re.IGNORECASE
)
"""A line that defines a signal, a structure, an enumeration or a channel: which, name, rest."""
_FIELD = re.compile(r"(?:([A-Za-z_]\w*)\s+)?([A-Za-z_]\w*)\s*(\[[^\]]*\])?$", re.ASCII)
_BETWEEN = re.compile(r",(?![^\[]*\])")
_FRAME = frozenset("XYZABC")
_STATUS = frozenset("ST")
_ROBOT = frozenset(f"A{i}" for i in range(1, 7))
_EXTERNAL = frozenset(f"E{i}" for i in range(1, 7))
_THREE = frozenset({"E1", "E2", "E3"})
_PDAT = "VEL ACC APO_DIST APO_MODE GEAR_JERK EXAX_IGN CB AXIS_VEL"
_LDAT = "VEL ACC APO_DIST APO_FAC AXIS_VEL AXIS_ACC ORI_TYP CIRC_TYP JERK_FAC GEAR_JERK EXAX_IGN CB"
POSE_TYPES: dict[str, frozenset[str]] = {
    "FRAME": _FRAME,
    "POS": _FRAME | _STATUS,
    "E3POS": _FRAME | _STATUS | _THREE,
    "E6POS": _FRAME | _STATUS | _EXTERNAL,
}
"""Components of the types of a place in space."""
AXES_TYPES: dict[str, frozenset[str]] = {
    "AXIS": _ROBOT,
    "E3AXIS": _ROBOT | _THREE,
    "E6AXIS": _ROBOT | _EXTERNAL,
}
"""Components of the types of joint angles."""
COMPONENTS: Mapping[str, frozenset[str]] = {
    **POSE_TYPES,
    **AXES_TYPES,
    "FDAT": frozenset(["TOOL_NO", "BASE_NO", "IPO_FRAME", "POINT2", "TQ_STATE"]),
    "PDAT": frozenset(_PDAT.split()),
    "LDAT": frozenset(_LDAT.split()),
    "LOAD": frozenset({"M", "CM", "J"}),
}
"""Components of the structures that every controller has and that programs write."""
_NUMBERS = frozenset({"INT", "REAL"})
_SCALARS = _NUMBERS | {"BOOL", "CHAR"}
LANGUAGE_TYPES = _SCALARS | COMPONENTS.keys()
"""Types that the language itself has."""
_TRUTH = frozenset({"==", "<>", "<", ">", "<=", ">=", "AND", "OR", "EXOR"})


Place = tuple[krl.KrlModule, krl.Routine | None]
"""Where a value stands: its module and routine, None in a data list."""
Called = Callable[[str, krl.KrlModule], tuple[krl.KrlModule, krl.Routine] | None]


@record(frozen=True, slots=True)
class Type:
    """A type by its name in upper case; ``rank``: how many indices an element takes.

    ``sizes``: the last of each index as declared, 0 where the files do not tell.
    """

    name: str
    rank: int = 0
    sizes: tuple[int, ...] = ()


_PLAIN = {bool: Type("BOOL"), int: Type("INT"), float: Type("REAL"), krl.Text: Type("CHAR")}


class Scope:
    """The names that the routines of some modules see.

    ``called`` gives the routine that a call from a module reaches, None if it is not here.
    """

    def __init__(self, modules: Sequence[krl.KrlModule], called: Called) -> None:
        self._called = called
        self.structures: dict[str, dict[str, Type] | None] = {}
        """Components of the structures that files define, None where two files differ."""
        self.enumerations: dict[str, frozenset[str] | None] = {}
        """Constants of the enumerations that files define, None where two files differ."""
        self._everywhere: dict[str, Type | None] = {}
        self._modules: dict[tuple[str, str], dict[str, Type | None]] = {}
        self._routines: dict[int, dict[str, Type | None]] = {}
        for module in modules:
            self._read(module)

    def _read(self, module: krl.KrlModule) -> None:
        data = module.listed
        self._modules[module.dat_path, module.name] = dict(_variables(data))
        for statement in data:
            seen = not module.routines or (
                isinstance(statement, krl.Declaration) and statement.is_global
            )
            for name, kind in _variables((statement,)) if seen else ():
                known = self._everywhere.setdefault(name, kind)
                self._everywhere[name] = kind if known == kind else None
        for statements in (data, *(routine.statements for routine in module.routines)):
            for text in [s.text for s in statements if type(s) is krl.Raw]:
                self._define(text)

    def _define(self, text: str) -> None:
        structure, found = structure_of(text), DEFINES.match(text)
        if structure is not None:
            name, fields = structure
            known = self.structures.setdefault(name, fields)
            self.structures[name] = fields if known == fields else None
        elif found and found.group(1).upper() == "ENUM":
            name = found.group(2).upper()
            constants = frozenset(found.group(3).upper().replace(",", " ").split())
            listed = self.enumerations.setdefault(name, constants)
            self.enumerations[name] = constants if listed == constants else None

    # -------------------------------------------------------------------------------------- types

    def is_type(self, name: str) -> bool:
        """Whether a type of this name is known, if only by its name."""
        here = name in self.structures or name in self.enumerations
        return here or name in LANGUAGE_TYPES or name in system_types()

    def components(self, kind: Type) -> frozenset[str] | None:
        """Return the names of a structure's components; None: not known."""
        fields = self.structures.get(kind.name)
        if fields is not None:
            return frozenset(fields)
        return None if kind.name in self.structures else COMPONENTS.get(kind.name)

    def constants(self, kind: Type) -> frozenset[str] | None:
        """Return the constants of an enumeration; None: not known."""
        return self.enumerations.get(kind.name)

    def family(self, kind: Type | None) -> str:
        """Return what takes the same values as a type; empty: not known."""
        if kind is None or kind.rank:
            return ""
        if kind.name in _NUMBERS:
            return "a number"
        if kind.name in POSE_TYPES:
            return "a pose"
        if kind.name in AXES_TYPES:
            return "joint angles"
        told = self.structures.get(kind.name) or self.enumerations.get(kind.name)
        return kind.name if told or kind.name in LANGUAGE_TYPES else ""

    # ---------------------------------------------------------------------------------- variables

    def variable(
        self, name: str, module: krl.KrlModule, routine: krl.Routine | None
    ) -> Type | None:
        """Return the type of a variable (upper case) where a routine or data list uses it."""
        if routine is not None:
            own = self._routines.get(id(routine))
            if own is None:
                own = {p.name.upper(): None for p in routine.parameters}
                own |= dict(_variables(routine.statements))
                self._routines[id(routine)] = own
            if name in own:
                return own[name]
        data = self._modules[module.dat_path, module.name]
        if name in data:
            return data[name]
        return self._everywhere.get(name) or _system_type(name)

    def parameters(self, module: krl.KrlModule, routine: krl.Routine) -> tuple[Type | None, ...]:
        """Return the types of a routine's parameters."""
        return tuple(self.variable(p.name.upper(), module, routine) for p in routine.parameters)

    def type_of(
        self, node: krl.Node, module: krl.KrlModule, routine: krl.Routine | None
    ) -> Type | None:
        """Return the type of an expression; None: not known, or a literal structure."""
        plain = _PLAIN.get(type(node))
        if plain is not None:
            return plain
        if isinstance(node, krl.Reference):
            return self._selected(node, self.variable(node.name, module, routine))
        if isinstance(node, krl.FunctionCall):
            target = self._called(node.name, module)
            result = target[1].result_type if target is not None else None
            return Type(result.upper()) if result and "[" not in result else None
        if isinstance(node, krl.Binary):
            return self._computed(node, module, routine)
        if isinstance(node, krl.Unary) and node.operator == "-":
            return self.type_of(node.operand, module, routine)
        return Type("BOOL") if isinstance(node, krl.Unary) and node.operator == "NOT" else None

    def _computed(
        self, node: krl.Binary, module: krl.KrlModule, routine: krl.Routine | None
    ) -> Type | None:
        if node.operator in _TRUTH:
            return Type("BOOL")
        left = self.type_of(node.left, module, routine)
        right = self.type_of(node.right, module, routine)
        is_number = self.family(left) == self.family(right) == "a number"
        return Type("REAL") if is_number and node.operator in "+-*/" else None

    def beyond(
        self, node: krl.Reference, module: krl.KrlModule, routine: krl.Routine | None
    ) -> str:
        """Return which elements an array has that a reference goes beyond; empty: it does not."""
        kind = self.variable(node.name, module, routine)
        for selector in node.selectors:
            if kind is None:
                return ""
            if isinstance(selector, str):
                kind = (self.structures.get(kind.name) or {}).get(selector)
                continue
            for index, size in zip(selector, kind.sizes, strict=False):
                if isinstance(index, krl.Unary) and index.operator == "-":
                    return f"elements 1 to {size}" if size else "no such element"
                if type(index) is int and size and not 1 <= index <= size:
                    return f"elements 1 to {size}"
            kind = Type(kind.name)
        return ""

    def _selected(self, node: krl.Reference, kind: Type | None) -> Type | None:
        for selector in node.selectors:
            if kind is None:
                return None
            if not isinstance(selector, str):
                is_element = kind.rank == len(selector) and selector
                kind = Type(kind.name) if is_element else None
            elif kind.name in POSE_TYPES or kind.name in AXES_TYPES:
                kind = Type("REAL")
            else:
                kind = (self.structures.get(kind.name) or {}).get(selector)
        return kind

    # ------------------------------------------------------------------------------------- values

    def mismatch(self, value: krl.Value | None, wanted: Type | None, place: Place) -> str:
        """Return what a value is that a type does not take; empty: it does, or who knows."""
        family = self.family(wanted)
        if wanted is None or not family or value is None:
            return ""
        if isinstance(value, krl.Enum):
            return self._constant(value, wanted)
        if isinstance(value, krl.Pose | krl.Axes | krl.Aggregate):
            return self._structure(value, wanted)
        node = _node(value)
        found = self.family(None if node is None else self.type_of(node, *place))
        # one character is its number as well
        texts = {family, found} <= {"CHAR", "a number"}
        if isinstance(node, krl.Text) and family == "a number" and len(node.value) != 1:
            return "a text"
        return "" if not found or found == family or texts else found

    def _constant(self, value: krl.Enum, wanted: Type) -> str:
        constants = self.constants(wanted)
        if constants is not None:
            return "" if value.name.upper() in constants else f"#{value.name}"
        return f"#{value.name}" if wanted.name in LANGUAGE_TYPES else ""

    def _structure(self, value: krl.Pose | krl.Axes | krl.Aggregate, wanted: Type) -> str:
        names = names_of(value)
        shown = f"{{{', '.join(names)}}}"
        if wanted.name in self.structures:
            return "" if set(names) <= (self.components(wanted) or set()) else shown
        if wanted.name in COMPONENTS:
            # a component that the type does not have is row 7
            return "" if set(names) & COMPONENTS[wanted.name] else shown
        return shown


def _system_type(name: str) -> Type | None:
    variable = system_variables().get(name)
    if variable is None or not variable.type:
        return None
    return Type(variable.type, 0 if variable.size is None else 1)


def declared_names(module: krl.KrlModule) -> frozenset[str]:
    """Return the variables, signals, structures and enumerations of a data list, in upper case."""
    statements = module.listed
    defined = (DEFINES.match(s.text) for s in statements if isinstance(s, krl.Raw))
    types = {found.group(2).upper() for found in defined if found}
    return frozenset(types | {name for name, _ in _variables(statements)})


def names_of(value: krl.Pose | krl.Axes | krl.Aggregate) -> list[str]:
    """Return the components that are written in a structure, without indices."""
    if isinstance(value, krl.Aggregate):
        return [name.upper().partition("[")[0] for name, _ in value.fields]
    return [name for name, _ in components(value)]


def _node(value: krl.Value) -> krl.Node | None:
    if not isinstance(value, krl.Expr):
        return value
    try:
        node = krl.parse_expression(value.text)
    except krl.KrlSyntaxError:
        return None  # row 1 has it
    return None if isinstance(node, krl.Structure) else node


def _variables(statements: Iterable[krl.Statement]) -> Iterator[tuple[str, Type | None]]:
    """Yield name and type of what is declared; of a signal only that it is there."""
    for statement in statements:
        if type(statement) is krl.Declaration:
            for variable in statement.variables:
                sizes = _sizes(variable.dimension)
                kind = Type(statement.type_name.upper(), len(sizes), sizes)
                yield variable.name.upper(), kind
        elif type(statement) is krl.Raw:
            found = DEFINES.match(statement.text)
            if found and found.group(1).upper() in ("SIGNAL", "CHANNEL"):
                yield found.group(2).upper(), None


def structure_of(text: str) -> tuple[str, dict[str, Type]] | None:
    """Return the name of a structure and the types of its components, None of another line."""
    found = DEFINES.match(text)
    if found is None or found.group(1).upper() != "STRUC":
        return None
    return found.group(2).upper(), dict(_fields(found.group(3)))


def _fields(text: str) -> Iterator[tuple[str, Type]]:
    """Yield name and type of the components of a structure."""
    kind = ""
    for item in _BETWEEN.split(text):
        found = _FIELD.match(item.strip())
        if found:
            kind = (found.group(1) or kind).upper()
            sizes = _sizes(found.group(3) and found.group(3)[1:-1])
            yield found.group(2).upper(), Type(kind, len(sizes), sizes)


def _sizes(dimension: str | None) -> tuple[int, ...]:
    """Return the declared sizes of an array, () for a single value."""
    parts = () if dimension is None else dimension.split(",")
    return tuple(int(part) if part.strip().isdigit() else 0 for part in parts)
