"""Single changes of a cell that may cure a job: each by an amount, in words, and as a cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, MeshPlacement, frame_document, load_robot, refitted, robot_names
from postproc.collision import solid as solid_of
from postproc.geometry import AXES, apply, axis_name, rotation_x, rotation_y, rotation_z, transform
from postproc.planning import Reach
from postproc.records import dataclass
from postproc.units import DEG, MM, SINGLE

LONGEST = 3.2
"""No farther move [m] is looked for: it would be another cell."""
SHORTEST = 5.0 * MM
"""The first move that is tried."""
_FINE = 50.0
"""Moves below this [mm] are told to a tenth of a mm, longer ones to the mm."""
_WRITTEN_SMALL = 10.0 * MM
"""A frame nearer to its origin is none of a cell in mm: its numbers are in another unit."""
_SAFE = 10.0 * MM
"""A smaller clearance is no rule to blame: what stands so near stands too near."""


@dataclass(frozen=True, slots=True)
class Cure:
    """A change by amounts up to ``most``: ``at`` the cell with it, ``words`` what to do.

    ``first``: where the search for the least amount begins; 0: only ``most`` is tried. ``amount``:
    what is told of it, in ``unit``. ``can``: whether it is possible, whatever it would cure.
    """

    blame: str
    most: float
    at: Callable[[float], Cell]
    words: Callable[[float], str]
    unit: str = ""
    first: float = 0.0
    amount: Callable[[float], float | None] = lambda value: value
    can: Callable[[float], bool] = lambda value: True

    def rounded(self, value: float) -> float:
        """Return an amount as it is told, never a smaller one."""
        if self.unit != "mm" or not self.first:
            return value
        step = MM if value > _FINE * MM else 0.1 * MM
        return float(np.ceil(value / step - 1e-6) * step)


@dataclass(frozen=True, slots=True)
class Obstacle:
    """What can be taken away: ``off`` the cell without it, ``cures`` the changes that tame it."""

    off: Callable[[Cell], Cell]
    cures: Callable[[Cell], Sequence[Cure]]
    name: str = ""


def without(things: Sequence[Obstacle], cell: Cell) -> Cell:
    """Return a cell without some things."""
    for thing in things:
        cell = thing.off(cell)
    return cell


def once(blame: str, there: Cell, words: str, amount: float | None = None, unit: str = "") -> Cure:
    """Return a change that is made or not."""
    return Cure(blame, 1.0, lambda _: there, lambda _: words, unit, amount=lambda _: amount)


def shift(
    blame: str,
    most: float,
    at: Callable[[float], Cell],
    words: Callable[[float], str],
    can: Callable[[float], bool] = lambda by: True,
) -> Cure:
    """Return a change by a length of up to ``most`` [m], told in mm."""
    return Cure(blame, most, at, words, "mm", SHORTEST, lambda by: by / MM, can)


# ---- rules ---------------------------------------------------------------------------------------


def rules(cell: Cell, failing: Sequence[str]) -> Iterator[Obstacle]:
    """Yield the rules that are stricter than usual; ``failing``: names of the tags that fail."""
    limits = cell.limits
    yield from _limit("joint_margin_deg", limits.joint_margin, 2.0 * DEG, "deg", DEG)
    yield from _limit("singularity_deg", limits.singularity, 5.0 * DEG, "deg", DEG)
    yield from _limit("clearance_mm", limits.clearance, _SAFE, "mm", MM)
    yield from _axis_limits(cell)
    pinned = [name for name in cell.optimize.pins if name in set(failing)]
    if pinned:
        yield _pins(pinned)
    low, high = cell.optimize.range
    if high - low < 2.0 * np.pi - 1e-6:
        yield _range(low, high)


def _limit(key: str, value: float, usual: float, unit: str, scale: float) -> Iterator[Obstacle]:
    field = key.rpartition("_")[0]

    def at(cell: Cell, by: float) -> Cell:
        return replace(cell, limits=replace(cell.limits, **{field: written(by) * scale}))

    def written(by: float) -> float:
        return round(float(np.floor((value - by) / scale * 10.0 + 1e-6) / 10.0), 6)

    def cures(cell: Cell) -> list[Cure]:
        return [
            Cure(
                f"[limits] {key} = {value / scale:g} forbids every pose",
                value - usual,
                lambda by: at(cell, by),
                lambda by: f"set {key} = {written(by):g}",
                unit,
                0.02 * (value - usual),
                written,
            )
        ]

    if value > usual:
        yield Obstacle(lambda cell: at(cell, value - usual), cures)


def _axis_limits(cell: Cell) -> Iterator[Obstacle]:
    """Yield each axis that the cell holds within less than its arm allows."""
    if cell.robot.name not in robot_names():
        return
    free = load_robot(cell.robot.name)
    for axis in range(6):
        own = cell.robot.q_min[axis], cell.robot.q_max[axis]
        ends = free.q_min[axis], free.q_max[axis]
        if own[0] > ends[0] + 1e-9 or own[1] < ends[1] - 1e-9:
            yield _axis_limit(axis, own, ends)


def _axis_limit(axis: int, own: tuple[float, float], ends: tuple[float, float]) -> Obstacle:
    name = f"A{axis + 1}"
    more = own[0] - ends[0], ends[1] - own[1]

    def at(cell: Cell, low: float, high: float) -> Cell:
        q_min, q_max = np.array(cell.robot.q_min), np.array(cell.robot.q_max)
        q_min[axis], q_max[axis] = written(low, high)
        return replace(cell, robot=replace(cell.robot, q_min=q_min, q_max=q_max))

    def written(low: float, high: float) -> tuple[float, float]:
        degrees = np.floor((own[0] - low) / DEG + 1e-6), np.ceil((own[1] + high) / DEG - 1e-6)
        return max(degrees[0] * DEG, ends[0]), min(degrees[1] * DEG, ends[1])

    def cure(cell: Cell, low: float, high: float) -> Cure:
        most = max(low * more[0], high * more[1])

        def ways(by: float) -> tuple[float, float]:
            return min(low * by, more[0]), min(high * by, more[1])

        def words(by: float) -> str:
            new = (v / DEG for v in written(*ways(by)))
            return f"let {name} turn from {' to '.join(f'{v:g}' for v in new)} deg"

        blame = f"the cell lets {name} turn from {own[0] / DEG:g} to {own[1] / DEG:g} deg only"
        first = 0.02 * most
        return Cure(
            blame,
            most,
            lambda by: at(cell, *ways(by)),
            words,
            "deg",
            first,
            lambda by: float(np.ceil(by / DEG)),
        )

    def cures(cell: Cell) -> list[Cure]:
        sides = [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
        return [cure(cell, *side) for side in sides if max(np.multiply(side, more)) > 1e-9]

    return Obstacle(lambda cell: at(cell, *more), cures)


def _pins(names: Sequence[str]) -> Obstacle:
    def off(cell: Cell) -> Cell:
        pins = {name: spin for name, spin in cell.optimize.pins.items() if name not in names}
        return replace(cell, optimize=replace(cell.optimize, pins=pins))

    which = f"the pin of {names[0]} holds its spin" if len(names) == 1 else "the pins hold the spin"
    words = "take the pin off" if len(names) == 1 else f"take the pins of {', '.join(names)} off"
    return Obstacle(off, lambda cell: [once(which, off(cell), words)])


def _range(low: float, high: float) -> Obstacle:
    def at(cell: Cell, by: float) -> Cell:
        more = float(np.ceil(by / DEG)) * DEG
        wide = max(low - more, -np.pi), min(high + more, np.pi)
        return replace(cell, optimize=replace(cell.optimize, range=wide))

    def cures(cell: Cell) -> list[Cure]:
        def words(by: float) -> str:
            new = ", ".join(f"{v / DEG:g}" for v in at(cell, by).optimize.range)
            return f"set range_deg = [{new}]"

        blame = f"[optimize] range_deg = [{low / DEG:g}, {high / DEG:g}] leaves no spin"
        degrees = lambda by: float(np.ceil(by / DEG))  # noqa: E731
        return [Cure(blame, np.pi, lambda by: at(cell, by), words, "deg", 2.0 * DEG, degrees)]

    return Obstacle(lambda cell: at(cell, np.pi), cures)


# ---- solids --------------------------------------------------------------------------------------


def fixtures(cell: Cell) -> Iterator[Obstacle]:
    """Yield the obstacles of a cell."""
    for solid in cell.obstacles:
        yield _solid(solid, repr(_name(solid)), "the world")


def tool_solids(cell: Cell) -> Iterator[Obstacle]:
    """Yield the solids of the tools."""
    for tool in cell.tools:
        for solid in tool.meshes:
            yield _solid(solid, f"{_name(solid)!r} of tool {tool.number}", "the flange")


def part_solids(cell: Cell) -> Iterator[Obstacle]:
    """Yield the solids of the parts."""
    for base in cell.bases:
        for solid in base.meshes:
            name = f"{_name(solid)!r} of the part in base {base.number}"
            yield _solid(solid, name, f"base {base.number}")


def met(tool: Obstacle, part: Obstacle) -> Obstacle:
    """Return two solids of which either one alone has to go, as one thing to blame."""

    def cures(cell: Cell) -> list[Cure]:
        found = {cure.words(cure.most): cure for one in (part, tool) for cure in one.cures(cell)}
        blame = f"{tool.name} hits {part.name}"
        # what has no amount is a wrong scale, and says so itself
        return [replace(cure, blame=blame) if cure.first else cure for cure in found.values()]

    return Obstacle(tool.off, cures)


def _name(solid: MeshPlacement) -> str:
    is_named = solid.name.rstrip("0123456789 ") not in ("tool", "workpiece", "obstacle")
    return solid.name if is_named or solid.file is None else solid.file.name


def _solid(solid: MeshPlacement, name: str, frame: str) -> Obstacle:
    def off(cell: Cell) -> Cell:
        return _swapped(cell, solid, None)

    def cures(cell: Cell) -> list[Cure]:
        blame = f"{name} is in the way"
        is_fixture = any(solid is one for one in cell.obstacles)
        can = _can_stand(cell, solid) if is_fixture else lambda by: True
        signed = [sign * way for way in np.eye(3) for sign in (1.0, -1.0)]
        moves = [_moved_solid(cell, solid, way, can, blame, name, frame) for way in signed]
        if solid.file is not None and not np.isclose(solid.scale, MM):
            right = _swapped(cell, solid, replace(solid, scale=MM))
            scaled = f"{name} has scale = {solid.scale / MM:g}"
            moves.insert(0, once(scaled, right, "set scale = 1"))
        longer = () if is_fixture else _longer(cell, blame)
        away = [once(blame, off(cell), f"take {name} away")] if is_fixture else []
        return [*longer, *moves, *away]

    return Obstacle(off, cures, name)


def _moved_solid(
    cell: Cell,
    solid: MeshPlacement,
    way: FloatArray,
    can: Callable[[FloatArray], bool],
    blame: str,
    name: str,
    frame: str,
) -> Cure:
    def at(by: float) -> Cell:
        T = np.array(solid.T_owner_mesh)
        T[:3, 3] += by * way
        return _swapped(cell, solid, replace(solid, T_owner_mesh=T))

    def words(by: float) -> str:
        return f"move {name} {by / MM:g} mm along {axis_name(way)} of {frame}"

    return shift(blame, LONGEST / 4.0, at, words, lambda by: can(by * way))


def _can_stand(cell: Cell, fixture: MeshPlacement) -> Callable[[FloatArray], bool]:
    """Return whether a fixture moved by (3,) [m] comes no deeper into what else stands there."""
    box, others = _box(fixture, np.eye(4)), _boxes(cell, fixture)
    depth = [_depth(box, other) + 1e-9 for other in others]

    def can(by: FloatArray) -> bool:
        return all(_depth(box + by, other) <= now for other, now in zip(others, depth, strict=True))

    return can


def _box(placement: MeshPlacement, T_world_owner: FloatArray) -> FloatArray:
    """Return the corners (2, 3) of the box around a solid in the world [m]."""
    vertices = apply(T_world_owner, solid_of(placement).vertices)
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def _boxes(cell: Cell, moved: MeshPlacement) -> list[FloatArray]:
    """Return the boxes of what stands in the cell beside a fixture: it cannot be moved into it."""
    found = [_box(solid, np.eye(4)) for solid in cell.obstacles if solid is not moved]
    for base in cell.bases:
        T = cell.robot.T_world_robroot @ base.T_robroot_base
        found += [_box(solid, T) for solid in base.meshes]
    return found


def _depth(one: FloatArray, other: FloatArray) -> float:
    """Return how deep [m] two boxes (2, 3) lie in each other, 0 where they do not."""
    shared = np.minimum(one[1], other[1]) - np.maximum(one[0], other[0])
    return max(float(shared.min()), 0.0)


def _longer(cell: Cell, blame: str) -> Iterator[Cure]:
    """Yield a longer tool, where one tool is all that works."""
    if len(cell.tools) != 1 or cell.tool.known_axis is None:
        return
    tool = cell.tool

    def at(by: float) -> Cell:
        along = tool.T_flange_tcp[:3, :3] @ tool.axis
        D = transform(np.eye(3), by * along)
        longer = refitted(tool, D @ tool.T_flange_tcp, tool.axis, by)
        return replace(cell, tools=(longer,))

    def words(by: float) -> str:
        frame = frame_document(at(by).tool.T_flange_tcp)["xyz_mm"]
        at_mm = ", ".join(f"{v:g}" for v in frame)
        return f"use a tool {by / MM:g} mm longer (tool {tool.number}: xyz_mm = [{at_mm}])"

    yield shift(blame, LONGEST / 4.0, at, words)


def _swapped(cell: Cell, old: MeshPlacement, new: MeshPlacement | None) -> Cell:
    """Return the cell with a solid, known as the same object, moved or taken away."""

    def swap(meshes: tuple[MeshPlacement, ...]) -> tuple[MeshPlacement, ...]:
        put = () if new is None else (new,)
        return tuple(s for mesh in meshes for s in (put if mesh is old else (mesh,)))

    return replace(
        cell,
        tools=tuple(replace(tool, meshes=swap(tool.meshes)) for tool in cell.tools),
        bases=tuple(replace(base, meshes=swap(base.meshes)) for base in cell.bases),
        obstacles=swap(cell.obstacles),
    )


# ---- units, tool axis, place ---------------------------------------------------------------------


def units(cell: Cell, unit: str) -> Iterator[Cure]:
    """Yield other units of the input, and of frames that are too small.

    ``unit``: that of the input now, empty where it says so itself.
    """
    for other in ("mm", "inch", "m") if unit else ():
        if other != unit:
            there = replace(cell, reading=replace(cell.reading, units=other))
            blame = f"the file is read in {unit}"
            words = f'read it in {other} (--units {other}, or [import] units = "{other}")'
            yield once(blame, there, words)
    bases = tuple(replace(base, T_robroot_base=_larger(base.T_robroot_base)) for base in cell.bases)
    tools = tuple(
        tool if tool.known_axis is None else refitted(tool, _larger(tool.T_flange_tcp), tool.axis)
        for tool in cell.tools
    )
    for frames, what, there in (
        ([base.T_robroot_base for base in cell.bases], "workpiece", replace(cell, bases=bases)),
        ([tool.T_flange_tcp for tool in cell.tools], "tool", replace(cell, tools=tools)),
    ):
        size = max(float(np.abs(T[:3, 3]).max()) for T in frames)
        if 0.0 < size < _WRITTEN_SMALL:
            numbers = ", ".join(f"{v:g}" for v in frame_document(_larger(frames[0]))["xyz_mm"])
            text = f"the frame of the {what} is written in m, not mm"
            yield once(text, there, f"set its xyz_mm = [{numbers}]")


def _larger(T: FloatArray) -> FloatArray:
    larger = np.array(T)
    larger[:3, 3] *= SINGLE["m"].factor / SINGLE["mm"].factor
    return larger


def tool_axes(cell: Cell) -> Iterator[Cure]:
    """Yield the other axes of the tool in work, the opposite one first."""
    tool = cell.tool
    if tool.known_axis is None:
        return
    now = axis_name(tool.axis)
    flipped = now.translate(str.maketrans("+-", "-+"))
    for name in (flipped, *(other for other in AXES if other not in (now, flipped))):
        other = refitted(tool, tool.T_flange_tcp, AXES[name])
        tools = tuple(other if one is tool else one for one in cell.tools)
        blame = f'the axis of tool {tool.number} is "{now}"'
        yield once(blame, replace(cell, tools=tools), f'set axis = "{name}"')


def turns(reach: Reach, cell: Cell) -> Iterator[Cure]:
    """Yield turns of the part about the vertical through its middle, then about the level."""
    centre = _middle(reach)
    about = (
        (rotation_z, "vertical", (180.0, 90.0, -90.0)),
        (rotation_x, "x axis of the robot", (180.0,)),
        (rotation_y, "y axis of the robot", (180.0,)),
    )
    for rotation, axis, angles in about:
        for turn in angles:
            R = rotation(turn * DEG)
            D = transform(R, centre - R @ centre)
            there = cell.rebased(lambda T, D=D: np.asarray(D @ T))  # type: ignore[misc]
            frame = frame_document(there.bases[0].T_robroot_base)
            where = ", ".join(
                f"{key} = [{', '.join(f'{v:g}' for v in np.round(values, 3) + 0.0)}]"
                for key, values in frame.items()
            )
            words = f"turn the part by {turn:g} deg about the {axis} (base {where})"
            if len(there.bases) > 1:
                words = f"turn the parts by {turn:g} deg about the {axis}"
            yield once("the robot is on the wrong side of the part", there, words, turn, "deg")


def shifts(reach: Reach, cell: Cell) -> list[Cure]:
    """Return moves of the part: towards A1, away from it, and along the axes of the robot root."""
    centre = _middle(reach)
    out = np.append(centre[:2], 0.0) / max(float(np.linalg.norm(centre[:2])), 1e-9)
    ways = [(-out, "towards A1"), (out, "away from A1")]
    for axis, sign in ((2, -1.0), (2, 1.0), (1, 1.0), (1, -1.0), (0, 1.0), (0, -1.0)):
        way = sign * np.eye(3)[axis]
        ways.append((way, f"along {axis_name(way)} of the robot root"))
    return [_moved_part(cell, way, words) for way, words in ways]


def _moved_part(cell: Cell, way: FloatArray, words: str) -> Cure:
    return shift(
        "the part is out of the arm's reach",
        LONGEST,
        lambda by: cell.rebased(lambda T: np.asarray(transform(np.eye(3), by * way) @ T)),
        lambda by: f"move the part {by / MM:g} mm {words}",
    )


def _middle(reach: Reach) -> FloatArray:
    points = reach.points()
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def axis_points_back(cell: Cell) -> bool:
    """Return whether the tool's axis points from its tip back to the flange or across the way."""
    tool = cell.tool
    if tool.known_axis is None:
        return False
    tip = tool.T_flange_tcp[:3, 3]
    return bool(tool.T_flange_tcp[:3, :3] @ tool.axis @ tip <= 1e-9 * np.linalg.norm(tip))


def turned_away(reach: Reach) -> bool:
    """Return whether the tool has to come from the side of the part away from the robot."""
    points, axes = reach.points(), reach.axes()
    out = points[:, :2] / np.maximum(np.linalg.norm(points[:, :2], axis=1, keepdims=True), 1e-9)
    return bool((out * axes[:, :2]).sum(axis=1).mean() > 0.5 or axes[:, 2].mean() < -0.5)
