"""Why tags fail, as a colleague would say it: one sentence for each cause, with the least cure.

Blame is by removal: a rule, a solid, a unit, the tool axis or the place is to blame if the job can
be run with it changed, and with nothing else. Where no single change does, the smallest set of
rules and solids without which every tag has a pose is to blame. The least change is looked for by
the poses alone; none is told before the whole job is converted with it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import takewhile
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, IndexArray
from postproc.cell import Cell, cell_changes
from postproc.errors import Finding, PostprocError
from postproc.jobs import cures
from postproc.jobs.cures import Cure, Obstacle
from postproc.jobs.unit_doubts import on_the_part
from postproc.model import ToolPath
from postproc.planning import Reach
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.toml import Location

WORDS = {
    "PLN101": "out of reach",
    "PLN102": "beyond a joint limit",
    "PLN103": "at a straight wrist",
    "PLN104": "in collision",
}
_NEAR = 0.25
"""Share of the longest move of the part that is tried before the tool axis is doubted."""
_CLOSE = 1.03
"""A least amount is known to this factor, ..."""
_FINEST = 1.0 / 50.0
"""... or to this share of the first amount that is tried."""
_MORE = (1.0, 1.04, 1.08, 1.3, 1.7, 2.4)
"""An amount that the poses allow is tried at these factors until the whole job can be run."""
_ASKED = 24
"""So many failing tags, evenly taken, are asked whether they have a pose."""
_WAYS = 3
"""So many ways to move the same thing are converted with, the shortest first."""
_MOST = 400
"""So many changes are tried, then what is known is told."""
_CONVERSION = 10
"""As many tries of the poses alone take about as long as a conversion."""

Good = Callable[[Cell], bool]
Read = Callable[[Cell], ToolPath]


@dataclass(frozen=True, slots=True)
class Cause:
    """Tags that fail together: ``reason`` as of their findings, what is to blame, what cures it.

    ``amount``: of the cure, in ``unit``; ``text``: the sentence. ``proven``: the job was converted
    with it, and is good. ``changes``: what the cure is in the cell file, empty where it is nothing
    in there.
    """

    tags: int
    reason: str
    blame: str
    remedy: str
    amount: float | None
    unit: str
    text: str
    proven: bool
    changes: Mapping[Location, object] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        changes = [{"path": [*at], "value": value} for at, value in self.changes.items()]
        names = [name for name in self.__slots__ if name != "changes"]
        return {**{name: getattr(self, name) for name in names}, "changes": changes}


def causes(
    toolpath: ToolPath,
    cell: Cell,
    findings: Sequence[Finding],
    converts: Good,
    read: Read,
    progress: Progress | None = None,
) -> tuple[Cause, ...]:
    """Return why a job fails, with what cures it; nothing where no tag has failed by its pose.

    ``converts``: whether the whole job is good in a cell; ``read``: the input as it is read with a
    cell of another unit or tool axis.
    """
    failing = {
        f.tag_index: f.code
        for f in findings
        if f.is_error and f.code in WORDS and f.tag_index is not None
    }
    if not failing:
        return ()
    job = _Job(toolpath, cell, failing, read, converts, progress)
    ways = Counter[str]()
    try:
        for found in job.single():
            blame = found[0].blame
            ways[blame] += 1
            value = job.proven(found) if ways[blame] <= _WAYS else None
            if value is not None:
                return (job.cause_of(found, value),)
        return job.several()
    except _TriedEnoughError:
        return (job.unproven([], f"none of {_MOST} changes"),)


class _TriedEnoughError(Exception):
    """As many changes were tried as may be."""


class _Job:
    """A job that fails, asked in other cells."""

    def __init__(
        self,
        toolpath: ToolPath,
        cell: Cell,
        failing: Mapping[int, str],
        read: Read,
        converts: Good,
        report: Progress | None,
    ) -> None:
        self._path, self._cell, self._codes, self._read = toolpath, cell, failing, read
        self._converts, self._tried = converts, 0
        self._report = report or (lambda done, total, what: None)
        self._tags = np.array(sorted(failing))
        self._most = 2 * len(failing) > len(toolpath)
        self._hard = self._tags[:0]
        self._reach = Reach.of(toolpath, cell)
        names = [toolpath.tag_name(int(tag)) for tag in self._tags]
        self._rules = list(cures.rules(cell, names))
        self._hits = "PLN104" in failing.values()
        self._fixtures = list(cures.fixtures(cell))
        self._of_tools = list(cures.tool_solids(cell))
        self._of_parts = list(cures.part_solids(cell))
        self._solids = [*self._fixtures, *self._of_parts, *self._of_tools]

    # ---- what is asked --------------------------------------------------------------------------

    def _try(self, cost: int = 1) -> None:
        self._tried += cost
        if self._tried > _MOST:
            raise _TriedEnoughError
        self._report(self._tried, _MOST, "why tags fail: changes tried")

    def converts(self, cell: Cell) -> bool:
        """Return whether the whole job is good in a cell."""
        self._try(_CONVERSION)
        return self._converts(cell)

    def feasible(self, cell: Cell) -> bool:
        """Return whether the failing tags, and those that stood, have a pose in a cell."""
        self._try()
        some = self._tags[:: max(1, len(self._tags) // _ASKED)]
        try:
            reach = Reach.of(self._read(cell), cell)
            for asked in (self._hard, np.union1d(some, reach.spread())):
                good = reach.served(asked)
                if not good.all():
                    self._hard = asked[~good][:1]  # asked first from now on
                    return False
        except PostprocError:
            return False
        return True

    def _lost(self, cell: Cell) -> BoolArray:
        """Return which of the failing tags have no pose in a cell."""
        return ~Reach.of(self._read(cell), cell).served(self._tags)

    # ---- one cause ------------------------------------------------------------------------------

    def single(self) -> Iterator[tuple[Cure, float]]:
        """Yield changes with their least amounts, what is most likely to be wrong first."""
        for rule in self._rules:
            yield from self._tamed(rule)
        yield from self._of_place(suspect=True)
        hits = self._hits and self.feasible(cures.without(self._solids, self._cell))
        for thing in self._in_the_way() if hits else ():
            yield from self._least(thing.cures(self._cell))
        moves = self._least(cures.shifts(self._reach, self._cell))
        far: list[tuple[Cure, float]] = []
        for cure, least in moves:
            if least > _NEAR * cure.most:
                far = [(cure, least)]
                break
            yield cure, least
        yield from self._of_place(suspect=False)
        yield from far
        yield from moves
        for thing in self._of_parts if hits else ():
            yield from self._tamed(thing)

    def _of_place(self, *, suspect: bool) -> Iterator[tuple[Cure, float]]:
        """Yield units, tool axes and sides of the part that look wrong by themselves, or do not."""
        if (self._most or self._are_elsewhere()) is suspect:
            yield from self._least(list(cures.units(self._cell, self._unit())))
        if not self._most:
            return
        if cures.axis_points_back(self._cell) is suspect:
            yield from self._least(list(cures.tool_axes(self._cell)))
        if cures.turned_away(self._reach) is suspect:
            yield from self._least(list(cures.turns(self._reach, self._cell)))

    def _are_elsewhere(self) -> bool:
        """Return whether the failing tags lie off the solid of the part, as in a wrong unit."""
        first = 0
        for problem, _ in self._reach.pieces:
            own = self._tags[(self._tags >= first) & (self._tags < first + len(problem))] - first
            first += len(problem)
            points = problem.placement.p_base_tcp[own]
            if len(own) and on_the_part(points, problem.cell) is not False:
                return False
        return True

    def _unit(self) -> str:
        """Return the unit of the input that may be wrong; tags that lie on the part prove it."""
        pieces = [(p.placement.p_base_tcp[tags], p.cell) for p, tags in self._reach.pieces]
        if all(on_the_part(points, cell) for points, cell in pieces):
            return ""
        is_open = any(text.startswith("lengths in mm") for text in self._path.assumed)
        return self._cell.reading.units or ("mm" if is_open else "")

    def _in_the_way(self) -> Iterator[Obstacle]:
        """Yield solids without which all stand: fixtures, then tools with the part they hit."""
        yield from self._freeing(self._fixtures)
        tools, parts = self._freeing(self._of_tools), self._freeing(self._of_parts)
        yield from (cures.met(tool, part) for tool in tools for part in parts)
        if not parts:
            yield from tools

    def _freeing(self, things: Sequence[Obstacle]) -> list[Obstacle]:
        """Return the things that free the tags alone; no group without one of them does."""
        if not things or not self.feasible(cures.without(things, self._cell)):
            return []
        if len(things) == 1:
            return list(things)
        half = len(things) // 2
        return [*self._freeing(things[:half]), *self._freeing(things[half:])]

    def _tamed(self, thing: Obstacle) -> Iterator[tuple[Cure, float]]:
        """Yield what tames a thing, where the tags have a pose without it."""
        if self.feasible(thing.off(self._cell)):
            yield from self._least(thing.cures(self._cell))

    def _least(
        self, choices: Sequence[Cure], off: Callable[[Cell], Cell] = lambda cell: cell
    ) -> Iterator[tuple[Cure, float]]:
        """Yield cures with their least amounts: in their order, those with amounts by these."""
        before = list(takewhile(lambda cure: not cure.first, choices))
        graded = [cure for cure in choices if cure.first]
        for cure in before:
            if self._does(cure, cure.most, off):
                yield cure, cure.most
        size = 1.0
        while graded:
            found = []
            for cure in graded:
                high = min(size * cure.first, cure.most)
                if self._does(cure, high, off):
                    low = 0.5 * size * cure.first if size > 1.0 else 0.0
                    found.append((self._between(cure, low, high, off), cure))
            yield from ((cure, least) for least, cure in sorted(found, key=lambda one: one[0]))
            done = [cure for _, cure in found]
            graded = [c for c in graded if c not in done and size * c.first < c.most]
            size *= 2.0
        for cure in choices[len(before) :]:
            if not cure.first and self._does(cure, cure.most, off):
                yield cure, cure.most

    def _does(self, cure: Cure, by: float, off: Callable[[Cell], Cell]) -> bool:
        return cure.can(by) and self.feasible(off(cure.at(by)))

    def _between(self, cure: Cure, low: float, high: float, off: Callable[[Cell], Cell]) -> float:
        while high > _CLOSE * low and high - low > _FINEST * cure.first:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self._does(cure, middle, off) else (middle, high)
        return high

    def proven(self, found: tuple[Cure, float]) -> float | None:
        """Return the least amount with which the whole job is good, None without any."""
        cure, least = found
        bad = 0.0
        for factor in _MORE if cure.first else _MORE[:1]:
            value = cure.rounded(min(least * factor, cure.most))
            if cure.can(value) and self.converts(cure.at(value)):
                while value > _MORE[2] * max(bad, least):
                    middle = cure.rounded(0.5 * (value + max(bad, least)))
                    if middle >= value:
                        break
                    good = self.converts(cure.at(middle))
                    value, bad = (middle, bad) if good else (value, middle)
                return value
            bad = value
            if least * factor >= cure.most:
                break
        return None

    # ---- several causes -------------------------------------------------------------------------

    def several(self) -> tuple[Cause, ...]:
        """Return the causes that only together keep the job from being run."""
        things = [*self._rules, *self._solids]
        place, lost = self._placed(things)
        # converted is what is told, which is rounded
        here = self._cell if place is None else place[0].at(place[0].rounded(place[1]))
        served = place is not None or self.feasible(cures.without(things, here))
        needed = self._needed(things, here) if served else []
        found: list[tuple[Cure, float]] = [] if place is None else [place]
        which, start = [] if place is None else [lost], here
        for k, thing in enumerate(needed):
            rest = needed[k + 1 :]
            cure = next(self._least(thing.cures(here), lambda c, r=rest: cures.without(r, c)), None)  # type: ignore[misc]
            if cure is None:
                return (self.unproven(found),)
            alone = [other for other in needed if other is not thing]
            which.append(self._lost(cures.without(alone, start)))
            here = cure[0].at(cure[0].rounded(cure[1]))
            found.append(cure)
        if not found or not self.converts(here):
            return (self.unproven(found),)
        return tuple(
            self.cause_of((cure, least), cure.rounded(least), self._tags[tags], here)
            for (cure, least), tags in zip(found, which, strict=True)
        )

    def _placed(self, things: Sequence[Obstacle]) -> tuple[tuple[Cure, float] | None, BoolArray]:
        """Return what serves tags that have no pose even with everything else away, and which."""
        bare = cures.without(things, self._cell)
        lost = self._lost(bare)
        if not lost.any():
            return None, lost
        every = cures.shifts(self._reach, self._cell)
        return next(self._least(every, lambda cell: cures.without(things, cell)), None), lost

    def _needed(self, things: Sequence[Obstacle], cell: Cell) -> list[Obstacle]:
        """Return a smallest set of things without which the tags have a pose, suspects first."""

        def split(away: list[Obstacle], fresh: bool, left: list[Obstacle]) -> list[Obstacle]:
            if fresh and self.feasible(cures.without(away, cell)):
                return []
            if len(left) == 1:
                return left
            one, two = left[: len(left) // 2], left[len(left) // 2 :]
            second = split([*away, *one], True, two)
            return [*split([*away, *second], bool(second), one), *second]

        return split([], True, list(things)) if things else []

    # ---- answers ---------------------------------------------------------------------------

    def cause_of(
        self,
        found: tuple[Cure, float],
        value: float,
        tags: IndexArray | None = None,
        there: Cell | None = None,
    ) -> Cause:
        """Return a cause with the cure that is proven."""
        cure, who = found[0], "all" if tags is None else "they"
        tags = self._tags if tags is None or not len(tags) else tags
        reason, head = self._head(tags)
        remedy, amount = cure.words(value), cure.amount(value)
        text = f"{head}: {cure.blame}; {remedy} and {who} can be run"
        told = (len(tags), reason, cure.blame, remedy, amount, cure.unit, text)
        return Cause(*told, True, cell_changes(self._cell, there or cure.at(value)))

    def _head(self, tags: IndexArray) -> tuple[str, str]:
        reason = Counter(self._codes[int(tag)] for tag in tags).most_common(1)[0][0]
        count = len(tags)
        if count == 1:
            return reason, f"tag {self._path.tag_name(int(tags[0]))} is {WORDS[reason]}"
        whole = "all " if count == len(self._path) else ""
        return reason, f"{whole}{count} tags are {WORDS[reason]}"

    def unproven(
        self,
        found: Sequence[tuple[Cure, float]],
        change: str = "no change tried (limits, solids, units, tool axis, position)",
    ) -> Cause:
        """Return what is known where no change is proven to cure the job."""
        reason, head = self._head(self._tags)
        blame = ", ".join(cure.blame for cure, _ in found)
        text = f"{head}: {'; '.join(filter(None, [blame, change]))} makes the job good"
        return Cause(len(self._tags), reason, blame, "", None, "", text, False)
