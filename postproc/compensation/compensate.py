"""Compensation: command other poses, so that the loaded real tool lands on the CAM points.

The whole robot model (load, geometry, every effect of ``model.toml``) is evaluated at the shifted
pose again and again until the real tool point is on the CAM point: a fixed-point iteration on the
full nonlinear model, not one step along its gradient. Orientations stay as planned. Under load the
real arm stands where the plan has proven it free, so collisions need no new check; joint limits do.

Effects that follow the motion (backlash: the side a joint comes from; servo lag: its speed) need
the program itself: it is written, run on the robot model as verification does, and what it does at
its points goes into the next shift, until nothing changes. What belongs to the side a joint comes
from swings over where the joint turns back in a cut, so that the path has no steps (``reversals``).
At the start of a cut the tool stands while a point more takes the gears to the sides of the cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.compensation.along import BLOCK, Follower
from postproc.compensation.drive import run_of
from postproc.compensation.pieces import SAMPLE_STEP, SHORTEST, in_pieces
from postproc.compensation.real_arm import RealArm, left_out
from postproc.compensation.reversals import Sides, sides_of
from postproc.compensation.solve import ACCURACY, Compensated, solve
from postproc.compensation.starts import comes_down, with_points
from postproc.errors import Finding, Severity
from postproc.gap import stiffness_of
from postproc.geometry import inverse
from postproc.kinematics import Kinematics, corner_miss, within_tolerance
from postproc.model import AlongPath, ModelFile, MoveKind, MoveRole, Plan, load_model
from postproc.paths import Moments, Timeline
from postproc.process import operation_loads
from postproc.records import dataclass
from postproc.stiffness import ContinuousField
from postproc.trace import PATH_EFFECTS
from postproc.units import DEG, MM, UM

WORKING = (MoveRole.CUT, MoveRole.PLUNGE)
"""Moves in which the process force acts; in all others only the dead load does."""
SETTLED = 1.0 * UM
"""Shifts that change by less from one run of the program to the next are settled."""
RUNS = 8
"""So often the program is run to find what each joint does at its points."""
STEEPEST = 0.2
"""Compensation for the sides of joints may change by this much [m] per metre of a cut."""
STRAIGHT = 5.0 * UM
"""Largest bend of a straight cut between its compensated points."""
SHIFT_MARGIN = 0.25 * DEG
"""What compensation may take of a joint's margins [rad]: plans to be compensated keep more."""
FAR = 0.5
"""From this share of extrapolation of the stiffness field on, a pose is far from the measured."""


def with_shift_margin(cell: Cell) -> Cell:
    """Return the cell for a plan that will be compensated: shifted poses keep its margins."""
    names = ("joint_margin", "singularity")
    more = {name: getattr(cell.limits, name) + SHIFT_MARGIN for name in names}
    return replace(cell, limits=replace(cell.limits, **more))


def compensate(plan: Plan, cell: Cell, model: str | ModelFile) -> Plan:
    """Return the plan with shifted commands, long cuts in pieces.

    It has new q and T_base_tcp, ``compensation`` (m, 3) in the workpiece frame and
    ``compensation_note``. Findings: PLN102 where a shifted pose leaves the joint limits, CMP002
    where the program does not settle, CMP003 for effects that a program cannot compensate, CMP005
    for points far from all that was measured. CMP001 if the model asks for shifts beyond all
    reason.
    """
    file = load_model(model) if isinstance(model, str) else model
    arm = RealArm.of(cell, file)
    plan = _in_pieces(plan, cell, arm)
    rows = _rows(plan, cell, arm.kinematics)
    follows = arm.follows_motion
    # what does not follow the motion comes first: it may decide which way a joint goes
    solved = _solved(arm, rows, {})
    commanded = _shifted(plan, cell, arm.kinematics, rows, solved)
    unsettled = np.zeros(len(plan))
    sides: Sides | None = None
    told: dict[str, FloatArray] = {}
    for _ in range(RUNS if follows else 0):
        sides, qd = _followed(commanded, cell, arm, rows, sides)
        before, told = solved, {"direction": sides.arriving, "qd": qd}
        solved = _solved(arm, rows, told)
        commanded = _shifted(plan, cell, arm.kinematics, rows, solved)
        unsettled = np.linalg.norm(solved.shift - before.shift, axis=1)[: len(plan)]
        if float(unsettled.max(initial=0.0)) < SETTLED:
            break
    findings = [
        *_findings(plan, cell, arm.kinematics, solved),
        *_unsettled(plan, unsettled),
        *_left_out(arm, file),
        *_far(plan, file),
    ]
    commanded = _doubted(commanded, arm, rows, told)
    if sides is not None:
        commanded = _crossing(commanded, plan, cell, arm, rows, sides)
    if arm.along:
        commanded = Follower(arm.cell, arm.kinematics, arm.along).compensated(commanded, file)
        findings += _left_along(commanded.along_path, cell)
    return replace(
        commanded,
        blend=_blends(commanded, cell.motion.corner_tolerance),
        compensation_note=_note(plan, cell, file, solved, rows, arm.dead),
        findings=(*plan.findings, *findings),
    )


