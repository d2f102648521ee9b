"""What the page of a plan shows of its tags beside the plan: index over spin, failing poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from postproc.arrays import AT_ONCE, BoolArray, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.errors import Finding, Severity
from postproc.model import MotionKind, Plan, ToolPath
from postproc.planning.checks import Grade, grades, moves_of_tags, near_solids
from postproc.planning.job import problem_of
from postproc.planning.places import positions
from postproc.planning.route import cell_at
from postproc.planning.states import Problem, evaluate, postures, settle, spin_values
from postproc.process import assign
from postproc.records import dataclass
from postproc.units import DEG, MM

MOST_TAGS = 10_000
"""With more tags a page would be too large: the map is left out, and the page says so."""
_STEP = 10.0 * DEG
MOST_POSED = 60
"""For so many failing tags a pose is worked out."""
_POSED_STEP = 30.0 * DEG
_POSITIONS = 9
"""External axes are tried at so many positions each."""
_SHARES = 21
"""Points on the way from an unreachable tag to the shoulder, both ends included, where it comes
within reach; then it is halved."""


@dataclass(frozen=True, slots=True)
class SpinIndex:
    """Index (n, s) [N/m] of tags over spins (s,) [rad], NaN where the arm cannot take the spin.

    ``hit`` (n, s): something collides there.
    """

    spins: FloatArray
    index: FloatArray
    hit: BoolArray


@dataclass(frozen=True, slots=True)
class PlanMaps:
    """Tags of a plan in figures.

    ``moves`` (n,) the move that works at each tag, -1 without any; ``clearance`` (n,) [m];
    ``grade`` (n,): ``Grade``; ``spins``: index over the spin, or ``no_spins`` why there is
    none; ``poses``: how the robot would stand at failing tags; ``tool``, ``base`` (n,): indices
    into those of the cell, -1 where no entry claims what the file asks for.
    """

    moves: IndexArray
    tool: IntArray
    base: IntArray
    clearance: FloatArray
    grade: IntArray
    spins: SpinIndex | None
    poses: Mapping[int, FailingPose]
    no_spins: str = ""

    @property
    def grades(self) -> dict[str, int]:
        """Tags by criteria class."""
        return {grade.name.lower(): int((self.grade == grade).sum()) for grade in Grade}


def _clearances(plan: Plan, cell: Cell) -> FloatArray:
    """Return the clearances of a plan, all NaN where nothing is near anywhere."""
    near = plan.clearance < near_solids(cell)
    return plan.clearance if near.any() else np.full(len(plan.clearance), np.nan)


def plan_maps(plan: Plan, cell: Cell, findings: Sequence[Finding]) -> PlanMaps:
    """Return the maps of a plan.

    Args:
        plan: the plan.
        cell: its cell, with the objective of the call.
        findings: all of the conversion; errors name the failing tags.
    """
    moves, assigned = moves_of_tags(plan), assign(plan.toolpath, cell)
    return PlanMaps(
        moves,
        assigned.tool,
        assigned.base,
        _clearances(plan, cell),
        grades(plan, cell),
        spin_index(plan, cell, moves),
        failing_poses(plan, cell, findings),
        missing(plan),
    )


def missing(plan: Plan) -> str:
    """Return why a plan has no map; nothing where it has one."""
    if len(plan.toolpath) > MOST_TAGS:
        return f"not drawn for more than {MOST_TAGS} tags: convert --spin-map writes it to a file"
    if not len(plan):
        return "no pose was planned: convert --spin-map shows what every spin would mean"
    if not np.isfinite(plan.stiffness).any():
        return "the cell gives no joint stiffness"
    return ""


def spin_index(plan: Plan, cell: Cell, moves: IndexArray) -> SpinIndex | None:
    """Return the map of a plan, None where one is ``missing``.

    The posture is that of the plan: its branch, and the turns of the joints nearest to it.

    Args:
        plan: the plan.
        cell: its cell, with the objective of the call.
        moves: (n,) the move at which each tag's pose is taken, -1 for a tag without any.
    """
    if missing(plan):
        return None
    n = len(plan.toolpath)
    spins = spin_values(_STEP, *cell.optimize.range)
    index = np.full((n, len(spins)), np.nan)
    hit, size = np.zeros(index.shape, dtype=np.bool_), max(1, AT_ONCE // len(spins))
    for place in at_places(plan, cell, moves):
        tags = place.tags[moves[place.tags] >= 0]
        if not len(tags):
            continue
        problem = problem_of(place.toolpath, *settle(place.cell))
        scene = Scene.shared(place.whole, problem.kinematics)
        for low in range(0, len(tags), size):
            some = tags[low : low + size]
            index[some], q = _values(plan, problem, some - place.first, moves[some], spins)
            hit[some] = _hits(plan, some, q, moves, scene)
    return SpinIndex(spins, index, hit)


def _values(
    plan: Plan, problem: Problem, tags: IndexArray, moves: IndexArray, spins: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the index (t, s) of tags (t,) and the joints (t, s, 6), NaN where the arm cannot.

    Tags are those of the problem, moves (t,) those of the plan that serve them.
    """
    which, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    T = problem.placement.tcp(which, spin)
    of_row = np.repeat(moves, len(spins))
    found = postures(problem, which, T, plan.q[of_row][:, None])
    own = np.arange(len(which)), plan.branch[of_row]
    q, good = found.q[own], found.good[own]
    rows = np.flatnonzero(good)
    index = np.full(len(which), np.nan)
    index[rows] = evaluate(problem, which[rows], spin[rows], T[rows], q[rows])[1]
    shape = (len(tags), len(spins))
    return index.reshape(shape), np.where(good[:, None], q, np.nan).reshape(*shape, 6)


