"""The variables of a run: of all modules, of each module, of the routines that are at work."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from postproc import krl
from postproc.controller.control import Activation
from postproc.controller.runtime import (
    UNKNOWN,
    Evaluator,
    Variables,
    converted,
    text_of,
    with_component,
)
from postproc.controller.trace import World
from postproc.errors import SourceRef

_POSITIONS = {
    kind: {name: "INT" if name in "ST" else "REAL" for name in names}
    for kind, names in (krl.POSE_TYPES | krl.AXES_TYPES).items()
}


class Memory:
    """Variables by where they are known.

    Args:
        modules: of the run, by their names in upper case.
        world: frames and points of the controller.
        system_value: returns the value of a system variable by its name.
        function: calls a function by its name with the nodes of its arguments.
        stored: called with a reference and where it was stored, whenever a value has been.
        refused: called with what is wrong where a variable gets no value of its type; in a data
            list, with its file and line.
    """

    def __init__(
        self,
        modules: Mapping[str, krl.KrlModule],
        world: World,
        system_value: Callable[[str], Any],
        function: Callable[[str, tuple[krl.Node | None, ...]], Any],
        stored: Callable[[krl.Reference, Variables], None],
        refused: Callable[[str, SourceRef | None], None],
    ) -> None:
        self.evaluator, self._stored = Evaluator(self.lookup, system_value, function), stored
        self._refused = refused
        self._reading: SourceRef | None = None
        self._fields = dict(_POSITIONS)  # type of each component by the name of a structure
        self._everywhere, self._data = Variables(), {name: Variables() for name in modules}
        self._foreign: set[str] = set()
        """Variables that are declared in none of the files: of the controller."""
        self.stack: list[Activation] = []
        """The routines at work, the one that runs last."""
        for kind, poses in (("TOOL_DATA", world.tools), ("BASE_DATA", world.bases)):
            self._everywhere.arrays[kind] = {(number,): pose for number, pose in poses.items()}
        self._everywhere.plain.update({key.upper(): value for key, value in world.points.items()})

    def load(self, modules: Mapping[str, krl.KrlModule]) -> None:
        """Take in the structures and the data lists of the modules."""
        for module in modules.values():
            for routine in module.routines:
                self._learn(routine.statements)
            self._learn(module.listed)
        for name, module in modules.items():
            for statement in module.listed:
                scope = self._data[name]
                self._reading = SourceRef(module.dat_path, statement.line)
                if isinstance(statement, krl.Declaration):
                    public = statement.is_global or not module.routines
                    self._define(self._everywhere if public else scope, statement)
                elif isinstance(statement, krl.Assign):
                    self._initial(krl.parse_expression(statement.target), statement.value, scope)

        self._reading = None

    def _learn(self, statements: Iterable[krl.Statement]) -> None:
        """Note the types of the components of structures; of arrays in them none."""
        for text in [s.text for s in statements if type(s) is krl.Raw]:
            found = krl.structure_of(text)
            if found is not None:
                name, fields = found
                self._fields[name] = {n: kind.name for n, kind in fields.items() if not kind.sizes}

    def typed(self, value: Any, type_name: str, name: str) -> Any:  # noqa: ANN401
        """Return a value as what was declared so takes it, ``UNKNOWN`` where it cannot."""
        fields = self._fields.get(type_name.upper(), {})
        if isinstance(value, krl.Aggregate) and fields:
            items = [
                (key, self.typed(item, fields.get(key.upper(), ""), f"{name}.{key}"))
                for key, item in value.fields
            ]
            return replace(value, fields=tuple(items))
        found = converted(value, type_name.upper())
        if found is None:
            text = f"{name} is declared {type_name} and gets {text_of(value)}"
            self._refused(f"{text}: the controller stops there", self._reading)
            return UNKNOWN
        return found

    def _initial(self, node: krl.Node, value: krl.Value, scope: Variables) -> None:
        if isinstance(node, krl.Reference):
            holder = scope if node.name in scope else self._everywhere
            self._put(holder, node, self.evaluator.value(value))

    def declare(self, statement: krl.Declaration) -> None:
        """Declare variables of the routine that runs."""
        self._define(self.stack[-1].local, statement)

    def _define(self, scope: Variables, statement: krl.Declaration) -> None:
        for variable in statement.variables:
            name, type_name = variable.name.upper(), statement.type_name.upper()
            scope.types[name] = type_name
            if variable.dimension is not None:
                scope.arrays.setdefault(name, {})
            value = variable.value
            if isinstance(value, krl.Expr):
                value = self.evaluator.value(value)
            # A parameter is declared once more inside its routine: it keeps its value.
            if value is None:
                value = scope.plain.get(name, UNKNOWN)
            scope.plain[name] = self.typed(value, type_name, name)

    def lookup(self, name: str) -> Variables | None:
        """Return where a variable is known from the routine that runs; None where it is not."""
        if self.stack:
            run = self.stack[-1]
            if name in run.local:
                return run.local
            data = self._data[run.module.name.upper()]
            if name in data:
                return data
        return self._everywhere if name in self._everywhere else None

    def is_own(self, name: str) -> bool:
        """Return whether a variable is one of the routine or of its module, which no other sees."""
        scope = self.lookup(name)
        if scope is None or scope is self._everywhere:
            return False
        return name not in self._foreign or name in scope.types

    def put(self, node: krl.Reference, value: Any) -> None:  # noqa: ANN401 - KRL values are of many types
        """Store a value in a variable, an array element or a component of either."""
        scope = self.lookup(node.name)
        if scope is None:
            scope = self.stack[-1].local if self.stack else self._everywhere
            self._foreign.add(node.name)
        self._put(scope, node, value)

    def _put(self, scope: Variables, node: krl.Reference, value: Any) -> None:  # noqa: ANN401
        path = tuple(item for item in node.selectors if isinstance(item, str))
        index = next((item for item in node.selectors if not isinstance(item, str)), None)
        type_name = scope.types.get(node.name, "")
        for component in path:
            type_name = self._fields.get(type_name, {}).get(component, "")
        value = self.typed(value, type_name, ".".join((node.name, *path)))
        if index is None:
            old = scope.plain.get(node.name, UNKNOWN)
            scope.plain[node.name] = with_component(old, path, value) if path else value
        else:
            indices = self.evaluator.indices(index)
            if indices is None:
                scope.arrays.pop(node.name, None)
            else:
                elements = scope.arrays.setdefault(node.name, {})
                old = elements.get(indices, UNKNOWN)
                elements[indices] = with_component(old, path, value) if path else value
        self._stored(node, scope)