def _left_along(told: AlongPath | None, cell: Cell) -> list[Finding]:
    """Say how far the tool is expected off the path where that is more than corners may be."""
    if told is None or told.max <= cell.motion.corner_tolerance:
        return []
    text = f"the tool is expected up to {told.max / MM:.3g} mm off the path of the cuts"
    plain = f", {told.plain_max / MM:.3g} mm without compensation"
    hint = "turn the part or the spin so that fewer joints turn back there; see along_path"
    return [Finding(Severity.WARNING, "CMP006", f"{text}{plain}", hint=hint)]


def _in_pieces(plan: Plan, cell: Cell, arm: RealArm) -> Plan:
    """Return the plan with long cuts divided where the arm gives way differently on the way."""
    process = process_of(plan, cell)
    missed = Follower(arm.cell, arm.kinematics, arm.along).missed(plan) if arm.along else None

    def displacement(q: FloatArray, move: IntArray, share: FloatArray) -> FloatArray:
        nothing = np.zeros_like(q)
        tool = plan.tool_of_moves[move]
        loaded = arm.displacement(Moments(q, nothing, nothing, process[move], tool))
        return loaded if missed is None else loaded + missed(move, share)

    speed = np.asarray(plan.speed)[np.asarray(plan.role) == MoveRole.CUT]
    fastest = float(np.nanmax(speed, initial=0.0))
    step = max(SHORTEST, BLOCK * fastest) if arm.along else SAMPLE_STEP
    return in_pieces(plan, cell, arm.kinematics, displacement, STRAIGHT, step)


def _solved(arm: RealArm, rows: _Rows, conditions: Mapping[str, Any]) -> Compensated:
    """Return the commands of all rows, each with its own tool on the arm."""
    process = rows.process * rows.working[:, None]
    parts = []
    tools = np.unique(rows.tool)
    for tool in tools.tolist():
        own = np.flatnonzero(rows.tool == tool)
        q = rows.q[own]
        wrench = arm.wrench(q, process[own], tool)
        here = {name: values[own] for name, values in conditions.items()}
        T_flange_tcp = arm.cell.tools[tool].T_flange_tcp
        parts.append(solve(arm.models[tool], arm.kinematics, T_flange_tcp, q, wrench, here))
    order = np.argsort(np.concatenate([np.flatnonzero(rows.tool == tool) for tool in tools]))
    return Compensated.concat(parts).rows(order)


@dataclass(frozen=True, slots=True)
class _Rows:
    """Moves of a plan, then the points on the way of its arcs.

    q (r, 6); working (r,); process (r, 6) wrench in TCP axes; tool (r,): index in the cell; arc:
    indices of the moves whose way point is row m + k.
    """

    q: FloatArray
    working: BoolArray
    process: FloatArray
    tool: IntArray
    arc: IntArray


