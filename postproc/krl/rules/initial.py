"""Rows 9, 10, 11: initialisation, tool and base, the first motion."""

from __future__ import annotations

from postproc.krl import text as krl
from postproc.krl.rules.part import Part, bas, key_of, number
from postproc.krl.rules.subject import ERROR, WARNING, Subject

_FRAMES = frozenset({"FRAMES", "PTP_PARAMS", "CP_PARAMS"})


def initialised(subject: Subject) -> None:
    """Row 9: INI once, in the main program only; then tool with its load, then base."""
    for part in subject.parts:
        _ini_places(part)
    for module, routine in subject.entries():
        _main(subject, module, routine)


def _ini_places(part: Part) -> None:
    lines = [call.line for call in part.of(krl.Call) if bas(call)[0] == "INITMOV"]
    for line in lines[1:]:
        part.error(9, line, f"INI appears twice in {part.routine.name}")
    if lines and part.key in part.subject.called_routines:
        text = (
            f"{part.routine.name} is called and has an INI: it resets tool and base and stops "
            "the advance run"
        )
        part.error(9, lines[0], text)


class _Setup:
    """What has been set so far."""

    def __init__(self) -> None:
        self.ini = self.tool = self.load = self.base = False

    def follow(self, statement: krl.Statement) -> None:
        """Note what a statement sets."""
        command, _ = bas(statement)
        if command == "INITMOV":
            self.ini, self.tool, self.load, self.base = True, False, False, False
        elif command == "TOOL":
            self.tool = self.load = True
        elif command == "BASE":
            self.base = True
        elif command in _FRAMES:
            self.tool = self.load = self.base = True
        elif isinstance(statement, krl.Assign):
            self.assign(statement)

    def assign(self, statement: krl.Assign) -> None:
        """Note an assignment, also behind WITH."""
        name = statement.target.upper()
        self.tool |= name == "$TOOL"
        self.base |= name == "$BASE"
        self.load |= name.startswith("$LOAD")


def _main(subject: Subject, module: krl.KrlModule, routine: krl.Routine) -> None:
    setup = _Setup()
    for here, statement in subject.walk(module, routine):
        setup.follow(statement)
        if isinstance(statement, krl.Move):
            for setting in statement.settings:
                setup.assign(setting)
            if not setup.ini:
                message = "a motion before BAS(#INITMOV,0): speeds, tool and base are left over"
                subject.add(9, ERROR, here.src_path, statement.line, message)
                return
            if _is_cartesian(subject, here, statement):
                _at_first_pose(subject, here, statement, setup)
                return


def _is_cartesian(subject: Subject, module: krl.KrlModule, move: krl.Move) -> bool:
    if not move.word.is_axis_motion:
        return True
    return isinstance(subject.point(move.target, module), krl.Pose)


def _at_first_pose(subject: Subject, module: krl.KrlModule, move: krl.Move, setup: _Setup) -> None:
    place = module.src_path, move.line
    if not setup.tool:
        message = "a Cartesian motion, and no tool was set behind INI: BAS(#INITMOV,0) takes tool 1"
        subject.add(9, ERROR, *place, message, hint="BAS(#TOOL,n) behind the INI")
    elif not setup.load:
        message = "$TOOL is set without $LOAD: the controller moves with the wrong load"
        subject.add(9, ERROR, *place, message, hint="BAS(#TOOL,n) sets both")
    if not setup.base:
        message = "a Cartesian motion, and no base was set behind INI: it counts from $WORLD"
        subject.add(9, ERROR, *place, message, hint="BAS(#BASE,n) behind the INI")


# ------------------------------------------------------------------------------- tool and base


def frame_numbers(subject: Subject) -> None:
    """Row 10: tool and base exist on the controller; a form's FDAT agrees with them."""
    for part in subject.parts:
        active: dict[str, float] = {}
        for statement in part.different:
            command, argument = bas(statement)
            if command in ("TOOL", "BASE"):
                value = number(argument)
                if value is not None:
                    _in_range(subject, part.path, statement.line, command, value)
                    active[command] = value
            elif isinstance(statement, krl.Assign) and statement.target.upper() == "FDAT_ACT":
                _fdat(part, statement, active)
        _with_frames(part)
    for module in subject.modules:
        if module.data is not None:
            for _, data, line in module.data.values():
                if isinstance(data, krl.Aggregate) and data.get("TOOL_NO") is not None:
                    _fdat_range(subject, module.dat_path, line, data)


