"""Runs KRL text as a controller would and records what the robot is told to do.

Followed: declarations and data lists, assignments, frames and the frame operator, IF, FOR, WHILE,
REPEAT, LOOP, SWITCH, GOTO, sub-programs (local, by module, GLOBAL) with parameters, functions, BAS,
inline forms of both kinds, spline blocks, WITH, relative and partial targets, triggers, waits.
Calls of hooks, and of routines that are not in the files, are recorded. A hook that lies in the
files is run as well; only its waits and stops are its own. What only the controller knows (inputs,
timers) is unknown: a condition on it is taken as FALSE. Interrupts never happen.

What the program would do otherwise is a finding: a statement, system variable or routine that is
not followed here and may move the arm or change how it moves, a condition that is not known and
decides about more than waiting, a loop without a way out. The world may accept each by its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

from postproc import krl
from postproc.arrays import FloatArray
from postproc.controller.control import Activation, ControlFlow
from postproc.controller.library import (
    CONTACT_ROUTINE,
    DECLARING,
    SILENT,
    NumberedFrame,
    is_still,
    predefined,
)
from postproc.controller.memory import Memory
from postproc.controller.motions import Motions
from postproc.controller.recorder import STOPPING, AdvanceRun, Recorder
from postproc.controller.runtime import (
    UNKNOWN,
    Variables,
    component,
    plain_arguments,
    text_of,
    with_component,
)
from postproc.controller.state import STOPMESS, MotionState
from postproc.controller.targets import Targets
from postproc.controller.trace import EventWord, Trace, World
from postproc.controller.trust import Trust, is_quiet, reading
from postproc.errors import RunKind, Severity, SourceRef
from postproc.kinematics import Kinematics

MAX_DEPTH = 50
"""Calls within calls."""
MAX_REPEATED_LINES = 100_000
MAX_REPEATED_MOTIONS = 4_000
"""So many lines and motions more than the text has are run: what loops and calls add to it."""
MAX_WAIT = 600.0
"""A longer wait [s] is a slip of the digits, not a dwell."""
_NO_LINE = frozenset({krl.Continue, krl.Declaration})
"""What stands between CONTINUE and the line that it belongs to."""
MAX_SEARCHES = 200
"""How often the joints behind a Cartesian motion are worked out in one run."""


def run(modules: Sequence[krl.KrlModule], name: str, kinematics: Kinematics, world: World) -> Trace:
    """Run a program of modules from the one named; what could not be followed are its findings."""
    return Interpreter(modules, kinematics, world).run(name)


class _EndlessError(Exception):
    """The run goes on and on; it has been reported."""


class Interpreter:
    """One run of one program."""

    def __init__(
        self, modules: Sequence[krl.KrlModule], kinematics: Kinematics, world: World
    ) -> None:
        self._modules = {module.name.upper(): module for module in modules}
        self._world = world
        self.state = MotionState(world.tools, world.bases, world.T_world_robroot)
        self.recorder = Recorder()
        self._advance = AdvanceRun(self.state, self.recorder)
        self.targets = Targets(self.state, kinematics, self._joints_now)
        self._memory = Memory(
            self._modules,
            world,
            self._system_value,
            self._function,
            self._note_frame_data,
            self._wrong_type,
        )
        self.evaluator = self._memory.evaluator
        self._stack = self._memory.stack
        self._trust = Trust(world.hooks, world.accept, self._resolve)
        self._control = ControlFlow(
            self.evaluator,
            self._assign_node,
            self.finding,
            self._trust.is_idle,
            self._trust.accepts,
            lambda statements: self._forget(map(_node, self._trust.assigned(statements))),
        )
        self._system: dict[str, Any] = {}
        self._active: dict[str, Any] = {}
        self._flows: dict[tuple[str, str, int], krl.Flow] = {}
        self._global_routines: dict[str, list[tuple[krl.KrlModule, krl.Routine]]] = {}
        for module in self._modules.values():
            for routine in module.routines:
                if routine.is_global:
                    known = self._global_routines.setdefault(routine.name.upper(), [])
                    known.append((module, routine))
        self._line = 0
        self._searches = 0
        texts = [r.statements for m in self._modules.values() for r in m.routines]
        moves = sum(type(statement) is krl.Move for text in texts for statement in text)
        self._lines_left = MAX_REPEATED_LINES + sum(map(len, texts))
        self._motions_left = MAX_REPEATED_MOTIONS + moves
        self._motions = Motions(self.evaluator, self.targets, self)
        self._handlers: dict[type, Callable[[Any], None]] = {
            krl.Move: self._motions.move,
            krl.Assign: self.assign,
            krl.Call: self._call,
            krl.WaitSec: self._wait,
            krl.WaitFor: lambda wait: self._stand(EventWord.WAIT_FOR, wait.condition),
            krl.Halt: lambda _: self._stand(EventWord.HALT, "HALT"),
            krl.Declaration: self._memory.declare,
            krl.Trigger: self._trigger,
            krl.Interrupt: self._interrupt,
            krl.Raw: self._instruction,
            krl.SplineBegin: self._motions.begin_spline,
            krl.SplineEnd: self._motions.end_spline,
            krl.Continue: self._continue,
        }
        self._memory.load(self._modules)

    def run(self, name: str) -> Trace:
        """Run a module from its first routine."""
        module = self._modules[name.upper()]
        with suppress(_EndlessError):
            self._execute(module, module.main, ())
        return self.recorder.trace(self.state)

    # --------------------------------------------------------------------------------- execution

    def _execute(
        self, module: krl.KrlModule, routine: krl.Routine, arguments: tuple[tuple[str, Any], ...]
    ) -> Activation:
        key = module.name, routine.name, routine.line
        flow = self._flows.get(key)
        if flow is None:
            flow = self._flows[key] = krl.flow_of(routine)
        run = Activation(routine, module, flow, self.recorder.file_row(module.src_path))
        run.local.plain.update(arguments)
        self._stack.append(run)
        self._line = routine.line
        if flow.broken:
            self._line, wrong = flow.broken[0]
            self.finding(RunKind.STRUCTURE, f"program control without its other half: {wrong}")
        else:
            self._loop(run)
        self._stack.pop()
        return run

    def _loop(self, run: Activation) -> None:
        statements = run.routine.statements
        handlers, count, index = self._handlers, len(statements), 0
        advance = self._advance
        while index < count:
            statement = statements[index]
            kind = type(statement)
            self._lines_left -= 1
            if self._lines_left < 0 or len(self.recorder) > self._motions_left:
                self._stop(statement)
            if kind is krl.Control:
                self._line = statement.line
                target = self._control.step(run, index, statement)  # type: ignore[arg-type]
                index = index + 1 if target is None else target
                advance.is_continued = False
                continue
            handler = handlers.get(kind)
            if handler is not None:
                self._line = statement.line
                handler(statement)
                if advance.is_continued and kind not in _NO_LINE:
                    advance.is_continued = False
            index += 1

    def _stop(self, statement: krl.Statement) -> None:
        """End a run that goes on and on."""
        self._line = statement.line
        what = (
            f"{MAX_REPEATED_LINES} lines"
            if self._lines_left < 0
            else f"{MAX_REPEATED_MOTIONS} motions"
        )
        self._stack[-1].line = statement.line
        text = f"loops and calls add more than {what} to what is written: not run any further"
        if all(run.ends for run in self._stack):
            self.finding(RunKind.UNJUDGED, f"too long to check: {text}")
        else:
            self.finding(RunKind.ENDLESS, text)
        raise _EndlessError

    def _continue(self, _statement: krl.Continue) -> None:
        """Let the next line be run ahead, whatever it is."""
        self._aside("CONTINUE", acts=False)
        self._advance.is_continued = True

    def _aside(self, name: str, *, acts: bool = True) -> None:
        """Record what neither moves the arm nor belongs to the process; ``acts``: at once."""
        early = self._advance.act() if acts else 0
        self.recorder.event(EventWord.ASIDE, name, self.place(), early=early)

    def place(self) -> tuple[int, int]:
        """Return file row and line that run now."""
        return self._stack[-1].file, self._line

    def finding(
        self, kind: RunKind, message: str, severity: Severity = Severity.ERROR, hint: str = ""
    ) -> None:
        """Report something at the present line."""
        self.recorder.finding(kind, message, self.place(), severity, hint)

    def unjudged(self, name: str, message: str) -> None:
        """Report what is not followed here, unless the world accepts it by its name."""
        if not self._trust.accepts(name):
            self.finding(RunKind.UNJUDGED, message, hint=f"harmless? [verify] accept = [{name!r}]")

    def _wrong_type(self, message: str, source: SourceRef | None) -> None:
        place = (
            self.place() if source is None else (self.recorder.file_row(source.path), source.line)
        )
        self.recorder.finding(RunKind.TYPE, message, place)

    def _missing_frames(self) -> None:
        state = self.state
        if state.missing:
            for text in dict.fromkeys(state.missing):
                self.finding(RunKind.FRAME, text)
            state.missing.clear()
        if state.unjudged:
            for name, text in dict.fromkeys(state.unjudged):
                self.unjudged(name, text)
            state.unjudged.clear()

    # --------------------------------------------------------------------------------- variables

    def _system_value(self, key: str) -> Any:  # noqa: ANN401 - KRL values are of many types
        if key.startswith(STOPPING):
            self._advance.stop()
            self._aside(key)
        if key.startswith(("$POS_ACT", "$AXIS_ACT")):
            name, _, rest = key.partition(".")
            value = self.targets.position(name)
            return component(value, rest) if rest else value
        if key.startswith("$TIMER["):
            return UNKNOWN  # it runs on, whatever it was set to
        value = self.state.read(key)
        return self._system.get(key, UNKNOWN) if value is UNKNOWN else value

    def assign(self, statement: krl.Assign) -> None:
        """Execute an assignment."""
        if type(statement.value) is float and statement.target in krl.initial_values():
            self.state.assign(statement.target, statement.value)
            self._missing_frames()
            return
        node = krl.parse_expression(statement.target)
        value = self.evaluator.value(statement.value)
        if isinstance(node, krl.Reference) and node.name in ("$TOOL", "$BASE"):
            self._assign_frame(node, value, statement.value)
        else:
            self._assign_node(node, value, by_form=_is_form(statement.value))
        self._missing_frames()

    def _assign_frame(self, node: krl.Reference, value: Any, written: krl.Value) -> None:  # noqa: ANN401
        if isinstance(value, NumberedFrame):
            select = self.state.select_tool if node.name == "$TOOL" else self.state.select_base
            select(value.number)
            return
        number = -1
        source = krl.parse_expression(written.text) if isinstance(written, krl.Expr) else None
        if isinstance(source, krl.Reference) and source.name in ("TOOL_DATA", "BASE_DATA"):
            index = source.selectors[0] if source.selectors else ""
            found = None if isinstance(index, str) else self.evaluator.indices(index)
            number = found[0] if found else -1
        if node.selectors:
            whole = self.state.read(node.name)
            path = tuple(s for s in node.selectors if isinstance(s, str))
            value = with_component(whole, path, value)
        self.state.set_frame(node.name, value, number)

    def _assign_node(self, node: krl.Node, value: Any, *, by_form: bool = False) -> None:  # noqa: ANN401
        if not isinstance(node, krl.Reference):
            return
        if node.name.startswith("$"):
            self._assign_system(node, value, by_form=by_form)
        elif node.name in ("FDAT_ACT", "PDAT_ACT", "LDAT_ACT") and not node.selectors:
            self._active[node.name] = value
        else:
            if not self._memory.is_own(node.name):
                self._aside(f"{node.name}=")
            self._memory.put(node, value)

    def _assign_system(self, node: krl.Reference, value: Any, *, by_form: bool) -> None:  # noqa: ANN401
        """Set a system variable; what it does and nobody follows is not checked."""
        key = self.evaluator.key(node)
        variable = krl.system_variable(node.name)
        if key is None:
            if variable is None or not variable.effect.is_still:
                self.unjudged(node.name, f"which {node.name} is set is not known here")
            return
        if variable is not None and variable.effect.is_still:
            self._assign_still(key, value, variable.effect)
        elif key == "$APO" and component(value, "APO_DIST") is not UNKNOWN:
            self.state.approximation(value)
        elif key == "$LOAD" and isinstance(value, NumberedFrame):
            self.state.select_load(value.number)
        elif not self.state.assign(key, value) and not by_form:
            does = "what it does is not known" if variable is None else variable.does
            self.unjudged(key, f"{key} is set ({does}): its effect on the motion is not checked")

    def _assign_still(self, key: str, value: Any, effect: krl.Effect) -> None:  # noqa: ANN401
        """Set a system variable by which no arm moves otherwise."""
        self._system[key] = value
        if effect is krl.Effect.OUTPUT:
            number = float(value) if isinstance(value, int | float) else math.nan
            early = self._advance.stop() if key.startswith(STOPPING) else self._advance.act()
            self.recorder.event(EventWord.OUTPUT, key, self.place(), number, early=early)

    def _note_frame_data(self, node: krl.Reference, scope: Variables) -> None:
        if node.name not in ("TOOL_DATA", "BASE_DATA"):
            return
        data = self.state.tool_data if node.name == "TOOL_DATA" else self.state.base_data
        known = self._world.tools if node.name == "TOOL_DATA" else self._world.bases
        if node.name not in scope.arrays:
            data.clear()  # which one is written to is not known
        for indices, pose in scope.arrays.get(node.name, {}).items():
            number = indices[0]
            if len(indices) != 1 or data.get(number) == pose:
                continue
            if isinstance(pose, krl.Pose):
                data[number] = pose
            else:
                data.pop(number, None)
            if self._stack and pose != known.get(number):
                name = f"{node.name}[{number}]"
                self.unjudged(name, f"{name} is changed: this stays for all later programs")

    # ------------------------------------------------------------------------------------- calls

    def _call(self, statement: krl.Call) -> None:
        name = statement.name.upper()
        found = self._resolve(name)
        if name == "BAS":
            if found is not None and found[0].name.upper() != name:
                text = "BAS is a routine of these files: KUKA's own is what is checked"
                self.unjudged(name, text)
            self._bas(statement)
            return
        nodes = tuple(_node(value) for value in statement.arguments)
        if name in self._world.hooks:
            self._hook(name, found, nodes)
        elif found is not None:
            self._run_routine(*found, nodes)
        elif name == "PULSE":
            early = self._advance.stop()
            self.recorder.event(EventWord.OUTPUT, "PULSE", self.place(), early=early)
        elif name in SILENT:
            if name != CONTACT_ROUTINE:
                self._aside(name)
            elif statement.arguments not in ((), (0,)):
                self.unjudged(name, f"{name} sets how hard a contact has to be to stop the arm")
            self._forget(nodes)
        else:
            self.unjudged(name, f"{name} is not in these files: it may move the arm")
            self._hook(name, None, nodes)

    def _hook(
        self,
        name: str,
        found: tuple[krl.KrlModule, krl.Routine] | None,
        nodes: tuple[krl.Node | None, ...],
    ) -> None:
        """Note a call of the integrator's process, and run what lies of it in these files."""
        values = tuple(map(self._argument, nodes))
        first = values[0] if values else math.nan
        number = float(first) if isinstance(first, int | float) else math.nan
        events, at = self.recorder.events, len(self.recorder.events)
        self.recorder.event(EventWord.HOOK, name, self.place(), number, plain_arguments(values))
        if found is not None:
            with self.recorder.within_hook(), self._advance.body():
                self._run_routine(*found, nodes, values)
                early = self._advance.earliest
            events[at] = events[at]._replace(early=early)
        elif name in self._world.stopping:
            events[at] = events[at]._replace(early=self._advance.stop())
        else:
            is_surmise = not self._advance.is_continued
            events[at] = events[at]._replace(early=self._advance.act(), is_surmise=is_surmise)

    def _argument(self, node: krl.Node | None) -> Any:  # noqa: ANN401 - a KRL value
        return UNKNOWN if node is None else self.evaluator.node(node)

    def _bas(self, statement: krl.Call) -> None:
        values = [self.evaluator.value(value) for value in statement.arguments]
        command = text_of(values[0]).lstrip("#").upper() if values else ""
        argument = values[1] if len(values) > 1 else UNKNOWN
        if command in ("TOOL", "BASE"):
            argument = self._memory.typed(argument, "INT", f"BAS(#{command})")
        if command == "INITMOV":
            self._advance.stop()
        if not self.state.bas(command, argument, self._active):
            self.unjudged(f"BAS(#{command})", f"BAS(#{command}) is not checked")
        self._missing_frames()

    def _resolve(self, name: str) -> tuple[krl.KrlModule, krl.Routine] | None:
        here = self._stack[-1].module
        local = here.routine(name)
        if local is not None:
            return here, local
        known = self._global_routines.get(name, [])
        if len(known) > 1:
            modules = " and ".join(module.name for module, _ in known)
            self.finding(RunKind.STRUCTURE, f"{name} is GLOBAL in {modules}: none of them loads")
        if known:
            return known[-1]
        module = self._modules.get(name)
        return (module, module.main) if module is not None and module.routines else None

    def _run_routine(
        self,
        module: krl.KrlModule,
        routine: krl.Routine,
        arguments: Sequence[krl.Node | None],
        values: Sequence[Any] | None = None,
    ) -> Any:  # noqa: ANN401
        """Run a routine; ``values`` of its arguments, where they are known already."""
        self._lines_left -= 1
        if len(self._stack) >= MAX_DEPTH:
            self.finding(RunKind.ENDLESS, f"{routine.name} is called within itself")
            return UNKNOWN
        if values is None:
            values = [self._argument(node) for node in arguments]
        names = [parameter.name.upper() for parameter in routine.parameters]
        line = self._stack[-1].line = self._line
        done = self._execute(module, routine, tuple(zip(names, values, strict=False)))
        self._line = line
        for parameter, name, node in zip(routine.parameters, names, arguments, strict=False):
            if parameter.mode != "IN" and isinstance(node, krl.Reference):
                self._assign_node(node, done.local.plain.get(name, UNKNOWN))
        return self._memory.typed(done.result, routine.result_type or "", routine.name)

    def _function(self, name: str, arguments: tuple[krl.Node | None, ...]) -> Any:  # noqa: ANN401
        found = self._resolve(name.upper())
        if found is not None:
            return self._run_routine(*found, arguments)
        known = predefined(name)
        if known is None:
            if name.upper() not in SILENT:
                self.unjudged(name, f"{name} is not in these files: it may move the arm")
            self._forget(arguments)
            return UNKNOWN
        return known([self._argument(node) for node in arguments])

    def _instruction(self, statement: krl.Raw) -> None:
        """Pass an instruction that is kept as written, unless it may move the arm."""
        if not is_quiet(statement):
            text = f"{statement.word} is not checked: it may move the arm or change how it moves"
            self.unjudged(statement.word, text)
        elif statement.word not in DECLARING:
            self._aside(statement.word)
        self._forget(map(_node, reading(statement)))

    def _forget(self, nodes: Iterable[krl.Node | None]) -> None:
        """Take the variables that something unknown may have written as not known."""
        for node in nodes:
            if isinstance(node, krl.Reference) and not node.name.startswith("$"):
                self._assign_node(node, UNKNOWN)

    def _trigger(self, statement: krl.Trigger) -> None:
        action = statement.action
        harmless = isinstance(action, krl.Assign) and is_still(action.target)
        if not (harmless or self._trust.is_hook(action) or self._trust.is_idle(action)):
            self.unjudged("TRIGGER", "a trigger does more than to switch an output or call a hook")
            return
        handler = self._handlers.get(type(action))
        if handler is not None:
            recorder = self.recorder
            before = len(recorder.events) + len(recorder.asides)
            recorder.in_trigger = True
            handler(action)
            if len(recorder.events) + len(recorder.asides) == before:
                self._aside("TRIGGER")
            recorder.in_trigger = False

    def _interrupt(self, statement: krl.Interrupt) -> None:
        """Note whether the delivered interrupt 3 is at work; what others do is not followed."""
        number = None if statement.number is None else self.evaluator.value(statement.number)
        action = statement.action
        self._aside("INTERRUPT", acts=number != 3)  # that of the INI only stops the program
        if statement.word == "DECL":
            if number == 3 or not isinstance(number, int):
                stops = _is_stop_message(statement)
                self.state.note(f"{STOPMESS} DECL", on=stops)
                self.state.note(STOPMESS, on=stops and STOPMESS in self.state.values.done)
                if stops:
                    return
            if not (isinstance(action, krl.Call) and self._trust.accepts(action.name)):
                text = "an interrupt may act at any moment, in the middle of a cut as well"
                self.unjudged("INTERRUPT", text)
        elif number == 3 or (statement.word in ("OFF", "DISABLE") and not isinstance(number, int)):
            is_on = statement.word in ("ON", "ENABLE")
            declared = f"{STOPMESS} DECL" in self.state.values.done
            self.state.note(STOPMESS, on=is_on and declared)

    def _wait(self, statement: krl.WaitSec) -> None:
        seconds = self.evaluator.value(statement.seconds)
        number = float(seconds) if isinstance(seconds, int | float) else math.nan
        if math.isnan(number):
            self.unjudged("WAIT SEC", "the waiting time is not known here")
        elif number > MAX_WAIT:
            self.finding(RunKind.WAIT, f"a wait of {number:g} s, expected at most {MAX_WAIT:g} s")
        self._stand(EventWord.DWELL, "WAIT SEC", number)

    def _stand(self, word: EventWord, name: str, value: float = math.nan) -> None:
        """Record what stops the advance run, or does not behind CONTINUE."""
        self.recorder.event(word, name, self.place(), value, early=self._advance.stop())

    def _joints_now(self) -> FloatArray | None:
        """Return the joints at the end of the last motion; only few programs ask."""
        self._searches += 1
        if self._searches > MAX_SEARCHES:
            return None
        return self._world.joints(self.recorder.trace(self.state))


def _is_stop_message(statement: krl.Interrupt) -> bool:
    """Return whether an interrupt is the one of the delivered INI."""
    condition = "".join(statement.condition.upper().split())
    return (
        condition in ("$STOPMESS==TRUE", "$STOPMESS")
        and isinstance(statement.action, krl.Call)
        and statement.action.name.upper() == "IR_STOPM"
    )


def _is_form(value: krl.Value) -> bool:
    """Return whether a function of the inline forms gives a value."""
    node = krl.parse_expression(value.text) if isinstance(value, krl.Expr) else None
    return isinstance(node, krl.FunctionCall) and predefined(node.name) is not None


def _node(value: krl.Value | None) -> krl.Node | None:
    if isinstance(value, krl.Expr):
        return krl.parse_expression(value.text)
    return value
