"""What is checked: modules, their names, and the motions of each routine in order."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from functools import cached_property
from itertools import chain
from typing import TypeVar

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import Finding, Severity, SourceRef
from postproc.krl.rules.scope import Scope
from postproc.krl.rules.values import PLAIN, Points, Written, points_among, written_in
from postproc.krl.text import (
    Assign,
    Axes,
    Blank,
    Call,
    Comment,
    Declaration,
    Enum,
    Expr,
    FoldBegin,
    FoldEnd,
    Interrupt,
    KrlModule,
    Move,
    Pose,
    Routine,
    SplineBegin,
    SplineEnd,
    Statement,
    Trigger,
    Value,
)
from postproc.records import dataclass

ERROR, WARNING, NOTE = Severity.ERROR, Severity.WARNING, Severity.NOTE
HOUSE_ROWS = frozenset({8, 9, 11, 12, 18, 24})
"""Rows that programs of ours keep and a controller does not ask for: of its own modules they are
worth a look at most."""
_S = TypeVar("_S", bound=Statement)
_TEXTS = frozenset({Comment, Blank, FoldBegin, FoldEnd})
"""Lines for people."""
_LITERAL_TARGETS = frozenset({Pose, Axes})
_SHOWN = 100
"""So many findings of one code are listed per file."""


@dataclass(frozen=True, slots=True)
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
    orientation_speed_max: float = 400.0
    is_project: bool = False
    max_bytes: int = 1_000_000
    max_points: int = 5_000


@dataclass(frozen=True, slots=True)
class Step:
    """A motion of a routine: place in its statements, and the target if it is known."""

    index: int
    move: Move
    target: Pose | Axes | None


def position_of(point: Pose | Axes | None) -> tuple[float | None, ...]:
    """Return X, Y, Z [mm] of a point, as an array turns them into NaN where it has none."""
    if type(point) is Pose:
        return point.x_mm, point.y_mm, point.z_mm
    return _NO_POSITION


_NO_POSITION = (None, None, None)


RoutineKey = tuple[str, str, str, int]


def key_of(module: KrlModule, routine: Routine) -> RoutineKey:
    """Return what tells a routine from all others: file, module, name, line."""
    return module.src_path, module.name, routine.name, routine.line


@dataclass(slots=True)
class Part:
    """One routine of one module."""

    module: KrlModule
    routine: Routine
    subject: Subject

    @property
    def path(self) -> str:
        """The .src file."""
        return self.module.src_path

    @property
    def key(self) -> RoutineKey:
        """What tells the routine from all others."""
        return key_of(self.module, self.routine)

    steps: tuple[Step, ...] = field(init=False)
    """Motions in the order of the text."""
    in_block: frozenset[int] = field(init=False)
    """Statement indices of motions within a spline block."""
    telling: list[tuple[Statement, int]] = field(init=False)
    """All statements but lines for people and motions to literals, which say nothing that a rule
    about names and values asks for; each with the number of what it says, -1 for no number.
    Assignments with one number say the same."""
    different: list[Statement] = field(init=False)
    """Of those that say the same, the first."""
    _places: dict[type, list[int]] = field(init=False)
    """Statement indices of each kind."""
    _positions: FloatArray | None = field(init=False, default=None)
    _is_path: BoolArray | None = field(init=False, default=None)
    _path_speeds: FloatArray | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Sort the statements by kind, and find the motions."""
        statements, point = self.routine.statements, self.subject.point
        self._places = defaultdict(list)
        for index, kind in enumerate(map(type, statements)):
            self._places[kind].append(index)
        moves = self.of(Move)
        targets = [
            move.target
            if type(move.target) in _LITERAL_TARGETS
            else point(move.target, self.module)
            for move in moves
        ]
        self.steps = tuple(map(Step, self._places[Move], moves, targets))  # type: ignore[arg-type]
        self.in_block = frozenset(self._within_blocks())
        self.telling = list(_telling(statements))
        self.different = list(_different(self.telling))

    def _within_blocks(self) -> Iterator[int]:
        if not self._places[SplineBegin]:
            return
        inside = False
        for index, statement in enumerate(self.routine.statements):
            kind = type(statement)
            if kind is Move and inside:
                yield index
            elif kind is SplineBegin or kind is SplineEnd:
                inside = kind is SplineBegin

    def places(self, *kinds: type[Statement]) -> list[int]:
        """Return the indices of all statements of some kinds, in the order of the text."""
        return sorted(chain.from_iterable(self._places.get(kind, ()) for kind in kinds))

    def of(self, kind: type[_S]) -> list[_S]:
        """Return all statements of a kind, in the order of the text."""
        statements = self.routine.statements
        return [statements[index] for index in self._places.get(kind, ())]  # type: ignore[misc]

    def of_kinds(self, *kinds: type[Statement]) -> list[Statement]:
        """Return all statements of some kinds, in the order of the text."""
        statements = self.routine.statements
        return [statements[index] for index in self.places(*kinds)]

    def in_force(self, changes: Sequence[tuple[int, float]]) -> FloatArray:
        """Return the value (k,) in force at each motion, NaN before the first change.

        Args:
            changes: statement index and value, in the order of the text.
        """
        values = np.array([np.nan, *(value for _, value in changes)])
        places = np.array([index for index, _ in changes], dtype=np.int64)
        return np.asarray(values[np.searchsorted(places, self._places[Move])])

    @property
    def path_speeds(self) -> FloatArray:
        """(k,) $VEL.CP [m/s] in force at each motion, NaN where the text does not tell."""
        if self._path_speeds is None:
            self._path_speeds = _path_speeds(self)
        return self._path_speeds

    @property
    def calls(self) -> Iterator[Call]:
        """All calls, those of triggers and interrupts included."""
        for statement in self.of_kinds(Call, Trigger, Interrupt):
            if isinstance(statement, Call):
                yield statement
            elif isinstance(statement, Trigger | Interrupt) and isinstance(statement.action, Call):
                yield statement.action

    @property
    def blends(self) -> list[tuple[str, ...]]:
        """How each motion is approximated, as its words say."""
        return [step.move.blend for step in self.steps]

    @property
    def positions(self) -> FloatArray:
        """(k, 3) X, Y, Z [mm] of the targets, NaN where there are none."""
        if self._positions is None:
            rows = [
                _NO_POSITION if step.move.word.is_relative else position_of(step.target)
                for step in self.steps
            ]
            self._positions = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return self._positions

    @property
    def is_path(self) -> BoolArray:
        """(k,) motions along a path of the TCP."""
        if self._is_path is None:
            self._is_path = np.array([not s.move.word.is_axis_motion for s in self.steps], bool)
        return self._is_path

    def between(self, first: Step, second: Step) -> Sequence[Statement]:
        """Return the statements between two motions."""
        if second.index == first.index + 1:
            return ()
        return self.routine.statements[first.index + 1 : second.index]