def _rows(plan: Plan, cell: Cell, kinematics: Kinematics) -> _Rows:
    q = np.asarray(plan.q)
    working = np.isin(plan.role, WORKING)
    arc = np.flatnonzero(np.asarray(plan.kind) == MoveKind.CIRC).astype(np.int32)
    T_robroot_base = _T_robroot_base(plan, cell, kinematics)[arc]
    T_base_aux = np.array(plan.T_base_tcp[arc])
    T_base_aux[:, :3, 3] = plan.aux[arc]
    tool = plan.tool_of_moves
    T_robroot_flange = T_robroot_base @ T_base_aux @ inverse(cell.tcp_of(tool[arc]))
    branches, valid = kinematics.ik(T_robroot_flange)
    at, slot = np.arange(len(arc)), kinematics.slot(q[arc])
    # the way point's own orientation lies between those of the ends; the difference to the end's
    # changes its load response far less than the response itself
    q_aux = np.where(
        valid[at, slot][:, None], kinematics.nearest(branches[at, slot], q[arc]), q[arc]
    )
    process = process_of(plan, cell)
    return _Rows(
        np.concatenate([q, q_aux]),
        np.concatenate([working, working[arc]]),
        np.concatenate([process, process[arc]]),
        np.concatenate([tool, tool[arc]]),
        arc,
    )


def _followed(
    plan: Plan, cell: Cell, arm: RealArm, rows: _Rows, known: Sides | None
) -> tuple[Sides, FloatArray]:
    """Return the sides of the joints and how fast they are, as the program is run."""
    paths, motion = run_of(plan, cell, arm.kinematics)
    row = np.concatenate([motion, motion[rows.arc]])
    share = np.repeat([1.0, 0.5], [len(motion), len(rows.arc)])
    qd = Timeline.of(paths, cell).speed(row, share) * rows.working[:, None]
    if known is not None:
        return known, qd
    is_cut, down = np.asarray(plan.role) == MoveRole.CUT, comes_down(plan)
    reach, lost = _reach(arm, rows), arm.on_runs.lost
    return sides_of(paths, motion[is_cut], motion[down], row, share, reach, lost), qd


def _crossing(
    commanded: Plan, plan: Plan, cell: Cell, arm: RealArm, rows: _Rows, sides: Sides
) -> Plan:
    """Return the plan with a point more, to stand at, where a cut starts on other gear sides."""
    turned = np.any(sides.leaving != sides.arriving, axis=1)[: len(plan)]
    begins = np.append((np.asarray(plan.role) == MoveRole.CUT)[1:], False)
    start = np.flatnonzero(turned & begins)
    if not len(start):
        return commanded
    working, none = np.ones(len(start), dtype=np.bool_), rows.arc[:0]
    own = _Rows(rows.q[start], working, rows.process[start + 1], rows.tool[start], none)
    solved = _solved(arm, own, {"direction": sides.leaving[start], "qd": 0.0 * own.q})
    there = _shifted(plan.rows(start), cell, arm.kinematics, own, solved)
    radius, inside = commanded.compensation_u95, commanded.compensation_inside
    if radius is not None and inside is not None:
        there = replace(there, compensation_u95=radius[start], compensation_inside=inside[start])
    return with_points(commanded, start, there)


def _reach(arm: RealArm, rows: _Rows) -> FloatArray:
    """Return the way (r,) [m] from the middle of a gear to its side, one for all joints."""
    n = len(rows.q)
    still = np.zeros((n, 6))
    moments = Moments(rows.q, still, still, still, rows.tool)
    middle = arm.displacement(moments)
    moved = [
        arm.displacement(replace(moments, direction=np.tile(side, (n, 1)))) - middle
        for side in np.eye(6)
    ]
    return np.asarray(np.sum([np.linalg.norm(way, axis=1) for way in moved], axis=0) / STEEPEST)


def process_of(plan: Plan, cell: Cell) -> FloatArray:
    """Return the process wrench (m, 6) of each move's operation, at and in axes of the TCP."""
    wrenches, row = operation_loads(plan.toolpath, cell)
    return wrenches[np.where(plan.tag >= 0, row[np.clip(plan.tag, 0, len(row) - 1)], -1)]


