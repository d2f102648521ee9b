"""The ``sample`` job: a measuring plan free of collision, and the motions that drive it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from postproc.emitters.krl_style import KrlStyle
from postproc.emitters.kuka_krl import emit, render_files
from postproc.errors import StiffnessError
from postproc.frames import inverse
from postproc.kinematics.model import Kinematics, build
from postproc.krl.program import Call, Halt, KrlModule, Statement
from postproc.model.arrays import BoolArray, FloatArray, IntArray
from postproc.model.cell import Cell
from postproc.model.plan import MoveKind, MoveRole, Plan
from postproc.model.toolpath import Event, EventKind, MotionKind, ToolPath
from postproc.pipeline.ways import AreFree, with_free_ways
from postproc.stiffness.measuring import (
    TRACKER_SIGMA,
    SampleRequest,
    Sampling,
    expected_compliance,
    largest_force,
    load_regressors,
)
from postproc.stiffness.observability import observe, showing_load
from postproc.stiffness.optimal import choose, features
from postproc.stiffness.sampling import SamplingPlan, plan_sampling, travel_order

Progress = Callable[[int, int, str], None]
FIRST_LINE = 5
"""Line of the first reading in the CSV, behind the remarks and the header."""


def sample(cell: Cell, request: SampleRequest, progress: Progress | None = None) -> Sampling:
    """Plan the measurement.

    Raises:
        StiffnessError: STF020 to STF024.
    """
    if request.count < 3 or not request.loads:
        raise StiffnessError("STF024", "a measuring plan needs a load and at least 3 postures")
    report = progress or (lambda done, total, what: None)
    kinematics = build(cell.robot)
    T_flange_tcp = np.asarray(cell.tool.T_flange_tcp)
    rules = replace(
        request.rules,
        joint_margin=cell.limits.joint_margin,
        singularity=cell.limits.singularity,
    )
    report(0, 3, "postures")
    checks = _Checks.of(cell, kinematics)
    plan = plan_sampling(request.grid, kinematics, T_flange_tcp, rules, checks.is_free)
    if request.method == "optimal":
        report(1, 3, "choosing")
        plan = _most_telling(plan, cell, kinematics, request)
    report(2, 3, "ways between postures")
    plan, blocked, way, back = with_free_ways(plan, checks.are_free)
    A = load_regressors(plan, cell, kinematics, request.loads)
    c_ref = expected_compliance(cell)
    outlook = observe(A.reshape(-1, 3, 6), c_ref, TRACKER_SIGMA)
    J = kinematics.jacobian(plan.q[:500], T_flange_tcp[:3, 3])
    newton = largest_force(request.loads)
    shown = {
        joint: showing_load(J, joint, c_ref, TRACKER_SIGMA, newton)
        for joint in range(6)
        if not outlook.seen[joint]
    }
    return Sampling(plan, request, cell, outlook, shown, blocked, way, back)


def _most_telling(
    plan: SamplingPlan, cell: Cell, kinematics: Kinematics, request: SampleRequest
) -> SamplingPlan:
    A = load_regressors(plan, cell, kinematics, request.loads)
    P = features(request.model, plan.q, plan.points[plan.tag], plan.grid)
    picked = choose(A, P, expected_compliance(cell), TRACKER_SIGMA, request.count)
    part = plan.rows(np.sort(picked))
    return part.rows(travel_order(part.q, part.tag, kinematics))


@dataclass(frozen=True, slots=True)
class _Checks:
    """Collision checks of postures and of the ways between them; None in an empty cell."""

    is_free: Callable[[FloatArray], BoolArray] | None
    are_free: AreFree | None

    @classmethod
    def of(cls, cell: Cell, kinematics: Kinematics) -> _Checks:
        """Return the checks of a cell."""
        if not (cell.obstacles or cell.workpiece.meshes or cell.tool.meshes):
            return cls(None, None)
        from postproc.collision.scene import Scene

        scene = Scene.build(cell, kinematics)

        def is_free(q: FloatArray) -> BoolArray:
            return ~np.asarray(scene.check(q).hit, dtype=bool)

        def are_free(q_from: FloatArray, q_to: FloatArray) -> BoolArray:
            return ~np.asarray(scene.check_paths(q_from, q_to).hit, dtype=bool)

        return cls(is_free, are_free)


def program_files(sampling: Sampling) -> dict[str, bytes]:
    """Return the files of the program that drives the plan.

    A stop is a plain HALT: the program must run on a controller without the routines that a
    machining cell defines.
    """
    modules = emit(motion_plan(sampling), sampling.cell)
    stop = KrlStyle.of(sampling.cell).hooks["stop"]
    return render_files([_with_halts(module, stop) for module in modules])


def _with_halts(module: KrlModule, stop: str) -> KrlModule:
    def halted(statement: Statement) -> Statement:
        if isinstance(statement, Call) and statement.name == stop:
            return Halt(comment=statement.comment)
        return statement

    routines = tuple(
        replace(routine, statements=tuple(halted(line) for line in routine.statements))
        for routine in module.routines
    )
    return replace(module, routines=routines)


def motion_plan(sampling: Sampling) -> Plan:
    """Return the motions of all passes: unloaded, then each load, with a stop to change it.

    Every pass takes the postures in the same order, so that play in the gears is the same with
    and without load and cancels.
    """
    plan, cell, request = sampling.plan, sampling.cell, sampling.request
    kinematics = build(cell.robot)
    row = _rows(sampling)
    q, reads = plan.q[np.abs(row) - 1], row > 0
    m, n = len(row), len(plan)
    T_base_tcp = inverse(cell.workpiece.T_robroot_base) @ kinematics.fk(q) @ cell.tool.T_flange_tcp
    tag = np.maximum(np.cumsum(reads) - 1, 0).astype(np.int32)
    speed = np.asarray(cell.robot.qd_max) * request.speed
    duration = np.max(np.abs(np.diff(q, axis=0, prepend=q[:1])) / speed, axis=1)
    dwell = np.where(reads & (not request.halt), request.wait, 0.0)
    nothing = np.full(m, np.nan)
    first = [int(np.flatnonzero(reads)[k * n]) for k in range(1 + len(request.loads))]
    return Plan(
        name=request.name,
        toolpath=_toolpath(sampling, q[reads], T_base_tcp[reads]),
        kind=np.full(m, MoveKind.PTP),
        role=np.where(np.arange(m) == 0, MoveRole.ENTRY, MoveRole.RAPID),
        tag=tag,
        T_base_tcp=T_base_tcp,
        aux=np.full((m, 3), np.nan),
        q=q,
        spin=np.zeros(m),
        branch=kinematics.slot(q),
        speed=nothing,
        ptp_fraction=np.full(m, request.speed),
        blend=np.zeros(m),
        dwell=dwell,
        duration=duration + dwell,
        external=np.zeros((m, len(cell.external_axes))),
        stiffness=np.full(len(plan) * len(first), np.nan),
        stiffness_initial=np.full(len(plan) * len(first), np.nan),
        clearance=np.full(len(plan) * len(first), np.nan),
        events=_events(sampling, first, np.flatnonzero(reads).astype(np.int32)),
        settings={"command": "sample"},
    )


def _rows(sampling: Sampling) -> IntArray:
    """Return posture numbers (1-based) in the order of driving; negative: pass without reading."""
    back = tuple(-number for number in sampling.back)
    numbers = sampling.way + (back + sampling.way) * len(sampling.request.loads)
    return np.array(numbers, dtype=np.int32)


def _events(
    sampling: Sampling, first: list[int], reading: IntArray
) -> tuple[tuple[int, Event], ...]:
    """Return messages and stops: before each pass, and at each reading when asked for."""
    n, request = len(sampling.plan), sampling.request
    events: list[tuple[int, Event]] = []
    for k, move in enumerate(first):
        line = k * n + FIRST_LINE
        text = "unloaded readings" if k == 0 else f"put on load: {request.loads[k - 1].name}"
        events.append((move, Event(move, EventKind.MESSAGE, text=text, line=line)))
        if k > 0:
            events.append((move, Event(move, EventKind.STOP, text=text, line=line)))
    if request.halt:
        for k, move in enumerate(reading):
            stop = Event(
                int(move) + 1, EventKind.STOP, text="take the reading", line=k + FIRST_LINE
            )
            events.append((int(move) + 1, stop))
    return tuple(sorted(events, key=lambda pair: pair[0]))


def _toolpath(sampling: Sampling, q: FloatArray, T_base_tcp: FloatArray) -> ToolPath:
    m = len(q)
    none = np.full(m, -1)
    axis = -(T_base_tcp[:, :3, :3] @ np.asarray(sampling.cell.tool.axis))
    labels = ["none", *(load.name for load in sampling.request.loads)]
    names = [
        f"{sampling.plan.name(i)}_{label}" for label in labels for i in range(len(sampling.plan))
    ]
    return ToolPath(
        path=f"{sampling.request.name}.csv",
        name=sampling.request.name,
        format="csv",
        dialect="",
        units="mm",
        points=T_base_tcp[:, :3, 3],
        axes=axis,
        kind=np.full(m, MotionKind.JOINT),
        feed=np.full(m, np.nan),
        line=np.arange(FIRST_LINE, m + FIRST_LINE, dtype=np.int32),
        operation=none,
        tool=none,
        arc=none,
        cycle=none,
        joints=q,
        names=tuple(names),
    )
