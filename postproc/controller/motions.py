"""Motion statements while a program runs: settings, targets, approximation, spline blocks."""

from __future__ import annotations

from typing import Any, Protocol

from postproc.controller.recorder import Motion, Recorder
from postproc.controller.runtime import Evaluator
from postproc.controller.state import MotionState
from postproc.controller.targets import Targets, numbers_of
from postproc.controller.trace import Blend, MotionType, Settings
from postproc.errors import RunKind, Severity
from postproc.krl import Assign, Axes, Expr, Move, MoveWord, Pose, SplineBegin, SplineEnd

MOTION_TYPES = {
    word: MotionType[word.removesuffix("_REL").removeprefix("S").replace("PL", "SPL")]
    for word in MoveWord
}


_OF_ALL_AXES = {"$VEL_AXIS": "VEL_PTP", "$ACC_AXIS": "ACC_PTP"}
"""What WITH sets for the first axis counts for all."""


class Host(Protocol):
    """The interpreter that runs the statements around the motions."""

    state: MotionState
    recorder: Recorder

    def assign(self, statement: Assign) -> None:
        """Execute an assignment."""
        ...

    def finding(self, kind: RunKind, message: str, severity: Severity = Severity.ERROR) -> None:
        """Report something at the present line."""
        ...

    def place(self) -> tuple[int, int]:
        """Return file row and line that run now."""
        ...


class Motions:
    """Executes motions and spline blocks."""

    def __init__(self, evaluator: Evaluator, targets: Targets, host: Host) -> None:
        self._evaluator = evaluator
        self._targets = targets
        self._host = host
        self._state, self._recorder = host.state, host.recorder
        self._block, self._blocks = -1, 0
        self._before_block: Settings = host.state.values

    def begin_spline(self, statement: SplineBegin) -> None:
        """Enter a spline block."""
        self._blocks += 1
        self._block = self._blocks
        self._before_block = self._state.values
        self._with(statement.settings)

    def end_spline(self, statement: SplineEnd) -> None:
        """Leave a spline block; its approximation belongs to the last motion."""
        self._recorder.end_block(self._block, self._blend(statement.blend))
        self._block = -1
        self._state.values = self._before_block

    def _with(self, settings: tuple[Assign, ...]) -> None:
        for setting in settings:
            command = _OF_ALL_AXES.get(setting.target.partition("[")[0])
            if command is not None:
                self._state.bas(command, self._evaluator.value(setting.value), {})
            else:
                self._host.assign(setting)

    def move(self, statement: Move) -> None:
        """Execute a motion."""
        before = self._state.values
        if statement.settings:
            self._with(statement.settings)
        target = self._target(statement)
        if target is None:
            self._host.finding(RunKind.TARGET, f"where {_name(statement)} goes is not known")
        else:
            self._record(statement, target)
        if statement.settings:
            self._state.values = before

    def _target(self, statement: Move) -> Pose | Axes | None:
        value: Any = statement.target
        if type(value) is Pose and not statement.word.is_relative:
            return value if value.is_complete else self._targets.complete(value)
        value = self._evaluator.value(value)
        if statement.word.is_relative:
            return self._targets.shifted(value, statement.frame)
        return self._targets.complete(value)

    def _record(self, statement: Move, target: Pose | Axes) -> None:
        is_axes = type(target) is Axes
        motion_type = MOTION_TYPES[statement.word]
        if is_axes and motion_type is not MotionType.PTP:
            self._host.finding(RunKind.TARGET, f"{statement.word.value} to joint angles")
            return
        status, turn = (-1, -1) if is_axes else _status_and_turn(target)  # type: ignore[arg-type]
        file, line = self._host.place()
        motion = Motion(
            motion_type,
            Blend.THROUGH if self._block >= 0 else self._blend(statement.blend),
            self._state.row(),
            is_axes,
            status,
            turn,
            file,
            line,
            self._block,
            statement.word.is_relative,
        )
        row = self._recorder.motion(motion, target)
        if statement.auxiliary is not None:
            self._auxiliary(statement, row)
        self._targets.remember(target)

    def _auxiliary(self, statement: Move, row: int) -> None:
        value = self._evaluator.value(statement.auxiliary)
        if statement.word.is_relative:
            value = self._targets.shifted(value, statement.frame)
        if isinstance(value, Pose) and None not in (value.x_mm, value.y_mm, value.z_mm):
            self._recorder.auxiliary[row] = numbers_of(value)
        else:
            self._host.finding(RunKind.TARGET, "the auxiliary point of a circle is not known")
        if statement.angle_deg is not None:
            angle = self._evaluator.value(statement.angle_deg)
            if isinstance(angle, int | float):
                self._recorder.angles[row] = float(angle)

    def _blend(self, words: tuple[str, ...]) -> Blend:
        if not words or self._state.values.advance == 0:
            return Blend.EXACT
        if "C_PTP" in words:
            return Blend.AXES
        return Blend.DISTANCE if words[0] in ("C_DIS", "C_SPL") else Blend.OTHER


def _status_and_turn(pose: Pose) -> tuple[int, int]:
    """Return S and T of a pose, -1 where they are not written."""
    status, turn = pose.status, pose.turn
    return -1 if status is None else status, -1 if turn is None else turn


def _name(statement: Move) -> str:
    target = statement.target
    text = target.text if isinstance(target, Expr) else "its target"
    return f"{statement.word.value} {text}"