def _T_robroot_base(plan: Plan, cell: Cell, kinematics: Kinematics) -> FloatArray:
    """Return the workpiece frame (m, 4, 4) at each move; external axes move it."""
    T_robroot_tcp = kinematics.fk(plan.q) @ cell.tcp_of(plan.tool_of_moves)
    return np.asarray(T_robroot_tcp @ inverse(plan.T_base_tcp))


def _shifted(
    plan: Plan, cell: Cell, kinematics: Kinematics, rows: _Rows, solved: Compensated
) -> Plan:
    m = len(plan)
    R_base_robroot = np.swapaxes(_T_robroot_base(plan, cell, kinematics)[:, :3, :3], 1, 2)
    shift = np.einsum("nij,nj->ni", R_base_robroot, solved.shift[:m])
    T_base_tcp = np.array(plan.T_base_tcp)
    T_base_tcp[:, :3, 3] += shift
    aux = np.array(plan.aux)
    aux[rows.arc] += np.einsum("nij,nj->ni", R_base_robroot[rows.arc], solved.shift[m:])
    return replace(plan, q=solved.q[:m], T_base_tcp=T_base_tcp, aux=aux, compensation=shift)


def _blends(plan: Plan, tolerance: float) -> FloatArray:
    """Return how far (m,) [m] corners are blended: lines that were shifted meet at other angles."""
    blend, point = np.array(plan.blend), plan.T_base_tcp[:, :3, 3]
    is_line = (np.asarray(plan.kind) == MoveKind.LIN) & (np.asarray(plan.role) == MoveRole.CUT)
    at = 1 + np.flatnonzero(is_line[1:-1] & is_line[2:] & (blend[1:-1] > 0.0))

    def miss(rows: IndexArray, distance: FloatArray) -> FloatArray:
        here, ends = point[at[rows]], []
        for far in (point[at[rows] - 1], point[at[rows] + 1]):
            length = np.maximum(np.linalg.norm(far - here, axis=1), 1e-12)
            share = np.minimum(distance / length, 0.5)
            ends.append(here + share[:, None] * (far - here))
        return corner_miss(ends[0], here, ends[1])

    blend[at] = within_tolerance(blend[at], miss, tolerance)
    return blend


def _findings(plan: Plan, cell: Cell, kinematics: Kinematics, solved: Compensated) -> list[Finding]:
    m = len(plan)
    inside = kinematics.within_limits(solved.q[:m], cell.limits.joint_margin)
    good = solved.reached[:m] & inside & (solved.left[:m] < 100.0 * ACCURACY)
    hint = "move the workpiece, or convert without --model"
    findings = []
    for move in np.flatnonzero(~good):
        code, why = "PLN101", "is out of reach"
        if solved.reached[move]:
            code, why = "PLN102", "leaves the joint limits"
        text = f"the compensated pose {why}"
        findings.append(_finding(Severity.ERROR, code, text, plan, int(move), hint))
    return findings


def _finding(severity: Severity, code: str, text: str, plan: Plan, move: int, hint: str) -> Finding:
    """Return a finding about the tag of a move."""
    tag = int(plan.tag[move])
    source = plan.toolpath.source(tag) if 0 <= tag < len(plan.toolpath) else None
    return Finding(severity, code, text, tag, source, hint=hint)


def _unsettled(plan: Plan, change: FloatArray) -> list[Finding]:
    """Return a finding for moves whose shift goes on changing with the program itself."""
    moves = np.flatnonzero(change >= SETTLED)
    if not len(moves):
        return []
    worst = int(moves[int(change[moves].argmax())])
    text = f"{len(moves)} compensated moves do not settle, the worst by "
    text += f"{change[worst] / MM:.4f} mm: the speeds of the joints change with it"
    hint = "see what verify --model expects there"
    return [_finding(Severity.WARNING, "CMP002", text, plan, worst, hint)]


