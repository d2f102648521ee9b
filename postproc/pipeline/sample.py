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
    plan, blocked = _with_free_ways(plan, checks)
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
    return Sampling(plan, request, cell, outlook, shown, blocked)


def _most_telling(
    plan: SamplingPlan, cell: Cell, kinematics: Kinematics, request: SampleRequest
) -> SamplingPlan:
    A = load_regressors(plan, cell, kinematics, request.loads)
    P = features(request.model, plan.q, plan.points[plan.tag], plan.grid)
    picked = choose(A, P, expected_compliance(cell), TRACKER_SIGMA, request.count)
    part = _subset(plan, np.sort(picked))
    return _subset(part, travel_order(part.q, part.tag, kinematics))


def _subset(plan: SamplingPlan, rows: IntArray) -> SamplingPlan:
    return replace(plan, tag=plan.tag[rows], angle=plan.angle[rows], q=plan.q[rows])


@dataclass(frozen=True, slots=True)
class _Checks:
    """Collision checks of postures and of the ways between them; None in an empty cell."""

    is_free: Callable[[FloatArray], BoolArray] | None
    is_free_way: Callable[[FloatArray], BoolArray] | None

    @classmethod
    def of(cls, cell: Cell, kinematics: Kinematics) -> _Checks:
        """Return the checks of a cell."""
        if not (cell.obstacles or cell.workpiece.meshes or cell.tool.meshes):
            return cls(None, None)
        from postproc.collision.scene import Scene

        scene = Scene.build(cell, kinematics)

        def is_free(q: FloatArray) -> BoolArray:
            return ~np.asarray(scene.check(q).hit, dtype=bool)

        def is_free_way(q: FloatArray) -> BoolArray:
            return ~np.asarray(scene.check_motion(q).hit, dtype=bool)

        return cls(is_free, is_free_way)


def _with_free_ways(plan: SamplingPlan, checks: _Checks) -> tuple[SamplingPlan, tuple[str, ...]]:
    """Leave out postures whose way from the one before is not free, until all ways are."""
    blocked: list[str] = []
    while checks.is_free_way is not None and len(plan) > 1:
        free = checks.is_free_way(plan.q)
        if bool(np.all(free)):
            break
        # the way after a posture that is left out changes, so one in a row at a time
        bad = np.flatnonzero(~free)
        bad = bad[np.diff(bad, prepend=-2) > 1] + 1
        blocked += [plan.name(int(i)) for i in bad]
        plan = _subset(plan, np.delete(np.arange(len(plan)), bad))
    return plan, tuple(blocked)


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
    """Return the motions of all passes: unloaded, then each load, with a stop to change it."""
    plan, cell, request = sampling.plan, sampling.cell, sampling.request
    kinematics = build(cell.robot)
    n, passes = len(plan), 1 + len(request.loads)
    q = np.tile(plan.q, (passes, 1))
    m = len(q)
    T_base_tcp = inverse(cell.workpiece.T_robroot_base) @ kinematics.fk(q) @ cell.tool.T_flange_tcp
    events: list[tuple[int, Event]] = []
    for k in range(passes):
        text = "unloaded readings" if k == 0 else f"put on load: {request.loads[k - 1].name}"
        first = k * n
        events.append((first, Event(first, EventKind.MESSAGE, text=text, line=first + 5)))
        if k > 0:
            events.append((first, Event(first, EventKind.STOP, text=text, line=first + 5)))
    if request.halt:
        events += [
            (i + 1, Event(i + 1, EventKind.STOP, text="take the reading", line=i + 5))
            for i in range(m)
        ]
        events.sort(key=lambda pair: pair[0])
    nothing = np.full(m, np.nan)
    speed = np.asarray(cell.robot.qd_max) * request.speed
    duration = np.max(np.abs(np.diff(q, axis=0, prepend=q[:1])) / speed, axis=1)
    return Plan(
        name=request.name,
        toolpath=_toolpath(sampling, q, T_base_tcp),
        kind=np.full(m, MoveKind.PTP),
        role=np.where(np.arange(m) == 0, MoveRole.ENTRY, MoveRole.RAPID),
        tag=np.arange(m, dtype=np.int32),
        T_base_tcp=T_base_tcp,
        aux=np.full((m, 3), np.nan),
        q=q,
        spin=np.zeros(m),
        branch=kinematics.slot(q),
        speed=nothing,
        ptp_fraction=np.full(m, request.speed),
        blend=np.zeros(m),
        dwell=np.full(m, 0.0 if request.halt else request.wait),
        duration=duration + (0.0 if request.halt else request.wait),
        external=np.zeros((m, len(cell.external_axes))),
        stiffness=nothing,
        stiffness_initial=nothing,
        clearance=nothing,
        events=tuple(events),
        settings={"command": "sample"},
    )


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
        line=np.arange(5, m + 5, dtype=np.int32),
        operation=none,
        tool=none,
        arc=none,
        cycle=none,
        joints=q,
        names=tuple(names),
    )
