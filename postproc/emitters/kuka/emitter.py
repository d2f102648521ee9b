"""KUKA KRL: a plan to a main program and its sub-programs.

The main program holds the INI fold and sets tool and base after it; a long plan is cut into
sub-programs that the main program calls in order. Every file begins its motions with a PTP to axis
values, so no point needs a status and turn to be reached in the planned posture; CP motions keep
the posture they begin with. What is modal (speed, approximation) is written anew in each file.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import PurePath

import numpy as np

from postproc import krl
from postproc.cell import Cell, KrlOptions, Kss, Split
from postproc.emitters.former import part_title
from postproc.emitters.kuka import restart
from postproc.emitters.kuka.columns import (
    Columns,
    border_quality,
    calls_within,
    columns,
    operation_starts,
)
from postproc.emitters.kuka.events import EventWriter
from postproc.emitters.kuka.forms import FormWriter
from postproc.emitters.kuka.motion import ANCHOR_PERCENT, PartWriter
from postproc.emitters.kuka.points import PointStore
from postproc.emitters.kuka.restart import HoleGuards, Stage
from postproc.emitters.kuka.setup import HOOKS_MODULE, SETUP_ENDING, hooks_module, setup_statements
from postproc.emitters.kuka.template import TemplateSet
from postproc.errors import EmitError, SourceRef
from postproc.geometry import kuka_from_transform
from postproc.model import Event, MoveKind, Plan
from postproc.records import dataclass
from postproc.units import DEG, PERCENT

LAST_BASE_OF_KRC2 = 16
"""Larger numbers are its EX_BASE, which ``BAS(#FRAMES)`` selects and ``BAS(#BASE)`` refuses."""


def emit(
    plan: Plan, cell: Cell, *, names: krl.NameAllocator | None = None
) -> tuple[krl.KrlModule, ...]:
    """Return the modules of a plan, which begins with a PTP, the main program first.

    Issues are not looked at: whoever calls decides whether a plan with errors may become a program.
    ``names``: allocator of a batch; None for a single program.
    """
    if len(plan) == 0:
        raise EmitError("EMT310", "the plan has no move", SourceRef(plan.toolpath.path))
    if plan.kind[0] != MoveKind.PTP:
        raise EmitError("EMT310", "the plan must begin with a PTP", SourceRef(plan.toolpath.path))
    return _Program(plan, cell, names or krl.NameAllocator()).modules()


def render_files(modules: Sequence[krl.KrlModule]) -> dict[str, bytes]:
    """Return file name -> bytes of modules, in their order."""
    files: dict[str, bytes] = {}
    for module in modules:
        src, dat = krl.render(module)
        files[f"{module.name}.src"] = src
        if module.data is not None:
            files[f"{module.name}.dat"] = dat
    return files


@dataclass()
class _Program:
    """One plan on its way to modules."""

    plan: Plan
    cell: Cell
    names: krl.NameAllocator

    def modules(self) -> tuple[krl.KrlModule, ...]:
        """Return the main module and those of the parts."""
        parts = self.parts
        endings = krl.suffixes(len(parts)) if len(parts) > 1 else ()
        extra = (SETUP_ENDING,) if self.style.setup else ()
        self.names.reserve((HOOKS_MODULE, *self.style.hooks.values()))
        name = self.names.allocate(self.plan.name, (*endings, *extra))
        main_data = () if self.guards is None else restart.MAIN_DATA
        if endings:
            subs = [name + ending for ending in endings]
            handed = () if self.guards is None else restart.ARGUMENTS
            body = self._main([krl.Call(sub, handed) for sub in subs])
            modules = [self._module(name, body, main_data)]
            modules += [
                self._module(sub, *self._sub(number, part), is_sub=True)
                for number, (sub, part) in enumerate(zip(subs, parts, strict=True), 1)
            ]
        else:
            writer = self._writer(parts[0])
            body = self._main(writer.statements())
            data = [*main_data, *writer.points.declarations]
            modules = [self._module(name, body, data)]
        return (*modules, *self._extras(name))

    def _extras(self, name: str) -> list[krl.KrlModule]:
        """Return the separate modules that the cell asks for."""
        modules = []
        if self.style.setup:
            used = (self.plan.tool_of_moves, self.plan.base_of_moves)
            tools, bases = (sorted(set(column.tolist())) for column in used)
            body = setup_statements(self.cell, tools, bases, self.templates)
            modules.append(self._module(name + SETUP_ENDING, body))
        if self.style.hooks_example:
            modules.append(hooks_module(self.cell, self.templates))
        return modules

    @property
    def style(self) -> KrlOptions:
        return self.cell.krl

    @cached_property
    def templates(self) -> TemplateSet:
        return TemplateSet(self.style.template, SourceRef(self.cell.path))

    @cached_property
    def parts(self) -> tuple[krl.Part, ...]:
        forced = operation_starts(self.plan) if self.style.split is Split.OPERATIONS else []
        quality = border_quality(self.plan).astype(int)
        within = calls_within(self.plan)
        if self.guards is not None:
            stage, hole = self.guards.stage, self.guards.hole
            same = (stage[1:] == stage[:-1]) & (hole[1:] == hole[:-1])
            is_stroke = stage[1:] == Stage.STROKE
            quality[1:] = np.where(same | is_stroke, 0, quality[1:] + 1)
            within[1:] |= same & is_stroke
        quality[within] = krl.NO_BORDER
        source = SourceRef(self.cell.path)
        return krl.split(quality, self.style.max_points_per_file, forced, source)

    @cached_property
    def guards(self) -> HoleGuards | None:
        return HoleGuards.of(self.plan)

    @cached_property
    def table(self) -> Columns:
        borders = frozenset(part.first for part in self.parts[1:])
        return columns(self.plan, self.cell, borders, self.style.path_speed_max)

    @cached_property
    def events(self) -> EventWriter:
        return EventWriter(self.templates, self.style, self.plan.toolpath.path)

    @cached_property
    def homes(self) -> frozenset[int]:
        """Moves that go to where ``[motion] home_deg`` is, to the digits that are written."""
        home = self.cell.motion.home
        if home is None:
            return frozenset()
        is_ptp = self.plan.kind == MoveKind.PTP
        is_there = (np.abs(self.plan.q - np.asarray(home)) < 1e-7 * DEG).all(axis=1)
        return frozenset(np.flatnonzero(is_ptp & is_there).tolist())

    @cached_property
    def by_index(self) -> Mapping[int, Sequence[Event]]:
        found: dict[int, list[Event]] = defaultdict(list)
        for index, event in self.plan.events:
            found[index].append(event)
        return dict(found)

    def _writer(self, part: krl.Part) -> PartWriter:
        style = self.style
        is_named = self.plan.toolpath.names is not None
        points = PointStore(
            self._status_turn, self._point_name if is_named else None, self._numbers
        )
        return PartWriter(
            plan=self.plan,
            table=self.table,
            part=part,
            style=style,
            events=self.events,
            by_index=self.by_index,
            values=self._values,
            points=points,
            forms=FormWriter(points, style.kss),
            homes=self.homes,
            anchor_percent=min(ANCHOR_PERCENT, self.cell.motion.rapid / PERCENT),
            guards=self.guards,
        )

    def _point_name(self, index: int) -> str:
        tag = int(self.plan.tag[index])
        names = self.plan.toolpath.names
        return names[tag] if names is not None and 0 <= tag < len(names) else ""

    def _status_turn(self, index: int) -> tuple[int, int]:
        status, turn = self._postures
        return status[index], turn[index]

    @cached_property
    def _postures(self) -> tuple[list[int], list[int]]:
        from postproc.kinematics import build, status_turn

        status, turn = status_turn(build(self.cell.robot), self.plan.q)
        return status.tolist(), turn.tolist()

    # ----------------------------------------------------------------------------- the frame

    def _numbers(self, index: int) -> tuple[int, int]:
        """Return the numbers of tool and base of a move."""
        tool, base = self._frames[index]
        return self.cell.tools[tool].number, self.cell.bases[base].number

    @cached_property
    def _frames(self) -> list[tuple[int, int]]:
        tools, bases = self.plan.tool_of_moves.tolist(), self.plan.base_of_moves.tolist()
        return list(zip(tools, bases, strict=True))

    def _values(self, index: int) -> dict[str, object]:
        """Return what the frame templates get at a move."""
        style = self.style
        tool, base = self._numbers(index)
        return {
            "tool_number": tool,
            "base_number": base,
            "advance": style.advance,
            "positioner": any(axis.kind == "positioner" for axis in self.cell.external_axes),
            "external_base": style.kss is Kss.V5 and base > LAST_BASE_OF_KRC2,
            "orientation_speed": style.orientation_speed / DEG,
        }

    def _texts(self) -> dict[str, str]:
        plan = self.plan
        names = ", ".join(operation.name for operation in plan.toolpath.operations)
        return {
            "input": f"input: {PurePath(plan.toolpath.path.replace(chr(92), '/')).name}",
            "operations": f"operations: {names}" if names else "",
            "points": f"motions: {len(plan)}",
            "compensation": plan.compensation_note,
            "tool_name": self.cell.tools[self.plan.tool_of_moves[0]].name,
        }

    def _frames_told(self) -> list[str]:
        """Return tools and bases by number as the cell has them: ``base 3: X 1500, Y 0, ...``."""
        used = [sorted(set(column)) for column in zip(*self._frames, strict=True)]
        entries = [self.cell.tools[i] for i in used[0]], [self.cell.bases[i] for i in used[1]]
        told = [(f"tool {tool.number}", tool.T_flange_tcp) for tool in entries[0]]
        told += [(f"base {base.number}", base.T_robroot_base) for base in entries[1]]
        lines = []
        for name, T in told:
            values = np.round(np.hstack(kuka_from_transform(np.asarray(T))), 4) + 0.0
            six = (f"{word} {v:.10g}" for word, v in zip("XYZABC", values.tolist(), strict=True))
            lines.append(f"{name}: {', '.join(six)}")
        return lines

    def _main(self, body: Sequence[krl.Statement]) -> list[krl.Statement]:
        values, texts = {**self._values(0), "frames": self._frames_told()}, self._texts()
        return [
            *self.templates.statements("main_head", values, texts),
            *body,
            *self.templates.statements("main_tail", values, texts),
        ]

    def _sub(self, number: int, part: krl.Part) -> tuple[list[krl.Statement], list[krl.Statement]]:
        """Return the statements and the data of a sub-program."""
        values = self._values(part.first)
        title = part_title(number, len(self.parts), part.first, part.stop)
        texts = {**self._texts(), "part": title}
        writer = self._writer(part)
        body = [
            *self.templates.statements("sub_head", values, texts),
            *writer.statements(),
            *self.templates.statements("sub_tail", values, texts),
        ]
        return body, writer.points.declarations

    def _module(
        self,
        name: str,
        statements: list[krl.Statement],
        points: Sequence[krl.Statement] = (),
        *,
        is_sub: bool = False,
    ) -> krl.KrlModule:
        attributes = self._attributes(name)
        head = self.templates.statements("data_head", {})
        data = krl.DataList(name, (*head, *points), attributes=attributes)
        handed = restart.PARAMETERS if is_sub and self.guards is not None else ()
        if handed:
            statements = [restart.SUB_DATA, *statements]
        return krl.KrlModule(
            name, (krl.Routine(name, tuple(statements), handed),), data, attributes
        )

    def _attributes(self, name: str) -> tuple[str, ...]:
        lines = self.templates.lines("attributes", {"program": name})
        wrong = next((line for line in lines if not line.startswith("&")), None)
        if wrong is not None:
            text = f"template attributes gives {wrong!r}, expected & before each line"
            raise EmitError("EMT333", text, self.templates.file("attributes"))
        return tuple(line[1:] for line in lines)