def _left_out(arm: RealArm, file: ModelFile) -> list[Finding]:
    """Return a finding for effects that a program cannot answer, and for joints none tells of."""
    told = {n: f"a program does not give {', '.join(m)}" for n, m in left_out(arm.model).items()}
    for name in file.effects:
        if name in PATH_EFFECTS and name not in {*arm.along, *arm.model.states}:
            told[name] = "no program swings against it; " + PATH_EFFECTS.get(name).action
    found = []
    for name, why in told.items():
        text = f"{name} is not compensated: {why}"
        found.append(Finding(Severity.WARNING, "CMP003", text, source=file.source(name)))
    for key, joints in file.unseen.items():
        effect, name = key.split(".")
        text = f"effects.{key} is not known of {' '.join(f'A{joint}' for joint in joints)}"
        where = file.source(effect, name)
        found.append(Finding(Severity.NOTE, "CMP009", f"{text}: counted as none", source=where))
    return found


def _doubted(plan: Plan, arm: RealArm, rows: _Rows, conditions: Mapping[str, FloatArray]) -> Plan:
    """Return the plan with how sure the real point of each move is, where the model knows."""
    if arm.model.reach is None:
        return plan
    m = len(plan)
    radius, inside = np.full(m, np.nan), np.zeros(m, dtype=np.int32)
    process = (rows.process * rows.working[:, None])[:m]
    for tool in np.unique(rows.tool[:m]).tolist():
        own = np.flatnonzero(rows.tool[:m] == tool)
        q = np.asarray(plan.q)[own]
        here = {name: values[own] for name, values in conditions.items()}
        samples = arm.models[tool].samples(q, arm.wrench(q, process[own], tool), here)
        size, reached = arm.models[tool].certain(samples)
        if size is not None and reached is not None:
            radius[own], inside[own] = size, reached
    return replace(plan, compensation_u95=radius, compensation_inside=inside)


def _far(plan: Plan, file: ModelFile) -> list[Finding]:
    """Return a finding for working moves in poses that the model knows nothing of."""
    field = stiffness_of(file)
    working = np.flatnonzero(np.isin(plan.role, WORKING))
    if not len(working):
        return []
    q = np.asarray(plan.q)[working]
    share = np.ones(len(q)) if file.reach is None else file.reach.share(q)
    is_far = share < 1.0
    if isinstance(field, ContinuousField):
        is_far |= field.extrapolation(q) > FAR
    far = working[is_far]
    if not len(far):
        return []
    applied = np.round(100.0 * share[is_far].max())
    text = f"{len(far)} of {len(working)} working moves are in poses far from all that was "
    text += f"measured: stiffness is extrapolated there, and at most {applied:.0f} % of the "
    text += "shift is applied"
    hint = "measure in the branch and the turns of A4 and A6 that the program takes"
    return [_finding(Severity.WARNING, "CMP005", text, plan, int(far[0]), hint)]


def _note(
    plan: Plan, cell: Cell, file: ModelFile, solved: Compensated, rows: _Rows, dead: bool
) -> str:
    """Return one short line for the program: model, loads, largest shift. No path, no date."""
    size = np.linalg.norm(solved.shift[: len(plan)], axis=1) / MM
    parts = []
    masses = np.array([cell.tools[tool].mass for tool in np.unique(plan.tool_of_moves)])
    known = masses[np.isfinite(masses) & (masses > 0.0)]
    if dead and len(known):
        parts.append(f"tool {', '.join(f'{mass:g}' for mass in known)} kg")
    acting = np.unique(rows.process[rows.working], axis=0)
    if len(acting) == 1:
        for form, three in zip(("force {} N", "moment {} Nm"), np.split(acting[0], 2), strict=True):
            if three.any():
                parts.append(form.format(" ".join(f"{value:g}" for value in three)))
    elif len(acting) > 1:
        parts.append(f"process loads of {len(acting)} kinds")
    parts.append(f"shift <= {size.max(initial=0.0):.3f} mm")
    return f"compensated ({Path(file.path).name}): {', '.join(parts)}"
