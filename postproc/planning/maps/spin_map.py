"""The spin map: what every spin about the tool axis would mean at every tag.

Spin by tag, each cell with a class (free, collision, singular, joint limit, unreachable) and the
stiffness of the best posture that is free there, with the chosen line on it. A cell is free if any
posture (branch, turns of the joints) can be run, strokes and all. Postures are checked best first,
so that one check is enough for most cells; only cells without any free posture take them all.
The tool axis is that of the CAM data: a tag that the plan tilts may be run where its cell is not
free.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from postproc.arrays import AT_ONCE, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.model import Plan
from postproc.planning.checks import Checker, Grade, Reason, grades, moves_of_tags
from postproc.planning.job import checker_of
from postproc.planning.maps.plan_maps import at_places
from postproc.planning.states import (
    Placement,
    Postures,
    States,
    cross_axes,
    postures,
    sample,
    settle,
)
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.units import DEG, N_PER_MM, TURN


class SpinClass(IntEnum):
    """Best that any posture offers at a spin."""

    FREE = 0
    COLLISION = 1
    SINGULAR = 2
    JOINT_LIMIT = 3
    UNREACHABLE = 4


CLASS_OF = {
    Reason.NONE: SpinClass.FREE,
    Reason.COLLISION: SpinClass.COLLISION,
    Reason.SINGULAR: SpinClass.SINGULAR,
    Reason.JOINT_LIMIT: SpinClass.JOINT_LIMIT,
    Reason.UNREACHABLE: SpinClass.UNREACHABLE,
}


@dataclass(frozen=True, slots=True)
class SpinMap:
    """Spins (S,) [rad] by the n tags of a plan.

    ``classes`` (n, S) ``SpinClass``; ``stiffness`` (n, S) [N/m] of the best free posture, NaN where
    none is free or the cell has no stiffness; ``chosen`` (n,) spin of the plan [rad], within
    half a turn of the middle of the map, NaN for tags without a move; ``grade`` (n,) ``Grade``.
    """

    plan: Plan
    spins: FloatArray
    classes: IntArray
    stiffness: FloatArray
    chosen: FloatArray
    grade: IntArray

    def __len__(self) -> int:
        """Return the number of tags."""
        return len(self.chosen)

    @property
    def has_stiffness(self) -> bool:
        """Whether any cell of the map has a stiffness."""
        return bool(np.isfinite(self.stiffness).any())

    @property
    def loss(self) -> FloatArray:
        """(n,) share of stiffness lost against the tag's best free spin of the map, NaN where none.

        Below 0 where the chosen spin lies between those of the map and is better.
        """
        best = np.where(np.isfinite(self.stiffness), self.stiffness, -np.inf).max(axis=1)
        return np.asarray(1.0 - self.plan.stiffness / np.where(best > 0.0, best, np.nan))

    def to_csv(self) -> str:
        """Return the map as text: one row a tag and spin, fixed digits.

        Columns: tag, line (of the CAM file), spin_deg, class, stiffness_N_per_mm, chosen_deg,
        grade, loss_percent; the last three are of the tag.
        """
        path, loss = self.plan.toolpath, self.loss
        rows = ["tag,line,spin_deg,class,stiffness_N_per_mm,chosen_deg,grade,loss_percent"]
        for i in range(len(self)):
            head = f"{_quoted(path.tag_name(i))},{int(path.line[i])}"
            grade = Grade(int(self.grade[i])).name.lower()
            tail = f"{_text(self.chosen[i] / DEG)},{grade},{_text(100.0 * loss[i])}"
            for j, spin in enumerate((self.spins / DEG).tolist()):
                kind = SpinClass(int(self.classes[i, j])).name.lower()
                k = _text(self.stiffness[i, j] / N_PER_MM)
                rows.append(f"{head},{spin:z.3f},{kind},{k},{tail}")
        return "\n".join(rows) + "\n"


def spin_map(result: Plan, cell: Cell, progress: Progress | None = None) -> SpinMap:
    """Return the spin map of all tags of a plan, also of those that failed.

    External axes stand where the plan has them; for a tag without a move as for the tag before.

    Args:
        result: the plan.
        cell: its cell, with the strategy and the objective of the call.
        progress: called with (done, total, what).

    Raises:
        CellError: as ``planner.plan``.
    """
    cell, settings = settle(cell)
    n, width = len(result.toolpath), len(settings.spins)
    classes = np.full((n, width), SpinClass.UNREACHABLE, dtype=np.int32)
    stiffness, chosen = np.full((n, width), np.nan), np.full(n, np.nan)
    moves = moves_of_tags(result)
    done, size = 0, max(1, AT_ONCE // width)
    for place in at_places(result, cell, moves):
        tags, first = place.tags, place.first
        checker = checker_of(place.toolpath, place.cell, settings)
        for low in range(0, len(tags), size):
            if progress is not None:
                progress(done, n, "spin map")
            some = tags[low : low + size]
            classes[some], stiffness[some] = _cells(checker, some - first)
            done += len(some)
        served = tags[moves[tags] >= 0]
        R_base_tcp = result.T_base_tcp[moves[served], :3, :3]
        chosen[served] = _spin_of(checker.problem.placement, served - first, R_base_tcp)
    middle = 0.5 * float(settings.spins[0] + settings.spins[-1])
    chosen = chosen - TURN * np.round((chosen - middle) / TURN)
    return SpinMap(result, settings.spins, classes, stiffness, chosen, grades(result, cell))


def _spin_of(placement: Placement, tags: IndexArray, R_base_tcp: FloatArray) -> FloatArray:
    """Return the spin (m,) [rad] about the tool axis of orientations (m, 3, 3) at tags."""
    first, second = cross_axes(placement.tool_axis)
    R_zero_tcp = np.swapaxes(placement.R_base_tcp[tags], 1, 2) @ R_base_tcp
    turned = R_zero_tcp @ first
    sense = float(np.cross(first, second) @ placement.tool_axis)
    return np.asarray(np.arctan2(sense * (turned @ second), turned @ first))


def _cells(checker: Checker, tags: IndexArray) -> tuple[IntArray, FloatArray]:
    """Return class (t, S) and stiffness (t, S) of tags (t,)."""
    problem, width = checker.problem, len(checker.problem.settings.spins)
    states = sample(problem, tags, problem.settings.spins)
    every = np.arange(len(states.q))
    cell = states.tag_of(every) * width + states.column.astype(np.int64)
    order = np.lexsort((every, states.cost, cell))
    first = np.searchsorted(cell[order], cell[order], side="left")
    rank = np.arange(len(order)) - first
    classes = _without_state(checker, tags).ravel()
    stiffness = np.full(len(classes), np.nan)
    collided = np.zeros(int(states.config.max(initial=-1)) + 1, dtype=np.bool_)
    for k in range(int(rank.max(initial=-1)) + 1):
        rows = order[rank == k]
        rows = rows[classes[cell[rows]] != SpinClass.FREE]
        rows = rows[~collided[states.config[rows]]]
        found = _verdicts(checker, states, tags, rows)
        collided[states.config[rows[found == SpinClass.COLLISION]]] = True
        classes[cell[rows]] = np.minimum(classes[cell[rows]], found)
        free = rows[found == SpinClass.FREE]
        stiffness[cell[free]] = states.index[free]
    return classes.reshape(-1, width), stiffness.reshape(-1, width)


def _verdicts(checker: Checker, states: States, tags: IndexArray, rows: IndexArray) -> IndexArray:
    """Return the ``SpinClass`` (m,) of states (m,), checked with their strokes."""
    reason = checker.states(
        tags[states.tag_of(rows)],
        states.q[rows].astype(np.float64),
        states.spin_of(rows),
        states.branch[rows].astype(np.int64),
    ).reason
    return np.array([CLASS_OF[Reason(int(r))] for r in reason], dtype=np.int64)


def _without_state(checker: Checker, tags: IndexArray) -> IntArray:
    """Return the class (t, S) by the postures that reach, limits and singularity rule out."""
    problem = checker.problem
    spins = problem.settings.spins
    which, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    found = postures(problem, which, problem.placement.tcp(which, spin))
    # a posture that nothing rules out counts for nothing here: it is checked as a state
    least: IntArray = ruled_out(found, SpinClass.UNREACHABLE).min(axis=1)
    return least.reshape(len(tags), len(spins))


def ruled_out(found: Postures, good: SpinClass) -> IntArray:
    """Return the class (m, 8) of postures; ``good``: of those that nothing rules out but solids."""
    kinds = [good, SpinClass.SINGULAR, SpinClass.JOINT_LIMIT]
    found_by = [found.good, found.inside, found.reached]
    return np.select(found_by, kinds, SpinClass.UNREACHABLE).astype(np.int32)


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n') else text


def _text(value: float) -> str:
    return f"{value:z.3f}" if np.isfinite(value) else ""