def _hits(
    plan: Plan, tags: IndexArray, q: FloatArray, moves: IndexArray, scene: Scene
) -> BoolArray:
    """Return where (t, s) the pose q (t, s, 6) at a tag collides."""
    row, spin = np.nonzero(np.isfinite(q[..., 0]))
    hit = np.zeros(q.shape[:2], dtype=np.bool_)
    if len(row):
        poses = np.hstack([q[row, spin], plan.external[moves[tags[row]]]])
        contact = plan.toolpath.kind[tags[row]] != MotionKind.RAPID
        hit[row, spin] = scene.check(poses, contact).hit
    return hit


@dataclass(frozen=True, slots=True)
class Place:
    """Tags that one tool serves in one base while the external axes stand still.

    ``cell``: with its external axes as they stand, as one without; ``whole``: the same tool and
    base with the external axes; ``toolpath``: the stretch of all tags with this tool and base,
    ``first`` its first tag of the plan; ``tags`` (k,) indices of the plan.
    """

    cell: Cell
    whole: Cell
    toolpath: ToolPath
    first: int
    tags: IndexArray


def at_places(plan: Plan, cell: Cell, moves: IndexArray) -> Iterator[Place]:
    """Yield the places of a plan, in order; tags that no tool or base claims have none.

    A tag without a move counts to the tag before.

    Args:
        plan: the plan.
        cell: its cell.
        moves: (n,) from ``moves_of_tags``.
    """
    assigned = assign(plan.toolpath, cell)
    axes = axes_of(plan, cell, moves) if cell.external_axes else None
    for stretch in assigned.stretches():
        if not stretch.is_assigned:
            continue
        tags = np.arange(stretch.low, stretch.high)
        whole, part = cell.with_tool(stretch.tool, stretch.base), plan.toolpath.rows(tags)
        if axes is None:
            yield Place(whole, whole, part, stretch.low, tags)
            continue
        for values in np.unique(axes[tags], axis=0):
            own = tags[(axes[tags] == values).all(axis=1)]
            yield Place(cell_at(whole, values), whole, part, stretch.low, own)


def axes_of(plan: Plan, cell: Cell, moves: IndexArray) -> FloatArray:
    """Return where the external axes stand (n, k) for each tag [m or rad]."""
    known = moves >= 0
    if not known.any():
        zero = np.array([np.clip(0.0, axis.q_min, axis.q_max) for axis in cell.external_axes])
        return np.tile(zero, (len(moves), 1))
    before = np.maximum.accumulate(np.where(known, np.arange(len(moves)), -1))
    source = np.where(before < 0, int(np.argmax(known)), before)
    return np.asarray(plan.external[moves[source]])


@dataclass(frozen=True, slots=True)
class FailingPose:
    """Joints (6,) [rad] and what the pose is; what hits there, about which point; its frames.

    ``point``: (3,) [m] in robroot; ``tool``, ``base``: places in the cell; ``external`` (k,): where
    the external axes stand.
    """

    q: FloatArray
    note: str
    pair: tuple[str, ...] = ()
    point: FloatArray | None = None
    tool: int = 0
    base: int = 0
    external: FloatArray = field(default_factory=lambda: np.zeros(0))


