"""The best place of the part, or of the robot, for a job: searched, then proven by a full plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, cell_changes, edited_cell, frame_document
from postproc.errors import CellError, Finding, SourceRef, UsageError
from postproc.geometry import inverse, kuka_from_transform, rotation_z, transform_from_kuka
from postproc.jobs.convert import Conversion, ConvertRequest, convert, document, smallest_clearance
from postproc.jobs.given import Source, cell_of, part_of
from postproc.jobs.paged import Paged
from postproc.kinematics import build
from postproc.model import ToolPath
from postproc.planning import NEAR, Rank, Reach
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.units import DEG, MM

MOVES = ("part", "rail", "robot")
FREE = ("xyz", "xyzA")
_PLACES = 1200
"""Places of the coarse grid over the box and the turns, at most."""
_TURNS = 8
"""Turns about the vertical of the coarse grid."""
_CLIMBED = 12
"""Best places of the grid from which better ones are climbed to."""
_LEVELS = 4
"""Times that the step of the grid is halved."""
_RANKED = 24
"""Places that are asked for solids at once, ..."""
_ROUNDS = 3
"""... and how often the next ones are, while none is free."""
_PROVEN = 8
"""Places that are planned in full, at most."""
_XYZ_STEP = 1.0
_A_STEP = 0.1
"""A proposed place has whole millimetres and tenths of degrees."""

_Point = tuple[float, float, float, float]
"""X, Y, Z [mm] and the turn about the vertical [deg] of what moves."""


@dataclass(frozen=True)
class PlaceJob(Paged):
    """The place found: what moves, the cell with it, the plan that proves it, and all ranked.

    ``reach``: share of the compared tags in reach at every place of the search; ``ranked``: those
    that were asked for solids.
    """

    before: Cell
    cell: Cell
    move: str
    conversion: Conversion
    reach: Mapping[_Point, float]
    ranked: Mapping[_Point, Rank]
    plans: int

    @property
    def good(self) -> bool:
        """Whether the job can be run as it stands there."""
        return self.conversion.good

    @property
    def findings(self) -> Sequence[Finding]:
        """What stands against the place."""
        return self.conversion.findings

    @property
    def frame(self) -> dict[str, list[float]]:
        """``xyz_mm``, ``abc_deg`` of the part in the robot root, or of the robot in the world."""
        return frame_document(_frame(self.cell, self.move))

    @property
    def document(self) -> dict[str, Any]:
        """The ``postproc.place/1`` document."""
        stiffness = document(self.conversion)["stiffness"]
        clearance = smallest_clearance(self.conversion)
        lost = {f.tag_index for f in self.findings if f.is_error and f.tag_index is not None}
        tags = len(self.conversion.toolpath)
        unknown = not self.good and not lost
        shift = _frame(self.cell, self.move)[:3, 3] - _frame(self.before, self.move)[:3, 3]
        return {
            "schema": "postproc.place/1",
            "good": self.good,
            "move": self.move,
            "frame": self.frame,
            "moved_mm": [round(float(v) / MM, 6) + 0.0 for v in shift],
            "tags": tags,
            "tags_good": 0 if unknown else tags - len(lost),
            "stiffness_mean_N_per_mm": stiffness and round(stiffness["mean_N_per_mm"], 3),
            "clearance_mm": clearance and clearance["smallest_mm"],
            "searched": {
                "places": len(self.reach),
                "in_reach": sum(share >= 1.0 for share in self.reach.values()),
                "with_solids": len(self.ranked),
                "plans": self.plans,
            },
        }

    def page(self) -> bytes:
        """Return the page that shows how good each place is."""
        from postproc.jobs.pages import page_of_place

        return page_of_place(self)

    def cell_file(self, output: str | Path) -> bytes:
        """Write the cell with the place.

        Args:
            output: the path at which it will be saved; files that it names are given from there.

        Returns:
            The text of the cell file.
        """
        changes = cell_changes(self.before, self.cell)
        return edited_cell(self.before, changes, output)


def place(
    part: ToolPath | Source,
    cell: Cell | Source,
    box_mm: Sequence[float] | None = None,
    *,
    free: str = "xyz",
    move: str = "part",
    progress: Progress | None = None,
) -> PlaceJob:
    """Return the best place for a job: every tag in reach, then stiff, clear and unwound.

    Args:
        part: a toolpath of ``read``, or a file.
        cell: a cell of ``load_cell``, or a file.
        box_mm: (6,) lowest and highest corner of where the origin of what moves may be: of the part
            in the robot root, of the robot in the world; None: wherever the arm reaches.
        free: ``xyz``, or ``xyzA`` with turns about the vertical.
        move: ``part``, ``robot``, or ``rail`` with the robot on it.
        progress: called with (done, total, what).

    Returns:
        ``good``, ``frame``, ``findings``, ``document``, ``cell_file(output)``.

    Raises:
        CellError: CEL043 to move a rail that the cell does not have.
        UsageError: CLI016 for a box that is none, or none without a solid of the workpiece.
    """
    report = progress or (lambda done, total, what: None)
    cell = cell_of(cell)
    toolpath = part_of(part, cell)
    _check_call(cell, box_mm, free, move)
    search = _Search(Reach.of(toolpath, cell), cell, move, report)
    low, high = search.box() if box_mm is None else np.reshape(np.array(box_mm, float), (2, 3))
    search.scan(low, high, free)
    request = ConvertRequest(toolpath.path, cell.path)
    made: list[tuple[int, Conversion, Cell]] = []
    for point in search.best():
        report(len(made), _PROVEN, "plans")
        here = search.cell_at(point)
        done = convert(request, None, toolpath, here)
        made.append((len({f.tag_index for f in done.findings if f.is_error}), done, here))
        if done.good or not _of_the_place(done):
            break
    _, conversion, at = min(made, key=lambda one: one[0])
    return PlaceJob(cell, at, move, conversion, search.reach, search.ranked, len(made))


def _of_the_place(made: Conversion) -> bool:
    """Return whether an error may vanish at another place: a tag fails, or what was written."""
    errors = made.plan.errors
    return all(error.code.startswith("PLN1") for error in errors) if errors else len(made.plan) > 0


def _check_call(cell: Cell, box: Sequence[float] | None, free: str, move: str) -> None:
    if move not in MOVES or free not in FREE:
        text = f"{move!r}, {free!r}: expected one of {', '.join(MOVES)} and of {', '.join(FREE)}"
        raise UsageError("CLI016", text)
    if move == "rail" and not any(axis.kind == "rail" for axis in cell.external_axes):
        text = "the cell has no rail to move, expected an external axis of kind rail"
        raise CellError("CEL043", text, SourceRef(cell.path), "--move robot moves the robot")
    if box is None:
        if not any(base.meshes for base in cell.bases):
            text = "no --box, and no workpiece solid to keep it off the robot"
            hint = (
                "give --box X0 Y0 Z0 X1 Y1 Z1, where the origin of the part may be, or add "
                "meshes to the workpiece"
            )
            raise UsageError("CLI016", text, SourceRef(cell.path), hint)
        return
    low, high = np.reshape(np.array(box, dtype=np.float64), (2, 3))
    if not np.isfinite([low, high]).all() or (low > high).any():
        text = f"--box {' '.join(f'{v:g}' for v in box)}: expected its lower corner first"
        raise UsageError("CLI016", text)


def _frame(cell: Cell, move: str) -> FloatArray:
    """Return the frame that is placed: of the setup in work, or of the robot in the world."""
    return np.asarray(cell.T_robroot_base if move == "part" else cell.robot.T_world_robroot)


class _Search:
    """Places of one job that were looked at."""

    def __init__(
        self, reach: Reach, cell: Cell, move: str, report: Callable[[int, int, str], None]
    ) -> None:
        self._job, self._move, self._report = reach, move, report
        used = reach.pieces[0][0].cell.base_index if reach.pieces else 0
        self._cell = cell.with_tool(cell.tool_index, used)
        self._origin = _frame(self._cell, move)
        self.reach: dict[_Point, float] = {}
        self._score: dict[_Point, tuple[float, float, float]] = {}
        self.ranked: dict[_Point, Rank] = {}
        self._step = np.ones(4)

    def cell_at(self, point: _Point) -> Cell:
        """Return the cell with what moves at a point, as its file will say it."""
        x, y, z, turn = point
        T = np.array(self._origin)
        T[:3, :3] = rotation_z(turn * DEG) @ T[:3, :3]
        T = _as_written(transform_from_kuka([x, y, z], kuka_from_transform(T)[1]))
        if self._move == "part":
            D = T @ inverse(self._origin)
            return self._cell.rebased(lambda base: _as_written(D @ base))
        D = inverse(T) @ self._origin
        robot = replace(self._cell.robot, T_world_robroot=T)
        return replace(self._cell.rebased(lambda base: _as_written(D @ base)), robot=robot)

    def box(self) -> tuple[FloatArray, FloatArray]:
        """Return the corners (3,), (3,) [mm] of where the origin may be for the arm to reach."""
        points, reach = self._job.points() / MM, _reach(self._cell) / MM
        middle, lowest = 0.5 * (points.min(axis=0) + points.max(axis=0)), points[:, 2].min()
        origin = self._origin[:3, 3] / MM
        if self._move != "part":
            # as far from the part as the arm reaches, as high as it stands
            seen = self._origin[:3, :3] @ middle + origin
            away = np.array([reach, reach, 0.0])
            return np.append((seen - away)[:2], origin[2]), np.append((seen + away)[:2], origin[2])
        low, high = origin - middle - reach, origin - middle + reach
        # no tag is lower than the foot of the robot, or than where the part stands
        low[2] = max(low[2], origin[2] - lowest + min(lowest, 0.0))
        return low, np.maximum(low, high)

    def scan(self, low: FloatArray, high: FloatArray, free: str) -> None:
        """Look over the box [mm], coarsely; then closer where most is reached."""
        turns = np.arange(_TURNS) * (360.0 / _TURNS) if free == "xyzA" else np.zeros(1)
        size = high - low
        step = _step(size, _PLACES // len(turns))
        axes = [
            np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)) + 1) if b > a else np.array([a])
            for a, b in zip(low, high, strict=True)
        ]
        self._limits = low, high
        self._step = np.array([step, step, step, 360.0 / len(turns) if len(turns) > 1 else 0.0])
        grid = [self._rounded(np.array(p)) for p in product(*axes, turns)]
        now = self._rounded(np.append(self._origin[:3, 3] / MM, 0.0))
        for number, point in enumerate([now, *grid]):
            self._report(number, len(grid), "places")
            self._look(point)
        for level in range(1, _LEVELS + 1):
            self._report(level, _LEVELS, "closer places")
            for point in self._apart(self._order(), _CLIMBED, self._step / 2.0**level):
                self._around(point, self._step / 2.0**level)

    def best(self) -> Sequence[_Point]:
        """Return places in the order in which they are worth a plan."""
        self._job_ranked(self._apart(self._order(), _RANKED, self._step / 4.0))
        for number in range(2, _ROUNDS + 1):
            if any(rank.free >= 1.0 for rank in self.ranked.values()):
                break
            self._job_ranked(self._spread(_RANKED * number))
        top = max(self.ranked, key=lambda p: (self.ranked[p].key, self._nearness(p)))
        for step in (self._step / 4.0, self._step / 8.0):
            around = [p for p in self._neighbours(top, step) if self._look(p)[0] >= self.reach[top]]
            self._job_ranked(around)
            top = max(self.ranked, key=lambda p: (self.ranked[p].key, self._nearness(p)))
        order = sorted(
            self.ranked, key=lambda p: (self.ranked[p].key, self._nearness(p)), reverse=True
        )
        return self._apart(order, _PROVEN, self._step / 8.0)

    def _spread(self, most: int) -> list[_Point]:
        """Return places where as much is reached as anywhere, each far from those with solids."""
        best = max(self.reach.values())
        rest = [p for p, share in self.reach.items() if share >= best and p not in self.ranked]
        scale = np.where(self._step > 0.0, self._step, 1.0)
        where, asked = np.array(rest) / scale, np.array(list(self.ranked)) / scale
        taken: list[_Point] = []
        away = np.full(len(rest), np.inf)
        for at in asked:
            away = np.minimum(away, np.abs(where - at).max(axis=1))
        while len(taken) < min(most, len(rest)):
            far = int(np.argmax(away))
            taken.append(rest[far])
            away = np.minimum(away, np.abs(where - where[far]).max(axis=1))
        return taken

    def _nearness(self, point: _Point) -> tuple[float, ...]:
        """Return how near a place is to where things stand, to settle draws."""
        return (-round(float(np.linalg.norm(np.array(point[:3]) - self._origin[:3, 3] / MM)), 3),)

    def _job_ranked(self, points: Sequence[_Point]) -> None:
        for number, point in enumerate(points):
            self._report(number, len(points), "places with solids")
            if point not in self.ranked:
                self.ranked[point] = self._job.rank(self.cell_at(point))

    def _look(self, point: _Point) -> tuple[float, float, float]:
        """Return share in reach, least margin and mean margin of the tags at a place."""
        if point not in self._score:
            margins = self._job.margins(self.cell_at(point))
            there = np.isfinite(margins)
            least = min(float(margins.min(initial=np.inf)), NEAR) if there.all() else -1.0
            mean = float(np.minimum(margins[there], 4.0 * NEAR).sum()) / max(len(margins), 1)
            self.reach[point] = float(there.mean())
            self._score[point] = (self.reach[point], round(least, 4), round(mean, 4))
        return self._score[point]

    def _order(self) -> list[_Point]:
        return sorted(self._score, key=lambda p: (self._score[p], self._nearness(p)), reverse=True)

    def _around(self, point: _Point, step: FloatArray) -> None:
        for _ in range(_LEVELS):
            better = max(self._neighbours(point, step), key=self._look, default=point)
            if self._look(better) <= self._look(point):
                return
            point = better

    def _neighbours(self, point: _Point, step: FloatArray) -> list[_Point]:
        ways = [sign * step * axis for axis in np.eye(4) for sign in (1.0, -1.0) if step @ axis > 0]
        moved = {self._rounded(np.array(point) + way): None for way in ways}
        return [p for p in moved if p != point]

    def _rounded(self, point: FloatArray) -> _Point:
        low, high = self._limits
        xyz = np.clip(np.round(point[:3] / _XYZ_STEP) * _XYZ_STEP, low, high)
        turn = np.round((point[3] + 180.0) % 360.0 - 180.0, 9)
        turn = np.round(turn / _A_STEP) * _A_STEP
        x, y, z, a = (round(float(v), 6) + 0.0 for v in (*xyz, turn))
        return x, y, z, a

    def _apart(self, order: Sequence[_Point], most: int, step: FloatArray) -> list[_Point]:
        """Return the first of places that are no nearer to each other than a step."""
        scale = np.where(step > 0.0, step, 1.0) * 0.99
        taken: list[_Point] = []
        for point in order:
            if len(taken) == most:
                break
            off = np.abs(np.array(taken or [(np.inf,) * 4]) - point)
            off[:, 3] = np.minimum(off[:, 3], 360.0 - off[:, 3])
            if (off / scale).max(axis=1).min() >= 1.0:
                taken.append(point)
        return taken


def _step(size: FloatArray, most: int) -> float:
    """Return the step [mm] by which a box (3,) [mm] has about so many places."""
    step = max(float(size.max()), _XYZ_STEP)
    while np.prod(np.ceil(size / (0.9 * step) - 1e-9) + 1.0) <= most and step > 5.0 * _XYZ_STEP:
        step *= 0.9
    return step


def _as_written(T: FloatArray) -> FloatArray:
    """Return a frame as a cell file holds it, to the last digit."""
    frame = frame_document(T)
    return transform_from_kuka(frame["xyz_mm"], frame["abc_deg"])


def _reach(cell: Cell) -> float:
    """Return how far [m] the flange comes from the robot root."""
    low, high = np.asarray(cell.robot.q_min), np.asarray(cell.robot.q_max)
    q = np.random.default_rng(0).uniform(low, high, (2000, 6))
    tool = float(np.linalg.norm(cell.tool.T_flange_tcp[:3, 3]))
    return float(np.linalg.norm(build(cell.robot).fk(q)[:, :3, 3], axis=1).max()) + tool
