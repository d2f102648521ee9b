"""One routine of one module: its statements by kind, its motions in order, what holds at each."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import field
from itertools import chain
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import Severity
from postproc.krl import text as krl
from postproc.krl.rules.values import PLAIN, POINTS
from postproc.records import record

if TYPE_CHECKING:
    from postproc.krl.rules.subject import Subject

_S = TypeVar("_S", bound=krl.Statement)
_TEXTS = frozenset({krl.Comment, krl.Blank, krl.FoldBegin, krl.FoldEnd})
"""Lines for people."""


@record(frozen=True, slots=True)
class Step:
    """A motion of a routine: place in its statements, and the target if it is known."""

    index: int
    move: krl.Move
    target: krl.Pose | krl.Axes | None


def position_of(point: krl.Pose | krl.Axes | None) -> tuple[float | None, ...]:
    """Return X, Y, Z [mm] of a point, as an array turns them into NaN where it has none."""
    if type(point) is krl.Pose:
        return point.x_mm, point.y_mm, point.z_mm
    return _NO_POSITION


_NO_POSITION = (None, None, None)


RoutineKey = tuple[str, str, str, int]


def key_of(module: krl.KrlModule, routine: krl.Routine) -> RoutineKey:
    """Return what tells a routine from all others: file, module, name, line."""
    return module.src_path, module.name, routine.name, routine.line


@record(slots=True)
class Part:
    """One routine of one module."""

    module: krl.KrlModule
    routine: krl.Routine
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
    telling: list[tuple[krl.Statement, int]] = field(init=False)
    """All statements but lines for people and motions to literals, which say nothing that a rule
    about names and values asks for; each with the number of what it says, -1 for no number.
    Assignments with one number say the same."""
    different: list[krl.Statement] = field(init=False)
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
        moves = self.of(krl.Move)
        targets = [
            move.target if type(move.target) in POINTS else point(move.target, self.module)
            for move in moves
        ]
        self.steps = tuple(map(Step, self._places[krl.Move], moves, targets))  # type: ignore[arg-type]
        self.in_block = frozenset(self._within_blocks())
        self.telling = list(_telling(statements))
        self.different = list(_different(self.telling))

    def error(self, row: int, line: int, message: str, hint: str = "") -> None:
        """Add an error of a row of the table."""
        self.subject.add(row, Severity.ERROR, self.path, line, message, hint)

    def warn(self, row: int, line: int, message: str, hint: str = "") -> None:
        """Add a warning of a row of the table."""
        self.subject.add(row, Severity.WARNING, self.path, line, message, hint)

    def _within_blocks(self) -> Iterator[int]:
        if not self._places[krl.SplineBegin]:
            return
        inside = False
        for index, statement in enumerate(self.routine.statements):
            kind = type(statement)
            if kind is krl.Move and inside:
                yield index
            elif kind is krl.SplineBegin or kind is krl.SplineEnd:
                inside = kind is krl.SplineBegin

    def places(self, *kinds: type[krl.Statement]) -> list[int]:
        """Return the indices of all statements of some kinds, in the order of the text."""
        return sorted(chain.from_iterable(self._places.get(kind, ()) for kind in kinds))

    def of(self, kind: type[_S]) -> list[_S]:
        """Return all statements of a kind, in the order of the text."""
        statements = self.routine.statements
        return [statements[index] for index in self._places.get(kind, ())]  # type: ignore[misc]

    def of_kinds(self, *kinds: type[krl.Statement]) -> list[krl.Statement]:
        """Return all statements of some kinds, in the order of the text."""
        statements = self.routine.statements
        return [statements[index] for index in self.places(*kinds)]

    def in_force(self, changes: Sequence[tuple[int, float]]) -> FloatArray:
        """Return the value (k,) in force at each motion, NaN before the first change.

        ``changes``: statement index and value, in the order of the text.
        """
        values = np.array([np.nan, *(value for _, value in changes)])
        places = np.array([index for index, _ in changes], dtype=np.int64)
        return np.asarray(values[np.searchsorted(places, self._places[krl.Move])])

    @property
    def path_speeds(self) -> FloatArray:
        """(k,) $VEL.CP [m/s] in force at each motion, NaN where the text does not tell."""
        if self._path_speeds is None:
            self._path_speeds = _path_speeds(self)
        return self._path_speeds

    @property
    def calls(self) -> Iterator[krl.Call]:
        """All calls, those of triggers and interrupts included."""
        for statement in self.of_kinds(krl.Call, krl.Trigger, krl.Interrupt):
            if isinstance(statement, krl.Call):
                yield statement
            elif isinstance(statement, krl.Trigger | krl.Interrupt) and isinstance(
                statement.action, krl.Call
            ):
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

    def between(self, first: Step, second: Step) -> Sequence[krl.Statement]:
        """Return the statements between two motions."""
        if second.index == first.index + 1:
            return ()
        return self.routine.statements[first.index + 1 : second.index]


def bas(statement: krl.Statement) -> tuple[str, krl.Value | None]:
    """Return command and argument of a BAS call, ("", None) for any other statement."""
    if not isinstance(statement, krl.Call) or statement.name.upper() != "BAS":
        return "", None
    arguments = statement.arguments
    command = arguments[0] if arguments else None
    name = command.name.upper() if isinstance(command, krl.Enum) else ""
    return name, arguments[1] if len(arguments) > 1 else None


def number(value: krl.Value | None) -> float | None:
    """Return a literal number, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value)


def known_number(value: krl.Value | None) -> float:
    """Return a literal number, NaN for anything else."""
    found = number(value)
    return float("nan") if found is None else found


def _telling(statements: Sequence[krl.Statement]) -> Iterator[tuple[krl.Statement, int]]:
    """Yield the statements that are more than a line for people or a motion to a literal."""
    numbers: dict[tuple[str, type, object], int] = {}
    for statement in statements:
        kind = type(statement)
        if kind is krl.Move:
            if not _is_plain(statement):  # type: ignore[arg-type]
                yield statement, -1
        elif kind is krl.Assign:
            value = statement.value  # type: ignore[attr-defined]
            of = type(value)
            if of in PLAIN:
                said = (statement.target, of, value)  # type: ignore[attr-defined]
                yield statement, numbers.setdefault(said, len(numbers))
            else:
                yield statement, -1
        elif kind not in _TEXTS:
            yield statement, -1


def _different(telling: Sequence[tuple[krl.Statement, int]]) -> Iterator[krl.Statement]:
    """Yield the first of all statements that say the same."""
    known: set[int] = set()
    for statement, said in telling:
        if said not in known:
            yield statement
            if said >= 0:
                known.add(said)


def _is_plain(move: krl.Move) -> bool:
    """Whether a motion goes to a literal, and that is all it says."""
    return type(move.target) in POINTS and move.auxiliary is None and not move.settings


def _path_speeds(part: Part) -> FloatArray:
    changes = []
    for index, statement in zip(
        part.places(krl.Assign, krl.Call), part.of_kinds(krl.Assign, krl.Call), strict=True
    ):
        if isinstance(statement, krl.Assign):
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