def failing_poses(plan: Plan, cell: Cell, findings: Sequence[Finding]) -> dict[int, FailingPose]:
    """Return poses of failing tags by tag.

    Of all poses that the arm can take at the tag (within limits where there is one) a colliding
    one is shown, with the pair that hits most often; the stroke of a hole counts. Where the arm
    cannot reach the tag at all it is shown as near as it comes. External axes stand where the
    shoulder comes nearest to the tag.

    Args:
        plan: the plan.
        cell: its cell.
        findings: all of the conversion; errors name the failing tags.
    """
    errors = [i for i in findings if i.severity is Severity.ERROR and i.tag_index is not None]
    messages = {int(i.tag_index or 0): i.message for i in errors}
    found: dict[int, FailingPose] = {}
    if not messages:
        return found
    for part in assign(plan.toolpath, cell).stretches():
        mine = [tag for tag in range(part.low, part.high) if tag in messages]
        mine = mine[: MOST_POSED - len(found)] if part.is_assigned else []
        if not mine:
            continue
        here = cell.with_tool(part.tool, part.base)
        path = plan.toolpath.rows(np.arange(part.low, part.high))
        stands = [
            (values, problem_of(path, *settle(cell_at(here, values))))
            for values in positions(here, _POSITIONS)
        ]
        scene = Scene.shared(here, stands[0][1].kinematics)
        for tag in mine:
            own = tag - part.low
            external, problem = min(stands, key=lambda one: _far(one[1], own))
            if problem.placement.given[own]:
                pose = _pose(problem, scene, own, external, messages[tag])
                if pose is not None:
                    found[tag] = replace(
                        pose, tool=here.tool_index, base=here.base_index, external=external
                    )
    return found


def _far(problem: Problem, tag: int) -> float:
    """Return how far [m] a tag is from the shoulder."""
    place = problem.placement
    at = place.T_robroot_base[:3, :3] @ place.p_base_tcp[tag] + place.T_robroot_base[:3, 3]
    return float(np.linalg.norm(at - _shoulder(problem)))


def _shoulder(problem: Problem) -> FloatArray:
    """Return the axis of A2 (3,) in robroot."""
    return np.asarray(problem.kinematics.link_frames(np.zeros(6))[2, :3, 3])


def _heights(problem: Problem, tag: int) -> list[tuple[float, bool]]:
    """Return heights [m] over the tag to look at, with whether the tool may touch the part."""
    strokes = problem.strokes
    if not strokes.is_stroke[tag]:
        return [(0.0, bool(problem.toolpath.kind[tag] != MotionKind.RAPID))]
    return [(0.0, True), (float(-strokes.depth[tag]), True), (float(strokes.top[tag]), False)]


def _pose(
    problem: Problem, scene: Scene, tag: int, external: FloatArray, message: str
) -> FailingPose | None:
    spins = spin_values(_POSED_STEP, *problem.cell.optimize.range)
    spins = spins[np.argsort(np.abs(spins), kind="stable")]
    tags = np.full(len(spins), tag)
    spare: FailingPose | None = None
    for height, contact in _heights(problem, tag):
        found = postures(problem, tags, problem.placement.tcp(tags, spins, height), np.zeros(6))
        q = found.q[found.inside]
        if len(q):
            poses = np.hstack([q, np.tile(external, (len(q), 1))])
            shown = colliding_pose(poses, scene, np.full(len(q), contact), message)
            if shown is not None:
                return shown
            spare = spare or FailingPose(q[0], _free(problem, q[0]))
        elif spare is None and found.reached.any():
            spare = _beyond(problem, found.q[found.reached])
    return spare or _nearest(problem, tag, spins)


def _nearest(problem: Problem, tag: int, spins: FloatArray) -> FailingPose | None:
    """Return the pose where the way from the tag to the shoulder first comes within reach."""
    T_robroot_base = problem.placement.T_robroot_base
    target = problem.placement.tcp(np.array([tag]), spins[:1])[0, :3, 3]
    way = T_robroot_base[:3, :3].T @ (_shoulder(problem) - T_robroot_base[:3, 3]) - target
    tags = np.full(len(spins), tag)

    def within(share: float) -> FloatArray:
        T = problem.placement.tcp(tags, spins)
        T[:, :3, 3] += share * way
        found = postures(problem, tags, T, np.zeros(6))
        return np.asarray(found.q[found.inside])

    shares = np.linspace(0.0, 1.0, _SHARES)
    first = next((k for k, share in enumerate(shares) if len(within(share))), None)
    if not first:
        return None
    low, high = shares[first - 1], shares[first]
    while (high - low) * np.linalg.norm(way) > MM:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if len(within(middle)) else (middle, high)
    short = high * float(np.linalg.norm(way))
    note = f"closest the arm gets: {short / MM:.0f} mm short of the tag"
    return FailingPose(within(high)[0], note)


def colliding_pose(
    q: FloatArray, scene: Scene, contact: BoolArray, message: str
) -> FailingPose | None:
    """Return one of the poses (m, 6 + k) that collides, None without any.

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
    return FailingPose(q[row, :6], f"{one} hits {two}", (one, two), point)


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
