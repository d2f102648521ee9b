"""A plan in KRL's units, column by column: what each motion says, before any text.

The rules of approximation are enforced here, whatever the plan asks for: a drill stroke, the start
and the end of contact, a wait and the end of a file are exact, and no approximation takes more than
its share of the shorter neighbouring segment.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, stepped
from postproc.cell import Cell
from postproc.errors import EmitError, SourceRef
from postproc.geometry import kuka_from_transform, orthonormalised, transform
from postproc.krl import numbers
from postproc.model import BLEND_SHARE, EventKind, MoveKind, MoveRole, Plan
from postproc.records import dataclass
from postproc.units import DEG, MM, PERCENT

_DIGITS = 1e-9
"""By this share a distance may be longer than it should: sums differ in their last digits."""
BLEND_SMALLEST_MM = 1e-3
"""A smaller approximation is an exact stop."""
FLATTEST_ARC = 2e-6
"""An arc that rises less than this over its chord [m] is written as a line."""
STANDING = frozenset(
    {
        EventKind.SPINDLE_ON,
        EventKind.SPINDLE_OFF,
        EventKind.DWELL,
        EventKind.STOP,
        EventKind.OPTIONAL_STOP,
        EventKind.HALT,
        EventKind.TOOL_CHANGE,
        EventKind.TAP_REVERSE,
        EventKind.SPINDLE_ORIENT,
        EventKind.HOLE,
        EventKind.SIGNAL,
        EventKind.WAIT_SIGNAL,
    }
)
"""Events at which the robot stands."""
_COOLANT = frozenset({EventKind.COOLANT_ON, EventKind.COOLANT_OFF})


@dataclass(frozen=True, slots=True)
class Columns:
    """Per move, plain Python values: ``pose`` [mm, deg], ``axes`` [deg], ``blend_mm`` (0 = exact).

    ``auxiliary``: pose of a CIRC's point on the way, or None. ``line``: CAM line, 0 without one;
    ``operation``: index, -1 without one. ``is_reframed``: tool or base are not those of the move
    before.
    """

    kind: list[int]
    role: list[int]
    pose: list[list[float]]
    auxiliary: list[list[float] | None]
    axes: list[list[float]]
    external: list[tuple[float, ...]]
    speed_m_s: list[float]
    orientation_deg_s: list[float]
    percent: list[float]
    blend_mm: list[float]
    dwell_s: list[float]
    line: list[int]
    operation: list[int]
    is_reframed: list[bool]

    def __len__(self) -> int:
        """Return the number of moves."""
        return len(self.kind)


def columns(plan: Plan, cell: Cell, borders: frozenset[int], speed_max: float) -> Columns:
    """Return the columns of a plan; EMT311 to EMT313 for what cannot be written.

    ``borders``: moves before which another file begins; rapids are no faster than ``speed_max``
    [m/s].
    """
    xyz, abc = kuka_from_transform(plan.T_base_tcp)
    tags = np.clip(plan.tag, 0, len(plan.toolpath) - 1)
    has_tag = plan.tag >= 0
    straight = _straight(plan)
    return Columns(
        kind=np.where(straight, MoveKind.LIN, plan.kind).tolist(),
        role=plan.role.tolist(),
        pose=np.hstack([xyz, abc]).tolist(),
        auxiliary=_auxiliaries(plan, straight),
        axes=(plan.q / DEG).tolist(),
        external=_externals(plan, cell),
        speed_m_s=_speeds(plan, speed_max),
        orientation_deg_s=_orientation(plan, cell),
        percent=_percents(plan),
        blend_mm=_blends(plan, borders, waits=cell.krl.stops_advance is not None).tolist(),
        dwell_s=np.nan_to_num(plan.dwell).tolist(),
        line=np.where(has_tag, plan.toolpath.line[tags], 0).tolist(),
        operation=np.where(has_tag, plan.toolpath.operation[tags], -1).tolist(),
        is_reframed=_reframed(plan).tolist(),
    )


def _reframed(plan: Plan) -> BoolArray:
    """Return (m,) whether tool or base are not those of the move before."""
    frames = np.stack([plan.tool_of_moves, plan.base_of_moves])
    return np.asarray((np.diff(frames, axis=1, prepend=frames[:, :1]) != 0).any(axis=0))


def border_quality(plan: Plan) -> FloatArray:
    """Return (m,) how good it is to begin a new file before each move."""
    role, kind = plan.role, plan.kind
    before = np.roll(role, 1)
    quality = np.zeros(len(plan))
    quality[plan.blend[np.arange(len(plan)) - 1] <= 0.0] = 1
    quality[_is_cut(before) & ~_is_cut(role)] = 1
    quality[~_is_cut(before) & ~_is_cut(role)] = 2
    inside = np.isin(role, (MoveRole.PLUNGE, MoveRole.LIFT, MoveRole.RETRACT))
    quality[inside & (plan.tag == np.roll(plan.tag, 1))] = 0
    quality[kind == MoveKind.PTP] = 3
    tags = np.clip(plan.tag, 0, None)
    operation = plan.toolpath.operation[tags]
    quality[(operation != np.roll(operation, 1)) & (quality >= 1)] = 4
    return quality


def calls_within(plan: Plan) -> BoolArray:
    """Return (m,) moves of a tag that routines are called before, behind another of its moves."""
    called = np.zeros(len(plan), dtype=np.bool_)
    called[[move for move, _ in plan.events if 0 < move < len(plan)]] = True
    return np.asarray(called & (plan.tag >= 0) & (plan.tag == np.roll(plan.tag, 1)))


def operation_starts(plan: Plan) -> list[int]:
    """Return the moves that begin another operation than that of the move before."""
    operation = plan.toolpath.operation[np.clip(plan.tag, 0, None)]
    return (np.flatnonzero(np.diff(operation)) + 1).tolist()


def _is_cut(role: np.ndarray) -> BoolArray:
    return np.asarray((role == MoveRole.CUT) | (role == MoveRole.PLUNGE))


def _blends(plan: Plan, borders: frozenset[int], *, waits: bool) -> FloatArray:
    """Return approximation distances (m,) [mm] by rule."""
    wanted = np.nan_to_num(plan.blend) / MM
    wanted[_exact(plan, borders, waits=waits)] = 0.0
    length = _lengths(plan) / MM
    limit = BLEND_SHARE * np.minimum(length, np.append(length[1:], 0.0))
    capped = np.where(wanted <= limit * (1.0 + _DIGITS), wanted, stepped(limit))
    capped[capped < BLEND_SMALLEST_MM] = 0.0
    return capped


def _exact(plan: Plan, borders: frozenset[int], *, waits: bool) -> BoolArray:
    """Return (m,) where the motion must end exactly; ``waits``: before coolant as well."""
    role = plan.role
    following = np.append(role[1:], MoveRole.ENTRY)
    exact = (role == MoveRole.PLUNGE) | (following == MoveRole.PLUNGE)
    exact |= following == MoveRole.ENTRY
    exact |= (role == MoveRole.CUT) != (following == MoveRole.CUT)
    exact |= plan.dwell > 0.0
    exact[-1] = True
    for index in borders:
        exact[index - 1] = True
    for index, event in plan.events:
        stands = event.kind in STANDING or (waits and event.kind in _COOLANT)
        if index > 0 and stands and not is_flying(plan, index, event.kind):
            exact[index - 1] = True
    return np.asarray(exact)


def is_flying(plan: Plan, index: int, kind: EventKind) -> bool:
    """Whether an event happens in the middle of a blended cut, where a stop would mark the part.

    Coolant can be switched on the way. All other events need a robot that stands: a spindle is
    waited for, at another speed too.
    """
    if not 0 < index < len(plan):
        return False
    is_chain = (
        plan.role[index - 1] == MoveRole.CUT
        and plan.role[index] == MoveRole.CUT
        and plan.blend[index - 1] > 0.0
        and plan.dwell[index - 1] <= 0.0
    )
    if not is_chain:
        return False
    return kind in _COOLANT


def _lengths(plan: Plan) -> FloatArray:
    """Return (m,) lengths [m] of the path to each move's end; infinite for PTP."""
    end = plan.T_base_tcp[:, :3, 3]
    start = np.roll(end, 1, axis=0)
    length = np.linalg.norm(end - start, axis=1)
    arcs = np.flatnonzero(plan.kind == MoveKind.CIRC)
    length[arcs] = np.linalg.norm(plan.aux[arcs] - start[arcs], axis=1) + np.linalg.norm(
        end[arcs] - plan.aux[arcs], axis=1
    )
    length[plan.kind == MoveKind.PTP] = np.inf
    return np.asarray(length)