class Subject:
    """Modules under lint, with what the checks ask for again and again.

    Args:
        modules: all modules; checks report on them all.
        options: the controller.
    """

    def __init__(self, modules: Sequence[KrlModule], options: LintOptions) -> None:
        self.modules = tuple(modules)
        self.options = options
        self.findings: list[Finding] = []
        self._counts: dict[tuple[str, str], int] = {}
        self._added = 0

    # ----------------------------------------------------------------------------------- findings

    def add(
        self,
        row: int,
        severity: Severity,
        path: str,
        line: int,
        message: str,
        hint: str = "",
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
                yield Finding(
                    NOTE, code, f"{count - _SHOWN} more findings of {code}", source=SourceRef(path)
                )

    def each(self, part: Part, check: Callable[[Statement], None]) -> None:
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
        return tuple(
            Part(module, routine, self) for module in self.modules for routine in module.routines
        )

    @cached_property
    def _parts_of(self) -> dict[int, tuple[Part, ...]]:
        """The routines of each module, by its identity."""
        found: dict[int, tuple[Part, ...]] = {id(module): () for module in self.modules}
        for part in self.parts:
            found[id(part.module)] += (part,)
        return found

    def parts_of(self, module: KrlModule) -> tuple[Part, ...]:
        """Return the routines of a module."""
        return self._parts_of[id(module)]

    @cached_property
    def data(self) -> dict[tuple[str, str], dict[str, Value]]:
        """Values of the data lists by name in upper case, by path and name of the module."""
        return {
            (module.dat_path, module.name): {
                name.upper(): value
                for name, value, _ in (module.data.values() if module.data is not None else ())
            }
            for module in self.modules
        }

    @cached_property
    def global_data(self) -> dict[str, Value]:
        """Values that all modules see: GLOBAL ones, and those of modules without routines."""
        found: dict[str, Value] = {}
        for module in self.modules:
            for statement in module.data.statements if module.data is not None else ():
                if isinstance(statement, Declaration) and (
                    statement.is_global or not module.routines
                ):
                    for variable in statement.variables:
                        if variable.value is not None:
                            found[variable.name.upper()] = variable.value
        return found

    def value(self, value: Value | None, module: KrlModule) -> Value | None:
        """Return a value, or what the name stands for in the data lists; None if not known."""
        if not isinstance(value, Expr):
            return value
        name = value.text.upper()
        own = self.data[module.dat_path, module.name].get(name)
        return own if own is not None else self.global_data.get(name)

    def point(self, value: Value | None, module: KrlModule) -> Pose | Axes | None:
        """Return the pose or the joint angles that a target stands for; None if not known."""
        kind = type(value)
        if kind is Pose or kind is Axes:
            return value  # type: ignore[return-value]
        found = self.value(value, module)
        return found if isinstance(found, Pose | Axes) else None

    @cached_property
    def written(self) -> tuple[Written, ...]:
        """All values that stand in the text and are no plain numbers."""
        return tuple(written_in(chain.from_iterable(map(files_of, self.modules))))

    @cached_property
    def points(self) -> Points:
        """All points that stand in the text."""
        return points_among(self.written)

    def points_at(self, chosen: BoolArray) -> Iterator[tuple[str, int, Pose | Axes]]:
        """Yield file, line and value of the chosen ``points`` (n,), in their order."""
        for place in self.points.place[chosen].tolist():
            path, line, value, _ = self.written[place]
            if isinstance(value, Pose | Axes):
                yield path, line, value

    # -------------------------------------------------------------------------------------- calls

    @cached_property
    def routines(self) -> dict[str, tuple[KrlModule, Routine]]:
        """Routines that any module can call: modules by name, GLOBAL routines."""
        found: dict[str, tuple[KrlModule, Routine]] = {}
        for module in self.modules:
            for routine in module.routines:
                if routine.is_global:
                    found[routine.name.upper()] = (module, routine)
            if module.routines:
                found[module.main.name.upper()] = (module, module.main)
        return found

    def called(self, name: str, module: KrlModule) -> tuple[KrlModule, Routine] | None:
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

    def entries(self) -> Iterator[tuple[KrlModule, Routine]]:
        """Yield what an operator selects: modules that move and that no other module calls."""
        for module in self.modules:
            key = key_of(module, module.main) if module.routines else None
            if key in self.moving and key not in self.called_routines:
                yield module, module.main

    def walk(
        self, module: KrlModule, routine: Routine, *kinds: type[Statement]
    ) -> Iterator[tuple[KrlModule, Statement]]:
        """Yield statements in the order of the text; what is called stands at its first call.

        Args:
            module: of the routine.
            routine: where to begin.
            kinds: of the statements that are wanted; none: all.
        """
        seen = {key_of(module, routine)}
        stack = [(module, self._walked(module, routine, kinds))]
        while stack:
            here, statements = stack[-1]
            for statement in statements:
                if type(statement) is not Call:
                    yield here, statement
                    continue
                if not kinds or Call in kinds:
                    yield here, statement
                target = self.called(statement.name, here)
                if target is not None and key_of(*target) not in seen:
                    seen.add(key_of(*target))
                    stack.append((target[0], self._walked(*target, kinds)))
                    break
            else:
                stack.pop()

    def _walked(
        self, module: KrlModule, routine: Routine, kinds: tuple[type[Statement], ...]
    ) -> Iterator[Statement]:
        """Return the statements of a routine that a walk sees: of the kinds, and calls."""
        if not kinds:
            return iter(routine.statements)
        part = next(part for part in self.parts_of(module) if part.routine is routine)
        return iter(part.of_kinds(*{*kinds, Call}))


Rule = Callable[[Subject], None]


def bas(statement: Statement) -> tuple[str, Value | None]:
    """Return command and argument of a BAS call, ("", None) for any other statement."""
    if not isinstance(statement, Call) or statement.name.upper() != "BAS":
        return "", None
    arguments = statement.arguments
    command = arguments[0] if arguments else None
    name = command.name.upper() if isinstance(command, Enum) else ""
    return name, arguments[1] if len(arguments) > 1 else None


def number(value: Value | None) -> float | None:
    """Return a literal number, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value)


def known_number(value: Value | None) -> float:
    """Return a literal number, NaN for anything else."""
    found = number(value)
    return float("nan") if found is None else found


def _telling(statements: Sequence[Statement]) -> Iterator[tuple[Statement, int]]:
    """Yield the statements that are more than a line for people or a motion to a literal."""
    numbers: dict[tuple[str, type, object], int] = {}
    for statement in statements:
        kind = type(statement)
        if kind is Move:
            if not _is_plain(statement):  # type: ignore[arg-type]
                yield statement, -1
        elif kind is Assign:
            value = statement.value  # type: ignore[attr-defined]
            of = type(value)
            if of in PLAIN:
                said = (statement.target, of, value)  # type: ignore[attr-defined]
                yield statement, numbers.setdefault(said, len(numbers))
            else:
                yield statement, -1
        elif kind not in _TEXTS:
            yield statement, -1


def _different(telling: Sequence[tuple[Statement, int]]) -> Iterator[Statement]:
    """Yield the first of all statements that say the same."""
    known: set[int] = set()
    for statement, said in telling:
        if said not in known:
            yield statement
            if said >= 0:
                known.add(said)


def _is_plain(move: Move) -> bool:
    """Whether a motion goes to a literal, and that is all it says."""
    return type(move.target) in _LITERAL_TARGETS and move.auxiliary is None and not move.settings


def _path_speeds(part: Part) -> FloatArray:
    changes = []
    for index, statement in zip(
        part.places(Assign, Call), part.of_kinds(Assign, Call), strict=True
    ):
        if isinstance(statement, Assign):
            if statement.target == "$VEL.CP":
                changes.append((index, known_number(statement.value)))
        else:
            command, argument = bas(statement)
            if command in ("CP_PARAMS", "VEL_CP", "INITMOV"):
                new = float("nan") if command == "INITMOV" else known_number(argument)
                changes.append((index, new))
    speeds = part.in_force(changes)
    for place, step in enumerate(part.steps):
        if step.move.settings:
            own = [s.value for s in step.move.settings if s.target == "$VEL.CP"]
            if own:
                speeds[place] = known_number(own[0])
    return speeds


def files_of(module: KrlModule) -> Iterator[tuple[str, Sequence[Statement]]]:
    """Yield everything in a module: statements of a routine or a list, each with its file."""
    for routine in module.routines:
        yield module.src_path, routine.statements
        yield module.src_path, routine.after
    yield module.src_path, module.before
    if module.data is not None:
        yield module.dat_path, module.data.before
        yield module.dat_path, module.data.statements
