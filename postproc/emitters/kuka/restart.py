"""A program that can begin at any of its holes: ``PP_START_HOLE`` in the data list of the main one.

Every move belongs to a hole, and is run if that hole or a later one that needs it is due:

- what opens a stretch of one tool (home, the change, spindle and coolant) if any hole of it is due;
- the way to a hole if the hole is due. Where the program begins at it, the arm goes there straight
  from home, which the planner has proven; if that is not free, the program goes along above earlier
  holes from the nearest one that can be got to;
- the stroke and the routines around it if the hole itself is due; then ``PP_LAST_HOLE`` is set.

What is modal is written anew behind every border, as the lines before may not have been run.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from postproc import krl
from postproc.arrays import AnyIntArray, BoolArray, IntArray
from postproc.model import Event, EventKind, MoveKind, MoveRole, Plan
from postproc.process import NUMBER
from postproc.records import dataclass

START, LAST = "PP_START_HOLE", "PP_LAST_HOLE"
STATES = frozenset(
    {
        EventKind.SPINDLE_ON,
        EventKind.SPINDLE_OFF,
        EventKind.COOLANT_ON,
        EventKind.COOLANT_OFF,
        EventKind.TOOL_CHANGE,
    }
)
"""Events that a program which begins behind them needs as well."""
_STROKE = (MoveRole.PLUNGE, MoveRole.LIFT, MoveRole.RETRACT)
_ARRIVAL = (MoveRole.ENTRY, MoveRole.APPROACH)


class Stage(IntEnum):
    """What moves do for their hole."""

    ALWAYS = 0
    OPEN = 1
    TRAVEL = 2
    STROKE = 3
    AFTER = 4


Key = tuple[Stage, int]
"""Stage and hole of neighbouring moves."""


@dataclass(frozen=True, slots=True)
class HoleGuards:
    """For each move (m,) its stage and hole, and for each hole (h + 1,) when its way is run.

    ``last`` (m,): last hole of the move's stretch; ``travel`` (h + 1,): largest number at which the
    program may begin and still go above the hole; ``entry`` (h + 1,): move that arrives above a
    hole at which the program may begin, -1 where it may not.
    """

    plan: Plan
    stage: IntArray
    hole: IntArray
    last: IntArray
    travel: IntArray
    entry: IntArray

    @classmethod
    def of(cls, plan: Plan) -> HoleGuards | None:
        """Return the guards of a plan, None if its holes are not numbered or axes travel."""
        if NUMBER not in plan.toolpath.extra or plan.external.shape[1]:
            return None
        numbers = np.asarray(plan.toolpath.extra[NUMBER], dtype=np.int64)
        count = int(numbers.max(initial=0))
        if not count:
            return None
        m = len(plan)
        stage, hole = np.zeros(m, dtype=np.int32), np.zeros(m, dtype=np.int32)
        last = np.zeros(m, dtype=np.int32)
        first_of = np.zeros(count + 1, dtype=np.int32)
        entry = np.full(count + 1, -1, dtype=np.int32)
        for low, high, _, _ in plan.stretches():
            rows = np.arange(low, high)
            own = numbers[plan.tag[rows]]
            inside = own[own > 0]
            if not len(inside):
                behind = numbers[plan.tag[high - 1] :]
                following = behind[behind > 0]
                hole[rows] = last[rows] = int(following[0]) if len(following) else 0
                stage[rows] = Stage.OPEN if len(following) else Stage.ALWAYS
                continue
            last[rows] = int(inside[-1])
            first_of[int(inside[0]) : int(inside[-1]) + 1] = int(inside[0])
            _sort_rows(plan, rows, own, stage, hole)
        arrive = np.flatnonzero((stage == Stage.TRAVEL) & np.isin(plan.role, _ARRIVAL))
        arrive = arrive[numbers[plan.tag[arrive]] == hole[arrive]]
        entry[hole[arrive]] = arrive
        alone = (plan.kind[arrive] == MoveKind.PTP) & (stage[arrive - 1] != Stage.TRAVEL)
        entry[hole[arrive[alone]]] = -1  # the way there is already the one from home
        direct = np.zeros(count + 1, dtype=np.bool_)
        tags = np.flatnonzero(numbers > 0)
        direct[numbers[tags]] = plan.restart[tags] == 1.0 if plan.restart is not None else False
        return cls(plan, stage, hole, last, *_reach(first_of, direct, entry))

    def key(self, index: int) -> Key:
        """Return stage and hole of a move."""
        return Stage(self.stage[index]), int(self.hole[index])

    def enter(self, key: Key, index: int, way: krl.Statement | None) -> list[krl.Statement]:
        """Return the lines before moves of a stage; ``way``: the motion straight above a hole."""
        stage, hole = key
        if stage is Stage.ALWAYS:
            return []
        limit = {Stage.TRAVEL: int(self.travel[hole]), Stage.STROKE: hole}
        lines: list[krl.Statement] = [_if(f"{START}<={limit.get(stage, int(self.last[index]))}")]
        if stage is Stage.STROKE:
            name = self.plan.toolpath.tag_name(int(self.plan.tag[index]))
            return [krl.Comment(f" HOLE {hole}: {krl.comment_text(name)}"), *lines]
        if stage is Stage.TRAVEL and way is not None:
            lines += [_if(f"{START}>{int(self.travel[hole - 1])}"), way, krl.Control("ELSE")]
        return lines

    def has_entry(self, key: Key) -> bool:
        """Return whether the program may begin with the way to this hole."""
        return key[0] is Stage.TRAVEL and int(self.entry[key[1]]) >= 0

    def leave(self, key: Key) -> list[krl.Statement]:
        """Return the lines behind moves of a stage."""
        stage, hole = key
        if stage is Stage.ALWAYS:
            return []
        if stage is Stage.STROKE:
            return [krl.Assign(LAST, hole), krl.Control("ENDIF")]
        return [krl.Control("ENDIF")] * (2 if self.has_entry(key) else 1)

    def only(self, number: int, statements: Sequence[krl.Statement]) -> list[krl.Statement]:
        """Return statements that are run if a hole, or one before it, is due."""
        if not statements or not number:
            return list(statements)
        return [_if(f"{START}<={number}"), *statements, krl.Control("ENDIF")]

    def is_earlier(self, event: Event, index: int) -> bool:
        """Return whether an event before a move belongs to the hole before it."""
        return event.index < int(self.plan.tag[index])


def _sort_rows(
    plan: Plan, rows: AnyIntArray, own: AnyIntArray, stage: IntArray, hole: IntArray
) -> None:
    """Fill stage and hole of the moves of one stretch that has holes."""
    role = np.asarray(plan.role)[rows]
    stroke = np.isin(role, _STROKE) & (own > 0)
    following = np.where(own > 0, own, np.iinfo(np.int32).max)
    following = np.minimum.accumulate(following[::-1])[::-1]
    behind = np.flatnonzero(stroke)[-1] + 1
    seen: BoolArray = np.zeros(len(rows), dtype=np.bool_)
    arrivals = np.flatnonzero(np.isin(role, _ARRIVAL) & (own > 0) & (np.arange(len(rows)) > 0))
    _, first = np.unique(own[arrivals], return_index=True)
    seen[arrivals] = True
    seen[arrivals[first]] = False
    stage[rows] = np.where(stroke | seen, Stage.STROKE, Stage.TRAVEL)
    hole[rows] = following
    stage[rows[behind:]], hole[rows[behind:]] = Stage.AFTER, own[own > 0][-1]
    stage[rows[0]] = Stage.OPEN
    hole[rows[0]] = own[own > 0][-1]


def _reach(first_of: IntArray, direct: BoolArray, entry: IntArray) -> tuple[IntArray, IntArray]:
    """Return ``travel`` and ``entry`` of all holes."""
    count = len(direct) - 1
    begin, travel = np.zeros(count + 1, dtype=np.int64), np.arange(count + 1, dtype=np.int32)
    for hole in range(1, count + 1):
        is_first = first_of[hole] == hole
        begin[hole] = hole if is_first or direct[hole] else begin[hole - 1]
        travel[int(begin[hole]) : hole + 1] = hole
    is_own = begin == np.arange(count + 1)
    may = is_own & (first_of != np.arange(count + 1)) & direct
    return travel, np.where(may, entry, -1).astype(np.int32)


PARAMETERS = (krl.Parameter(START, "IN"), krl.Parameter(LAST, "OUT"))
ARGUMENTS = (krl.Expr(START), krl.Expr(LAST))
"""What the main program hands to its sub-programs."""
SUB_DATA = krl.Declaration("INT", (krl.Variable(START), krl.Variable(LAST)))
MAIN_DATA = (
    krl.Comment(" the hole to begin with, to be set before the program is started; 1: all"),
    krl.Declaration("INT", (krl.Variable(START, None, 1),)),
    krl.Comment(" the last hole that was finished"),
    krl.Declaration("INT", (krl.Variable(LAST, None, 0),)),
)


def _if(condition: str) -> krl.Control:
    return krl.Control("IF", f"{condition} THEN")
