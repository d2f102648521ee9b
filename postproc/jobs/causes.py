"""Why tags fail, as a colleague would say it: one sentence for each cause, with the least cure.

Blame is by removal: a rule, a solid, the tool axis or the place is to blame if the job can be run
with it changed, and with nothing else. The smallest change is looked for by the poses alone; none
is told before the whole job is converted with it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, MeshPlacement
from postproc.errors import Finding
from postproc.geometry import AXES, rotation_z, transform
from postproc.model import ToolPath
from postproc.planning import Reach
from postproc.records import dataclass
from postproc.units import DEG, MM

WORDS = {
    "PLN101": "out of reach",
    "PLN102": "beyond a joint limit",
    "PLN103": "at a straight wrist",
    "PLN104": "in collision",
}
_LONGEST = 3.2
"""No farther move [m] is looked for: it would be another cell."""
_SHORTEST = 5.0 * MM
_CLOSE = 1.03
"""A least amount is known to this factor."""
_MORE = (1.0, 1.04, 1.08)
"""An amount that the poses allow is tried at these factors until the whole job can be run."""

Good = Callable[[Cell], bool]


@dataclass(frozen=True, slots=True)
class Cause:
    """Tags that fail together: ``reason`` as of their findings, what is to blame, what cures it.

    ``amount``: of the cure, in ``unit``; ``text``: the sentence. ``proven``: the job was converted
    with it, and is good.
    """

    tags: int
    reason: str
    blame: str
    remedy: str
    amount: float | None
    unit: str
    text: str
    proven: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class _Cure:
    """A change by amounts from 0 to ``most``; ``at`` returns the cell, ``words`` what to do."""

    blame: str
    most: float
    at: Callable[[float], Cell]
    words: Callable[[float], str]
    amount: Callable[[float], float | None] = lambda value: value
    unit: str = ""
    first: float = 0.0
    """Where the search begins; 0: only ``most`` is tried."""


def causes(
    toolpath: ToolPath, cell: Cell, findings: Sequence[Finding], converts: Good
) -> tuple[Cause, ...]:
    """Return why a job fails, with what cures it; nothing where no tag has failed by its pose.

    Args:
        toolpath: what was read.
        cell: as it is.
        findings: errors of the plan.
        converts: whether the whole job is good in a cell.
    """
    failing = {f.tag_index: f.code for f in findings if f.is_error and f.code in WORDS}
    if not failing or len(failing) < len({f.tag_index for f in findings if f.is_error}):
        return ()
    reason = Counter(failing.values()).most_common(1)[0][0]
    whole = len(failing) == len(toolpath)
    head = f"{'all ' if whole else ''}{len(failing)} tags are {WORDS[reason]}"
    head = head if len(failing) > 1 else f"tag {_name(toolpath, failing)} is {WORDS[reason]}"

    def stands(here: Cell) -> bool:
        return Reach.of(toolpath, here).serves(tuple(k for k in failing if k is not None))

    for cure in _cures(toolpath, cell, stands, hits="PLN104" in failing.values(), whole=whole):
        found = _least(cure, stands)
        for factor in _MORE if found is not None and cure.first else _MORE[:1]:
            if found is None or found * factor > cure.most:
                break
            value = _rounded(cure, found * factor)
            if converts(cure.at(value)):
                remedy = cure.words(value)
                text = f"{head}: {cure.blame}; {remedy} and all can be run"
                amount = cure.amount(value)
                return (
                    Cause(len(failing), reason, cure.blame, remedy, amount, cure.unit, text, True),
                )
    text = f"{head}: no single change of a rule, a solid, the tool axis or the place frees them all"
    return (Cause(len(failing), reason, "", "", None, "", text, False),)


def _name(toolpath: ToolPath, failing: dict[int | None, str]) -> str:
    tag = next(iter(failing))
    return "" if tag is None else toolpath.tag_name(tag)


def _rounded(cure: _Cure, value: float) -> float:
    return float(np.ceil(value / MM - 1e-6) * MM) if cure.unit == "mm" and cure.first else value


def _least(cure: _Cure, stands: Good) -> float | None:
    """Return the least amount with which the failing tags have a pose, None without any."""
    if not cure.first:
        return cure.most if stands(cure.at(cure.most)) else None
    low, high = 0.0, cure.first
    while not stands(cure.at(high)):
        low, high = high, 2.0 * high
        if low >= cure.most:
            return None
    while high > _CLOSE * low and high - low > cure.first / 8.0:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stands(cure.at(middle)) else (middle, high)
    return high


def _cures(
    toolpath: ToolPath, cell: Cell, stands: Good, *, hits: bool, whole: bool
) -> Iterator[_Cure]:
    """Yield changes, what is most likely to be wrong first: rules, solids, tool axis, place."""
    yield from _rules(cell)
    if hits:
        yield from _solids(cell, stands)
    shifts = _shifts(toolpath, cell)
    yield from _shortest([replace(cure, most=cure.most / 4.0) for cure in shifts], stands)
    if whole:
        yield from _tool_axes(cell)
        yield from _turns(toolpath, cell)
    yield from _shortest(shifts, stands)


def _shortest(cures: Sequence[_Cure], stands: Good) -> Iterator[_Cure]:
    """Yield the moves in the order of how far each has to go."""
    found = [(least, k) for k, cure in enumerate(cures) if (least := _least(cure, stands))]
    for least, k in sorted(found):
        yield replace(cures[k], first=least)


def _rules(cell: Cell) -> Iterator[_Cure]:
    """Yield the rules of the cell that are stricter than usual, each loosened."""
    limits, wishes = cell.limits, cell.optimize

    def limit(key: str, value: float, usual: float, unit: str, scale: float) -> Iterator[_Cure]:
        field = key.rsplit("_", 1)[0]
        if value > usual:
            yield _Cure(
                f"[limits] {key} = {value / scale:g} forbids every pose",
                value - usual,
                lambda by: replace(cell, limits=replace(limits, **{field: value - by})),
                lambda by: f"set {key} = {np.floor((value - by) / scale * 10.0) / 10.0:g}",
                lambda by: float(np.floor((value - by) / scale * 10.0) / 10.0),
                unit,
                0.02 * (value - usual),
            )

    yield from limit("joint_margin_deg", limits.joint_margin, 2.0 * DEG, "deg", DEG)
    yield from limit("singularity_deg", limits.singularity, 5.0 * DEG, "deg", DEG)
    yield from limit("clearance_mm", limits.clearance, 0.0, "mm", MM)
    if wishes.pins:
        yield _Cure(
            "the pins hold the spin",
            1.0,
            lambda by: replace(cell, optimize=replace(wishes, pins={})),
            lambda by: "take the pins off",
            lambda by: None,
        )
    low, high = wishes.range
    if high - low < 2.0 * np.pi - 1e-6:
        yield _Cure(
            f"[optimize] range_deg = [{low / DEG:g}, {high / DEG:g}] leaves no spin",
            np.pi,
            lambda by: replace(
                cell, optimize=replace(wishes, range=(max(low - by, -np.pi), min(high + by, np.pi)))
            ),
            lambda by: f"widen range_deg by {np.ceil(by / DEG):.0f} deg to both sides",
            lambda by: float(np.ceil(by / DEG)),
            "deg",
            wishes.step,
        )


def _solids(cell: Cell, stands: Good) -> Iterator[_Cure]:
    """Yield for each obstacle without which the tags are free the moves of it that free them."""
    for k, solid in enumerate(cell.obstacles):
        rest = replace(cell, obstacles=cell.obstacles[:k] + cell.obstacles[k + 1 :])
        if not stands(rest):
            continue
        blame = f"{solid.name!r} is in the way"
        ways = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
        yield from _shortest([_moved_solid(cell, k, way, blame) for way in ways], stands)
        yield _once(blame, rest, f"take {solid.name!r} away")


def _once(
    blame: str, there: Cell, words: str, amount: float | None = None, unit: str = ""
) -> _Cure:
    """Return a change that is made or not."""
    return _Cure(blame, 1.0, lambda _: there, lambda _: words, lambda _: amount, unit)


def _moved_solid(cell: Cell, k: int, way: FloatArray, blame: str) -> _Cure:
    name = cell.obstacles[k].name
    return _Cure(
        blame,
        _LONGEST / 4.0,
        lambda by: _with_moved(cell, k, by * way),
        lambda by: f"move {name!r} {by / MM:.0f} mm along {_way(way)} of the world",
        lambda by: by / MM,
        "mm",
        _SHORTEST,
    )


def _way(way: FloatArray) -> str:
    axis = int(np.argmax(np.abs(way)))
    return f"{'+' if way[axis] > 0 else '-'}{'xyz'[axis]}"


def _with_moved(cell: Cell, k: int, by: FloatArray) -> Cell:
    T = np.array(cell.obstacles[k].T_owner_mesh)
    T[:3, 3] += by
    moved: MeshPlacement = replace(cell.obstacles[k], T_owner_mesh=T)
    return replace(cell, obstacles=(*cell.obstacles[:k], moved, *cell.obstacles[k + 1 :]))


def _tool_axes(cell: Cell) -> Iterator[_Cure]:
    tool = cell.tool
    now = next((name for name in AXES if np.allclose(AXES[name], tool.axis)), "")
    flipped = now.translate(str.maketrans("+-", "-+"))
    for name in (flipped, *(other for other in AXES if other not in (now, flipped))):
        tools = tuple(replace(t, known_axis=AXES[name]) if t is tool else t for t in cell.tools)
        blame = f'the axis of tool {tool.number} is "{now}"'
        yield _once(blame, replace(cell, tools=tools), f'set axis = "{name}"')


def _turns(toolpath: ToolPath, cell: Cell) -> Iterator[_Cure]:
    """Yield turns of the part about the vertical through its middle."""
    centre = _middle(toolpath, cell)
    for turn in (180.0, 90.0, -90.0):
        R = rotation_z(turn * DEG)
        D = transform(R, centre - R @ centre)
        there = cell.rebased(lambda T, D=D: np.asarray(D @ T))  # type: ignore[misc]
        words = f"turn the part by {turn:g} deg about the vertical"
        yield _once("the robot stands on the wrong side of the part", there, words, turn, "deg")


def _shifts(toolpath: ToolPath, cell: Cell) -> list[_Cure]:
    """Return moves of the part: towards A1, away from it, and along the axes of the robot root."""
    centre = _middle(toolpath, cell)
    out = np.append(centre[:2], 0.0) / max(float(np.linalg.norm(centre[:2])), 1e-9)
    ways = [(-out, "towards A1"), (out, "away from A1")]
    for axis, sign in ((2, -1.0), (2, 1.0), (1, 1.0), (1, -1.0), (0, 1.0), (0, -1.0)):
        way = sign * np.eye(3)[axis]
        ways.append((way, f"along {_way(way)} of the robot root"))
    return [_moved_part(cell, way, words) for way, words in ways]


def _moved_part(cell: Cell, way: FloatArray, words: str) -> _Cure:
    return _Cure(
        "the part stands where the arm does not get to",
        _LONGEST,
        lambda by: cell.rebased(lambda T: np.asarray(transform(np.eye(3), by * way) @ T)),
        lambda by: f"move the part {by / MM:.0f} mm {words}",
        lambda by: by / MM,
        "mm",
        _SHORTEST,
    )


def _middle(toolpath: ToolPath, cell: Cell) -> FloatArray:
    points = Reach.of(toolpath, cell).points()
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))
