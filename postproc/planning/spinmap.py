"""The spin map: what every turn about the tool axis would mean at every tag.

Spin by tag, each cell with a class (free, collision, singular, joint limit, unreachable) and the
best stiffness that a branch gives there, with the chosen line on it. Every pose is checked, so a
map of many tags takes longer than a plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from postproc.kinematics.model import build
from postproc.kinematics.singular import wrist_distance
from postproc.model.arrays import FloatArray, IntArray
from postproc.model.cell import Cell
from postproc.model.plan import Plan
from postproc.model.toolpath import ToolPath
from postproc.planning.candidates import sample
from postproc.planning.feasible import Checker
from postproc.planning.planner import problem_of
from postproc.planning.settings import PlanOptions, settle
from postproc.planning.stroke import strokes_of
from postproc.units import DEG, N_PER_MM


class SpinClass(IntEnum):
    """Best that any branch offers at a spin."""

    FREE = 0
    COLLISION = 1
    SINGULAR = 2
    JOINT_LIMIT = 3
    UNREACHABLE = 4


class Grade(IntEnum):
    """Criteria classes of a chosen pose."""

    GOOD = 0
    ACCEPTABLE = 1
    CRITICAL = 2
    INVALID = 3


ACCEPTABLE_LOSS = 0.05
"""Loss of stiffness against the tag's own optimum above which a pose is no longer good."""
CRITICAL_LOSS = 0.25
NEAR_LIMIT = 5.0 * DEG
"""A joint nearer than this to its margin makes a pose acceptable only, nearer than a fifth of it
critical; likewise the wrist and its distance from straight."""


@dataclass(frozen=True, slots=True)
class SpinMap:
    """Spins (S,) [rad] by tags (n,).

    ``classes`` (n, S) ``SpinClass``; ``stiffness`` (n, S) [N/m] of the best free branch, NaN where
    none is free or the cell has no stiffness; ``chosen`` (n,) spin of the plan [rad] or NaN.
    """

    spins: FloatArray
    tags: IntArray
    classes: IntArray
    stiffness: FloatArray
    chosen: FloatArray

    def to_csv(self, toolpath: ToolPath) -> str:
        """Return the map as text: one row a tag and spin, CR LF free, fixed digits."""
        rows = ["tag,line,spin_deg,class,stiffness_N_per_mm,chosen_deg"]
        for i, tag in enumerate(self.tags.tolist()):
            name, line = toolpath.tag_name(tag), int(toolpath.line[tag])
            chosen = _text(self.chosen[i] / DEG)
            for j, spin in enumerate((self.spins / DEG).tolist()):
                kind = SpinClass(int(self.classes[i, j])).name.lower()
                k = _text(self.stiffness[i, j] / N_PER_MM)
                rows.append(f"{name},{line},{spin:.3f},{kind},{k},{chosen}")
        return "\n".join(rows) + "\n"


def spin_map(
    toolpath: ToolPath, cell: Cell, result: Plan | None = None, tags: IntArray | None = None
) -> SpinMap:
    """Return the spin map of tags (all by default), with the line of a plan where given.

    Raises:
        CellError: as ``planner.plan``.
    """
    from postproc.collision.scene import Scene

    cell, settings = settle(cell, PlanOptions())
    problem = problem_of(toolpath, cell, settings)
    scene = Scene.build(cell, problem.kinematics)
    checker = Checker(problem, strokes_of(problem.toolpath, settings.approach), scene)
    rows = np.arange(len(toolpath)) if tags is None else np.asarray(tags, dtype=np.int64)
    classes, stiffness = _classes(checker, rows)
    chosen = np.full(len(rows), np.nan)
    if result is not None:
        spin = np.full(len(toolpath), np.nan)
        spin[result.tag] = result.spin
        chosen = spin[rows]
    return SpinMap(settings.spins, rows.astype(np.int32), classes, stiffness, chosen)


def _classes(checker: Checker, tags: np.ndarray) -> tuple[IntArray, FloatArray]:
    """Return class and best stiffness (n, S), every pose checked."""
    problem = checker.problem
    spins = problem.settings.spins
    n, width = len(tags), len(spins)
    which, turn = np.repeat(tags, width), np.tile(spins, n)
    slots, valid = problem.kinematics.ik(
        problem.placement.flange(problem.placement.tcp(which, turn))
    )
    classes = np.full((n * width, slots.shape[1]), SpinClass.UNREACHABLE, dtype=np.int32)
    middle = 0.5 * (np.asarray(problem.kinematics.q_min) + np.asarray(problem.kinematics.q_max))
    q = problem.kinematics.nearest(slots[valid], middle)
    best = np.where(
        problem.within(q),
        np.where(problem.regular(q), SpinClass.FREE, SpinClass.SINGULAR),
        SpinClass.JOINT_LIMIT,
    )
    classes[valid] = best
    states = sample(problem, tags, spins)
    stiffness = np.full((n, width), np.nan)
    every = np.arange(len(states.q))
    row, column = states.tag_of(every), states.column.astype(np.int64)
    free = checker.states(
        tags[row],
        states.q.astype(np.float64),
        states.spin_of(every),
        states.branch.astype(np.int64),
    ).good
    flat = classes.reshape(n, width, -1)
    flat[flat == SpinClass.FREE] = SpinClass.COLLISION
    flat[row[free], column[free], states.branch[free]] = SpinClass.FREE
    np.fmax.at(stiffness, (row[free], column[free]), states.index[free].astype(np.float64))
    return flat.min(axis=2), stiffness


def grades(result: Plan, cell: Cell, best: FloatArray | None = None) -> IntArray:
    """Return the ``Grade`` (n,) of every tag of a plan.

    Args:
        result: the plan.
        cell: its cell.
        best: (n,) best stiffness index each tag could have [N/m] (rows of a spin map's maximum);
            None leaves stiffness out.
    """
    kinematics = build(cell.robot)
    grade = np.full(len(result.toolpath), Grade.INVALID, dtype=np.int32)
    q = result.q
    margin = cell.limits.joint_margin
    room = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min(axis=1, initial=np.inf)
    room = np.minimum(room - margin, wrist_distance(kinematics, q) - cell.limits.singularity)
    smallest = np.full(len(grade), np.inf)
    np.minimum.at(smallest, result.tag, room)
    failed = [issue.tag_index for issue in result.errors if issue.tag_index is not None]
    run = np.isfinite(smallest)
    run[failed] = False
    loss = np.zeros(len(grade))
    if best is not None:
        loss = np.nan_to_num(1.0 - result.stiffness / best)
    grade[run] = Grade.GOOD
    grade[run & ((smallest < NEAR_LIMIT) | (loss > ACCEPTABLE_LOSS))] = Grade.ACCEPTABLE
    grade[run & ((smallest < 0.2 * NEAR_LIMIT) | (loss > CRITICAL_LOSS))] = Grade.CRITICAL
    return grade


def _text(value: float) -> str:
    return "" if np.isnan(value) else f"{value:z.3f}"
