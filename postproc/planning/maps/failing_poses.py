"""How the robot would stand at a tag that fails: the pose to show, and what hits there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.errors import Finding, Severity
from postproc.model import MotionKind, Plan
from postproc.planning.job import problem_of
from postproc.planning.maps.tags import at_places
from postproc.planning.states import PlanOptions, Problem, postures, settle, spin_values
from postproc.records import dataclass
from postproc.units import DEG, MM

MOST_TAGS = 60
"""For so many failing tags a pose is worked out."""
_STEP = 30.0 * DEG
_SHARES = 101
"""Points on the way from an unreachable tag to the shoulder, both ends included."""


@dataclass(frozen=True, slots=True)
class FailingPose:
    """Joints (6,) [rad] and what the pose is; what hits there, about which point; its frames.

    ``point``: (3,) [m] in robroot; ``tool``, ``base``: places in the cell.
    """

    q: FloatArray
    note: str
    pair: tuple[str, ...] = ()
    point: FloatArray | None = None
    tool: int = 0
    base: int = 0


def failing_poses(
    plan: Plan, cell: Cell, moves: IndexArray, findings: Sequence[Finding]
) -> dict[int, FailingPose]:
    """Return poses of failing tags by tag.

    Of all poses that the arm can take at the tag (within limits where there is one) a colliding
    one is shown, with the pair that hits most often; the stroke of a hole counts. Where the arm
    cannot reach the tag at all it is shown as near as it comes. With external axes there are no
    poses: where the axes would stand is not known.

    Args:
        plan: the plan.
        cell: its cell.
        moves: (n,) from ``moves_of_tags``.
        findings: all of the conversion; errors name the failing tags.
    """
    errors = [i for i in findings if i.severity is Severity.ERROR and i.tag_index is not None]
    messages = {int(i.tag_index or 0): i.message for i in errors}
    if not messages or cell.external_axes:
        return {}
    found: dict[int, FailingPose] = {}
    for place in at_places(plan, cell, moves):
        mine = [tag for tag in place.tags.tolist() if tag in messages]
        if not mine or len(found) >= MOST_TAGS:
            continue
        problem = problem_of(place.toolpath, *settle(place.cell, PlanOptions()))
        scene = Scene.shared(place.cell, problem.kinematics)
        for tag in mine[: MOST_TAGS - len(found)]:
            own = tag - place.first
            if not problem.placement.given[own]:
                continue
            pose = _pose(problem, scene, own, _heights(problem, own), messages[tag])
            if pose is not None:
                tool, base = place.cell.tool_index, place.cell.base_index
                found[tag] = replace(pose, tool=tool, base=base)
    return found


def _heights(problem: Problem, tag: int) -> list[tuple[float, bool]]:
    """Return heights [m] over the tag to look at, with whether the tool may touch the part."""
    strokes = problem.strokes
    if not strokes.is_stroke[tag]:
        return [(0.0, bool(problem.toolpath.kind[tag] != MotionKind.RAPID))]
    return [(0.0, True), (float(-strokes.depth[tag]), True), (float(strokes.top[tag]), False)]


def _pose(
    problem: Problem, scene: Scene, tag: int, heights: list[tuple[float, bool]], message: str
) -> FailingPose | None:
    spins = spin_values(_STEP, *problem.cell.optimize.range)
    spins = spins[np.argsort(np.abs(spins), kind="stable")]
    tags = np.full(len(spins), tag)
    spare: FailingPose | None = None
    for height, contact in heights:
        found = postures(problem, tags, problem.placement.tcp(tags, spins, height), np.zeros(6))
        q = found.q[found.inside]
        if len(q):
            shown = colliding_pose(q, scene, np.full(len(q), contact), message)
            if shown is not None:
                return shown
            spare = spare or FailingPose(q[0], _free(problem, q[0]))
        elif spare is None and found.reached.any():
            spare = _beyond(problem, found.q[found.reached])
    return spare or _nearest(problem, tag, spins)


def _nearest(problem: Problem, tag: int, spins: FloatArray) -> FailingPose | None:
    """Return the pose where the way from the tag to the shoulder first comes within reach."""
    T_robroot_base = problem.placement.T_robroot_base
    shoulder = problem.kinematics.link_frames(np.zeros(6))[2, :3, 3]
    target = problem.placement.tcp(np.array([tag]), spins[:1])[0, :3, 3]
    way = T_robroot_base[:3, :3].T @ (shoulder - T_robroot_base[:3, 3]) - target
    tags = np.full(len(spins), tag)
    for share in np.linspace(0.0, 1.0, _SHARES)[1:]:
        T = problem.placement.tcp(tags, spins)
        T[:, :3, 3] += share * way
        found = postures(problem, tags, T, np.zeros(6))
        if found.inside.any():
            short = share * float(np.linalg.norm(way))
            note = f"closest the arm gets: {short / MM:.0f} mm short of the tag"
            return FailingPose(found.q[found.inside][0], note)
    return None


def colliding_pose(
    q: FloatArray, scene: Scene, contact: BoolArray, message: str
) -> FailingPose | None:
    """Return one of the poses (m, 6) that collides, None without any.

    With the pair that the finding's message names, else the pair that hits most often.
    ``contact`` (m,): where cutting solids may touch the workpiece.
    """
    hits = scene.check(q, contact)
    if not hits.hit.any():
        return None
    numbers, counts = np.unique(hits.pair[hits.hit], return_counts=True)
    named = [" hits ".join(hits.pairs[int(number)]) in message for number in numbers]
    pair = int(numbers[np.lexsort((-counts, np.logical_not(named)))[0]])
    one, two = hits.pairs[pair]
    row = int(np.flatnonzero(hits.pair == pair)[0])
    point = scene.meeting_point(q[row], pair)
    return FailingPose(q[row], f"{one} hits {two}", (one, two), point)


def _free(problem: Problem, q: FloatArray) -> str:
    """Return what is known against a pose that hits nothing."""
    if not problem.regular(q):
        return "the wrist is too straight here"
    return "one of the poses tried; it is good, but the path to it is not"


def _beyond(problem: Problem, q: FloatArray) -> FailingPose:
    """Return the pose that is least beyond its limits."""
    robot, margin = problem.cell.robot, problem.cell.limits.joint_margin
    over = np.maximum(robot.q_min + margin - q, q - robot.q_max + margin)
    row = int(np.argmin(np.maximum(over, 0.0).max(axis=1)))
    joints = ", ".join(
        f"A{j + 1} by {over[row, j] / DEG:.1f} deg" for j in np.flatnonzero(over[row] > 0.0)
    )
    return FailingPose(q[row], f"beyond the limits: {joints}")