def _speeds(plan: Plan, speed_max: float) -> list[float]:
    """Return path speeds [m/s] as they will be printed; 0 for PTP."""
    is_cp = plan.kind != MoveKind.PTP
    speed = np.where(is_cp, plan.speed, 1.0)
    wrong = np.flatnonzero(~(np.isfinite(speed) & (speed > 0.0)))
    if len(wrong):
        index = int(wrong[0])
        text = f"move {index} has a path speed of {speed[index]:g} m/s, expected above 0"
        raise EmitError("EMT311", text, _source(plan, index))
    fast = np.flatnonzero(is_cp & _is_cut(plan.role) & (speed > speed_max * (1.0 + 1e-9)))
    if len(fast):
        index = int(fast[0])
        text = f"a feed of {speed[index]:g} m/s, expected at most {speed_max:g} m/s"
        hint = "krl.path_speed_max_m_s sets this limit"
        raise EmitError("EMT312", text, _source(plan, index), hint)
    different, place = np.unique(np.minimum(speed, speed_max), return_inverse=True)
    printed = np.array([float(numbers.speed(float(value))) for value in different])
    values: list[float] = np.where(is_cp, printed[place], 0.0).tolist()
    return values


def _orientation(plan: Plan, cell: Cell) -> list[float]:
    """Return the speeds of the orientation [deg/s] as they will be printed, rounded down."""
    speed = np.full(len(plan), cell.krl.orientation_speed)
    if plan.orientation_speed is not None:
        speed = np.fmin(speed, plan.orientation_speed)
    slow = np.floor(speed / DEG * 1e3) / 1e3
    values = np.where(speed < cell.krl.orientation_speed, slow, speed / DEG)
    return [float(value) for value in values]