def _in_range(
    subject: Subject, path: str, line: int, what: str, value: float, soft_zero: bool = False
) -> None:
    most = subject.options.max_tool if what == "TOOL" else subject.options.max_base
    name = what.lower()
    if value != int(value) or not 0 <= value <= most:
        subject.add(10, ERROR, path, line, f"{name} {value:g}: the controller has 1 to {most}")
    elif value == 0 and not subject.options.allow_zero:
        frame = "the flange itself" if what == "TOOL" else "$WORLD"
        severity = WARNING if soft_zero or subject.options.is_project else ERROR
        subject.add(10, severity, path, line, f"{name} 0 is {frame}")


def _fdat_range(subject: Subject, path: str, line: int, value: krl.Aggregate) -> None:
    for what in ("TOOL", "BASE"):
        found = number(value.get(f"{what}_NO"))
        if found is not None:
            _in_range(subject, path, line, what, found, soft_zero=True)


def _fdat(part: Part, statement: krl.Assign, active: dict[str, float]) -> None:
    value = part.subject.value(statement.value, part.module)
    if not isinstance(value, krl.Aggregate):
        return
    if value is statement.value:
        _fdat_range(part.subject, part.path, statement.line, value)
    for what in ("TOOL", "BASE"):
        found = number(value.get(f"{what}_NO"))
        if found is not None and active.get(what, found) != found:
            message = f"the form moves with {what.lower()} {found:g}, active is {active[what]:g}"
            part.error(10, statement.line, message)


def _with_frames(part: Part) -> None:
    """Check the frame data that forms of KSS 8.6 name behind WITH."""
    for step in part.steps:
        for setting in step.move.settings:
            if setting.target in ("$TOOL", "$BASE") and isinstance(setting.value, krl.Expr):
                name = setting.value.text.partition("(")[2].partition(")")[0].partition(".")[0]
                value = part.subject.value(krl.Expr(name.strip()), part.module)
                if isinstance(value, krl.Aggregate):
                    _fdat_range(part.subject, part.path, step.move.line, value)


# --------------------------------------------------------------------------------- first motion


def first_motions(subject: Subject) -> None:
    """Row 11: the first motion, and the first behind a call that moves, says the whole pose."""
    for part in subject.parts:
        if not part.steps:
            continue
        is_called = part.key in subject.called_routines
        fresh, why = True, "the first motion of the program"
        if is_called:
            why = f"the first motion of {part.routine.name}"
        for statement in part.of_kinds(krl.Call, krl.Move):
            if isinstance(statement, krl.Call):
                target = subject.called(statement.name, part.module)
                if target is not None and key_of(*target) in subject.moving:
                    fresh, why = True, f"the first motion behind the call of {target[1].name}"
            elif isinstance(statement, krl.Move) and fresh:
                fresh = False
                _first(part, statement, why, is_called)


def _first(part: Part, move: krl.Move, why: str, is_called: bool) -> None:
    if not move.word.is_axis_motion:
        relative = move.word.is_relative and is_called
        text = f"{why} is a {move.word.value}: it goes on from wherever the robot stands"
        hint = "PTP with axis values first"
        part.subject.add(11, WARNING if relative else ERROR, part.path, move.line, text, hint=hint)
        return
    target = _known_target(part.subject, part.module, move.target)
    if isinstance(target, krl.Axes) and not target.is_complete:
        part.error(11, move.line, f"{why} does not say all six axes")
    elif isinstance(target, krl.Pose):
        missing = not target.is_complete or target.status is None or target.turn is None
        if missing:
            message = f"{why} does not say X to C with S and T: the arm's pose is not fixed"
            part.error(11, move.line, message)
    elif isinstance(target, str) and "AXIS_ACT" in target.upper():
        part.warn(11, move.line, f"{why} goes to where the robot stands: the BCO run is skipped")


def _known_target(
    subject: Subject, module: krl.KrlModule, value: krl.Value
) -> krl.Pose | krl.Axes | str | None:
    found = subject.point(value, module)
    if found is not None:
        return found
    return value.text if isinstance(value, krl.Expr) else None
