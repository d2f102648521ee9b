"""What is checked: modules, their names, and the motions of each routine in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import chain

from postproc.arrays import BoolArray
from postproc.errors import Finding, Severity, SourceRef
from postproc.krl import text as krl
from postproc.krl.rules.part import Part, RoutineKey, key_of
from postproc.krl.rules.scope import Scope
from postproc.krl.rules.values import Points, Written, points_among, written_in
from postproc.krl.system import system_variables
from postproc.records import record

ERROR, WARNING, NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE
HOUSE_ROWS = frozenset({8, 9, 11, 12, 18, 24})
"""Rows that programs of ours keep and a controller does not ask for: of its own modules they are
worth a look at most."""
_SHOWN = 100
"""So many findings of one code are listed per file."""


@record(frozen=True, slots=True)
class LintOptions:
    """What the controller is, and what else is there.

    Args:
        max_tool: MAX_TOOL; max_base: MAX_BASE.
        allow_zero: BAS(#TOOL,0) and BAS(#BASE,0) are meant.
        externals: number of external axes; None: not known.
        names: data that are defined elsewhere ($config.dat), in any case.
        routines: routines that are defined elsewhere (the integrator's), in any case.
        path_speed_max: $VEL_MA.CP [m/s]; path_speed_default: DEF_VEL_CP, where BAS clamps.
        orientation_speed_max: $VEL_MA.ORI [deg/s].
        is_project: the modules are those of a whole controller: what it has accepted is no error.
        max_bytes: larger files are worth a warning; max_points: more motions in a file as well.
    """

    max_tool: int = 16
    max_base: int = 32
    allow_zero: bool = False
    externals: int | None = None
    names: frozenset[str] = frozenset()
    routines: frozenset[str] = frozenset()
    path_speed_max: float = 3.0
    path_speed_default: float = 2.0
    orientation_speed_max: float = system_variables()["$VEL.ORI1"].most or 0.0
    is_project: bool = False
    max_bytes: int = 1_000_000
    max_points: int = 5_000


class Subject:
    """Modules under lint, with what the checks ask for again and again."""

    def __init__(self, modules: Sequence[krl.KrlModule], options: LintOptions) -> None:
        self.modules = tuple(modules)
        self.options = options
        self.findings: list[Finding] = []
        self._counts: dict[tuple[str, str], int] = {}
        self._added = 0

    # ----------------------------------------------------------------------------------- findings

    def add(
        self, row: int, severity: Severity, path: str, line: int, message: str, hint: str = ""
    ) -> None:
        """Add a finding of a row of the table."""
        if severity is ERROR and self.options.is_project and row in HOUSE_ROWS:
            severity = WARNING
        code = f"KRL1{row:02d}"
        key = (code, path)
        self._counts[key] = self._counts.get(key, 0) + 1
        self._added += 1
        if self._counts[key] <= _SHOWN:
            place = SourceRef(path, max(line, 1))
            self.findings.append(Finding(severity, code, message, source=place, hint=hint))

    def left_out(self) -> Iterator[Finding]:
        """Yield one note for every code and file with more findings than are listed."""
        for (code, path), count in self._counts.items():
            if count > _SHOWN:
                text = f"{count - _SHOWN} more findings of {code}"
                yield Finding(NOTE, code, text, source=SourceRef(path))

    def each(self, part: Part, check: Callable[[krl.Statement], None]) -> None:
        """Check what is telling in a routine, statement by statement.

        A program says the same few things a thousand times: what a check has found in order once,
        it is not asked again. It must look at nothing but the statement and its routine.
        """
        in_order: set[int] = set()
        for statement, said in part.telling:
            if said not in in_order:
                before = self._added
                check(statement)
                if said >= 0 and self._added == before:
                    in_order.add(said)

    # -------------------------------------------------------------------------------------- names

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """All routines."""
        return tuple(Part(m, routine, self) for m in self.modules for routine in m.routines)

    @cached_property
    def _parts_of(self) -> dict[int, tuple[Part, ...]]:
        """The routines of each module, by its identity."""
        found: dict[int, tuple[Part, ...]] = {id(module): () for module in self.modules}
        for part in self.parts:
            found[id(part.module)] += (part,)
        return found

    def parts_of(self, module: krl.KrlModule) -> tuple[Part, ...]:
        """Return the routines of a module."""
        return self._parts_of[id(module)]

    @cached_property
    def data(self) -> dict[tuple[str, str], dict[str, krl.Value]]:
        """Values of the data lists by name in upper case, by path and name of the module."""
        return {
            (module.dat_path, module.name): {
                name.upper(): value
                for name, value, _ in (module.data.values() if module.data is not None else ())
            }
            for module in self.modules
        }

    @cached_property
    def global_data(self) -> dict[str, krl.Value]:
        """Values that all modules see: GLOBAL ones, and those of modules without routines."""
        found: dict[str, krl.Value] = {}
        for module in self.modules:
            for statement in module.listed:
                if isinstance(statement, krl.Declaration) and (
                    statement.is_global or not module.routines
                ):
                    for variable in statement.variables:
                        if variable.value is not None:
                            found[variable.name.upper()] = variable.value
        return found

    def value(self, value: krl.Value | None, module: krl.KrlModule) -> krl.Value | None:
        """Return a value, or what the name stands for in the data lists; None if not known."""
        if not isinstance(value, krl.Expr):
            return value
        name = value.text.upper()
        own = self.data[module.dat_path, module.name].get(name)
        return own if own is not None else self.global_data.get(name)

    def point(self, value: krl.Value | None, module: krl.KrlModule) -> krl.Pose | krl.Axes | None:
        """Return the pose or the joint angles that a target stands for; None if not known."""
        kind = type(value)
        if kind is krl.Pose or kind is krl.Axes:
            return value  # type: ignore[return-value]
        found = self.value(value, module)
        return found if isinstance(found, krl.Pose | krl.Axes) else None

    @cached_property
    def written(self) -> tuple[Written, ...]:
        """All values that stand in the text and are no plain numbers."""
        return tuple(written_in(chain.from_iterable(map(files_of, self.modules))))

    @cached_property
    def points(self) -> Points:
        """All points that stand in the text."""
        return points_among(self.written)

    def points_at(self, chosen: BoolArray) -> Iterator[tuple[str, int, krl.Pose | krl.Axes]]:
        """Yield file, line and value of the chosen ``points`` (n,), in their order."""
        for place in self.points.place[chosen].tolist():
            path, line, value, _ = self.written[place]
            if isinstance(value, krl.Pose | krl.Axes):
                yield path, line, value

    # -------------------------------------------------------------------------------------- calls

    @cached_property
    def routines(self) -> dict[str, tuple[krl.KrlModule, krl.Routine]]:
        """Routines that any module can call: modules by name, GLOBAL routines."""
        found: dict[str, tuple[krl.KrlModule, krl.Routine]] = {}
        for module in self.modules:
            for routine in module.routines:
                if routine.is_global:
                    found[routine.name.upper()] = (module, routine)
            if module.routines:
                found[module.main.name.upper()] = (module, module.main)
        return found

    def called(self, name: str, module: krl.KrlModule) -> tuple[krl.KrlModule, krl.Routine] | None:
        """Return the routine that a call reaches, None if it is not here."""
        local = module.routine(name)
        return (module, local) if local is not None else self.routines.get(name.upper())

    @cached_property
    def scope(self) -> Scope:
        """What names stand for, as far as the files say."""
        return Scope(self.modules, self.called)

    @cached_property
    def called_routines(self) -> frozenset[RoutineKey]:
        """All routines that something here calls."""
        found = set()
        for part in self.parts:
            for call in part.calls:
                target = self.called(call.name, part.module)
                if target is not None and target[1] is not part.routine:
                    found.add(key_of(*target))
        return frozenset(found)

    @cached_property
    def moving(self) -> frozenset[RoutineKey]:
        """Routines that move the robot, by themselves or by what they call."""
        moving = {part.key for part in self.parts if part.steps}
        while True:
            more = {
                part.key
                for part in self.parts
                if part.key not in moving
                and any(
                    (target := self.called(call.name, part.module)) is not None
                    and key_of(*target) in moving
                    for call in part.calls
                )
            }
            if not more:
                return frozenset(moving)
            moving |= more

    def entries(self) -> Iterator[tuple[krl.KrlModule, krl.Routine]]:
        """Yield what an operator selects: modules that move and that no other module calls."""
        for module in self.modules:
            key = key_of(module, module.main) if module.routines else None
            if key in self.moving and key not in self.called_routines:
                yield module, module.main

    def walk(
        self, module: krl.KrlModule, routine: krl.Routine, *kinds: type[krl.Statement]
    ) -> Iterator[tuple[krl.KrlModule, krl.Statement]]:
        """Yield statements in the order of the text, what is called at its first call."""
        seen = {key_of(module, routine)}
        stack = [(module, self._walked(module, routine, kinds))]
        while stack:
            here, statements = stack[-1]
            for statement in statements:
                if type(statement) is not krl.Call:
                    yield here, statement
                    continue
                if not kinds or krl.Call in kinds:
                    yield here, statement
                target = self.called(statement.name, here)
                if target is not None and key_of(*target) not in seen:
                    seen.add(key_of(*target))
                    stack.append((target[0], self._walked(*target, kinds)))
                    break
            else:
                stack.pop()

    def _walked(
        self, module: krl.KrlModule, routine: krl.Routine, kinds: tuple[type[krl.Statement], ...]
    ) -> Iterator[krl.Statement]:
        """Return the statements of a routine that a walk sees: of the kinds, and calls."""
        if not kinds:
            return iter(routine.statements)
        part = next(part for part in self.parts_of(module) if part.routine is routine)
        return iter(part.of_kinds(*{*kinds, krl.Call}))


Rule = Callable[[Subject], None]


def files_of(module: krl.KrlModule) -> Iterator[tuple[str, Sequence[krl.Statement]]]:
    """Yield everything in a module: statements of a routine or a list, each with its file."""
    for routine in module.routines:
        yield module.src_path, routine.statements
        yield module.src_path, routine.after
    yield module.src_path, module.before
    if module.data is not None:
        yield module.dat_path, module.data.before
        yield module.dat_path, module.data.statements