def _percents(plan: Plan) -> list[float]:
    """Return axis speeds of PTP in percent, 0 for the others."""
    is_ptp = plan.kind == MoveKind.PTP
    fraction = np.where(is_ptp, plan.ptp_fraction, 0.0)
    percent = np.round(fraction / PERCENT, 3)
    wrong = np.flatnonzero(is_ptp & ~((percent > 0.0) & (percent <= 100.0)))
    if len(wrong):
        index = int(wrong[0])
        text = (
            f"move {index} has an axis speed of {fraction[index]:g} of the possible one, "
            "expected above 0 and at most 1"
        )
        raise EmitError("EMT311", text, _source(plan, index))
    values: list[float] = percent.tolist()
    return values


def _externals(plan: Plan, cell: Cell) -> list[tuple[float, ...]]:
    """Return E1..Ek [mm or deg] per move; axes that the cell does not have are 0."""
    count = plan.external.shape[1]
    if count == 0:
        return [()] * len(plan)
    axes = cell.external_axes
    if len(axes) != count:
        raise EmitError("EMT314", f"the plan moves {count} external axes, the cell has {len(axes)}")
    places = [int(axis.name[1:]) - 1 for axis in axes]
    table = np.zeros((len(plan), max(places) + 1))
    for column, (place, axis) in enumerate(zip(places, axes, strict=True)):
        table[:, place] = plan.external[:, column] / (MM if axis.kind == "rail" else DEG)
    return [tuple(row) for row in table.tolist()]


def _auxiliaries(plan: Plan, straight: BoolArray) -> list[list[float] | None]:
    """Return the pose of each CIRC's point on the way: the orientation is half way, too."""
    found: list[list[float] | None] = [None] * len(plan)
    arcs = np.flatnonzero((plan.kind == MoveKind.CIRC) & ~straight)
    if not len(arcs):
        return found
    start, end = plan.T_base_tcp[np.maximum(arcs - 1, 0)], plan.T_base_tcp[arcs]
    middle = start[:, :3, :3] + end[:, :3, :3]
    opposite = np.linalg.norm(middle, axis=(1, 2)) < 1.5  # turned by nearly 180 deg: no half way
    middle[opposite] = end[opposite, :3, :3]
    xyz, abc = kuka_from_transform(transform(orthonormalised(middle), plan.aux[arcs]))
    for index, row in zip(arcs.tolist(), np.hstack([xyz, abc]).tolist(), strict=True):
        found[index] = row
    return found


def _straight(plan: Plan) -> BoolArray:
    """Return (m,) which arcs are so flat that their printed points would lie on a line."""
    straight = np.zeros(len(plan), dtype=bool)
    arcs = np.flatnonzero(plan.kind == MoveKind.CIRC)
    if not len(arcs):
        return straight
    start, end = plan.T_base_tcp[np.maximum(arcs - 1, 0), :3, 3], plan.T_base_tcp[arcs, :3, 3]
    to_aux, chord = plan.aux[arcs] - start, end - start
    length = np.linalg.norm(chord, axis=1)
    area = np.linalg.norm(np.cross(to_aux, chord), axis=1)
    share = np.einsum("ij,ij->i", to_aux, chord) / np.maximum(length, 1e-12) ** 2
    is_circle = area > FLATTEST_ARC * np.maximum(length, FLATTEST_ARC)
    is_line = ~is_circle & (share > 0.0) & (share < 1.0)
    wrong = np.flatnonzero(~(is_circle | is_line))
    if len(wrong) or arcs[0] == 0:
        index = int(arcs[wrong[0]]) if len(wrong) else 0
        text = f"move {index}: start, middle and end make no arc"
        raise EmitError("EMT313", text, _source(plan, index))
    straight[arcs[is_line]] = True
    return straight


def _source(plan: Plan, index: int) -> SourceRef | None:
    tag = int(plan.tag[index])
    return plan.toolpath.source(tag) if 0 <= tag < len(plan.toolpath) else None
