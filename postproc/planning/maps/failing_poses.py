"""How the robot would stand at a tag that fails: the pose to show, and what hits there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.errors import Severity
from postproc.kinematics import wrist_distance
from postproc.model import MotionKind
from postproc.planning.states import place_given, spin_values, strokes_of
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.arrays import BoolArray, FloatArray, IndexArray
    from postproc.cell import Cell
    from postproc.collision import Hits, Scene
    from postproc.errors import Finding
    from postproc.kinematics import Kinematics
    from postproc.model import ToolPath
    from postproc.planning.states import Placement

MOST_TAGS = 60
"""For so many failing tags a pose is worked out."""
_STEP = 30.0 * DEG
_APPROACH = 0.05


@dataclass(frozen=True, slots=True)
class FailingPose:
    """Joints (6,) [rad], names of the solids that hit there, and what the pose is."""

    q: FloatArray
    pair: tuple[str, ...]
    note: str

    def to_page(self) -> dict[str, Any]:
        """Return the pose for the page's scripts."""
        return {"q": [float(v) for v in self.q], "pair": list(self.pair), "note": self.note}


def failing_poses(
    toolpath: ToolPath,
    cell: Cell,
    kinematics: Kinematics,
    scene: Scene,
    findings: Sequence[Finding],
) -> dict[int, FailingPose]:
    """Return poses of failing tags by tag; a tag that the arm cannot reach at all has none.

    Of all poses that the arm can take at the tag (within limits where there is one) a colliding
    one is shown, with the pair that hits most often; the stroke of a hole counts. With external
    axes there are no poses: where the axes would stand is not known.
    """
    if cell.external_axes:
        return {}
    errors = [i for i in findings if i.severity is Severity.ERROR and i.tag_index is not None]
    said = {int(i.tag_index or 0): i.message for i in errors}
    if not said:
        return {}
    toolpath, placement = place_given(toolpath, cell)
    said = {tag: text for tag, text in said.items() if placement.given[tag]}
    spins = spin_values(_STEP, *cell.optimize.range)
    found = {}
    arm = _Arm(cell, kinematics, scene)
    for tag in list(said)[:MOST_TAGS]:
        view = _View(tag, _heights(toolpath, tag), said[tag])
        pose = _pose(view, spins, placement, arm)
        if pose is not None:
            found[tag] = pose
    return found


@dataclass(frozen=True, slots=True)
class _Arm:
    cell: Cell
    kinematics: Kinematics
    scene: Scene


@dataclass(frozen=True, slots=True)
class _View:
    """A failing tag, the heights [m] over it to look at, each with whether contact is fine."""

    tag: int
    heights: list[tuple[float, bool]]
    message: str


def _heights(toolpath: ToolPath, tag: int) -> list[tuple[float, bool]]:
    """Return heights [m] over the tag to look at, with whether the tool may touch the part."""
    if toolpath.kind[tag] != MotionKind.HOLE:
        return [(0.0, bool(toolpath.kind[tag] != MotionKind.RAPID))]
    strokes = strokes_of(toolpath, _APPROACH)
    return [(0.0, True), (float(-strokes.depth[tag]), True), (float(strokes.top[tag]), False)]


def _pose(
    view: _View,
    spins: FloatArray,
    placement: Placement,
    arm: _Arm,
) -> FailingPose | None:
    spare: FailingPose | None = None
    for height, contact in view.heights:
        q, is_inside = _candidates(view.tag, height, spins, placement, arm)
        if not len(q):
            continue
        if is_inside.any():
            q = q[is_inside]
            hits = arm.scene.check(q, np.full(len(q), contact))
            if hits.hit.any():
                return _colliding(q, hits, view.message)
            spare = spare or FailingPose(q[0], (), _straight(q[0], arm))
        elif spare is None:
            spare = _beyond(q, arm)
    return spare


def _colliding(q: FloatArray, hits: Hits, message: str) -> FailingPose:
    """Return a pose in which the pair of the finding hits, else the pair that hits most often."""
    numbers, counts = np.unique(hits.pair[hits.hit], return_counts=True)
    named = [" hits ".join(hits.pairs[int(number)]) in message for number in numbers]
    pair = int(numbers[np.lexsort((-counts, np.logical_not(named)))[0]])
    row = int(np.flatnonzero(hits.pair == pair)[0])
    names = hits.pairs[pair]
    return FailingPose(q[row], tuple(names), f"{names[0]} hits {names[1]}")


def _candidates(
    tag: int, height: float, spins: FloatArray, placement: Placement, arm: _Arm
) -> tuple[FloatArray, BoolArray]:
    """Return the poses (m, 6), those near spin 0 first, and which of them are within limits."""
    order: IndexArray = np.argsort(np.abs(spins), kind="stable")
    T = placement.tcp(np.full(len(spins), tag), spins[order], height)
    slots, valid = arm.kinematics.ik(placement.flange(T))
    q = arm.kinematics.nearest(slots[valid], np.zeros(6))
    return q, np.asarray(arm.kinematics.within_limits(q, arm.cell.limits.joint_margin))


def _straight(q: FloatArray, arm: _Arm) -> str:
    """Return what is known against a pose that hits nothing."""
    if float(wrist_distance(arm.kinematics, q)) < arm.cell.limits.singularity:
        return "the wrist is too straight here"
    return "one of the poses that were tried; it can be taken, but not the way to it"


def _beyond(q: FloatArray, arm: _Arm) -> FailingPose:
    """Return the pose that is least beyond its limits."""
    robot, margin = arm.cell.robot, arm.cell.limits.joint_margin
    over = np.maximum(robot.q_min + margin - q, q - robot.q_max + margin)
    row = int(np.argmin(np.maximum(over, 0.0).max(axis=1)))
    joints = ", ".join(
        f"A{j + 1} by {over[row, j] / DEG:.1f} deg" for j in np.flatnonzero(over[row] > 0.0)
    )
    return FailingPose(q[row], (), f"beyond the limits: {joints}")
