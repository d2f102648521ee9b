"""The ``sample`` job: measuring plan, the CSV to fill in, and the KRL program that drives it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from postproc.errors import StiffnessError
from postproc.frames import inverse
from postproc.kinematics.model import Kinematics, build
from postproc.model.arrays import BoolArray, FloatArray, IntArray
from postproc.model.cell import Cell
from postproc.model.plan import MoveKind, MoveRole, Plan
from postproc.model.toolpath import Event, EventKind, MotionKind, ToolPath
from postproc.stiffness.cartesian import moved_wrench, regressor
from postproc.stiffness.constant import TYPICAL_C
from postproc.stiffness.field import Grid
from postproc.stiffness.observability import Observability, ShowingLoad, observe, showing_load
from postproc.stiffness.optimal import choose, features
from postproc.stiffness.sampling import SamplingPlan, SamplingRules, plan_sampling, travel_order
from postproc.units import DEG, MM, STANDARD_GRAVITY, UM

Progress = Callable[[int, int, str], None]
TRACKER_SIGMA = 17e-6
"""Sd per axis [m] of a loaded minus unloaded tracker reading (12 um each), for forecasts."""


@dataclass(frozen=True, slots=True)
class Load:
    """A load that can be put on the tool: a weight hung at a point, or a constant force.

    ``mass`` [kg] at ``p_flange`` (3,) [m]; or ``force`` (3,) [N] at the tool point, robroot.
    """

    name: str
    mass: float = 0.0
    p_flange: FloatArray | None = None
    force: FloatArray | None = None

    def wrench(self, q: FloatArray, cell: Cell, kinematics: Kinematics) -> FloatArray:
        """Return (n, 6) ON the tool at the tool point, robroot [N, N*m]."""
        tcp = cell.tool.T_flange_tcp[:3, 3]
        if self.force is not None:
            return np.tile(np.concatenate([self.force, np.zeros(3)]), (len(q), 1))
        down = cell.robot.T_world_robroot[:3, :3].T @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
        weight = np.tile(np.concatenate([self.mass * down, np.zeros(3)]), (len(q), 1))
        at = tcp if self.p_flange is None else self.p_flange
        return moved_wrench(weight, kinematics.fk(q)[:, :3, :3] @ (at - tcp))


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """What to plan. Lengths [m], angles [rad].

    ``method``: ``grid`` (every posture) or ``optimal`` (the ``count`` most telling for ``model``);
    ``wait`` [s] at each posture; ``halt``: wait for the operator instead; ``speed`` 0..1 of PTP.
    """

    grid: Grid
    rules: SamplingRules
    loads: tuple[Load, ...]
    name: str = "sample"
    method: str = "grid"
    model: str = "continuous"
    count: int = 64
    wait: float = 5.0
    halt: bool = False
    speed: float = 0.3


@dataclass(frozen=True, slots=True)
class Sampling:
    """A measuring plan with what it will be able to tell.

    ``blocked``: postures left out because the way to them is not free.
    """

    plan: SamplingPlan
    request: SampleRequest
    cell: Cell
    outlook: Observability
    shown_by: dict[int, ShowingLoad]
    blocked: tuple[str, ...]

    @property
    def travel(self) -> float:
        """Sum of the largest joint motion of every step [rad], one pass."""
        steps = np.abs(np.diff(self.plan.q, axis=0))
        return float(steps.max(axis=1).sum()) if len(steps) else 0.0


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
    A = _regressors(plan, cell, kinematics, request.loads)
    c_ref = _expected(cell)
    outlook = observe(A.reshape(-1, 3, 6), c_ref, TRACKER_SIGMA)
    J = kinematics.jacobian(plan.q[:500], T_flange_tcp[:3, 3])
    newton = _newton(request.loads)
    shown = {
        joint: showing_load(J, joint, c_ref, TRACKER_SIGMA, newton)
        for joint in range(6)
        if not outlook.seen[joint]
    }
    return Sampling(plan, request, cell, outlook, shown, blocked)


def _newton(loads: tuple[Load, ...]) -> float:
    sizes = [
        float(np.linalg.norm(load.force))
        if load.force is not None
        else load.mass * STANDARD_GRAVITY
        for load in loads
    ]
    return max([size for size in sizes if size > 0.0], default=500.0)


def _expected(cell: Cell) -> FloatArray:
    known = cell.joint_stiffness
    return TYPICAL_C if known is None else np.asarray(1.0 / known)


def _regressors(
    plan: SamplingPlan, cell: Cell, kinematics: Kinematics, loads: tuple[Load, ...]
) -> FloatArray:
    """Return (n, 3 loads, 6): what each load does at each posture per unit compliance."""
    J = kinematics.jacobian(plan.q, cell.tool.T_flange_tcp[:3, 3])
    parts = [regressor(J, load.wrench(plan.q, cell, kinematics))[:, :3] for load in loads]
    return np.concatenate(parts, axis=1)


def _most_telling(
    plan: SamplingPlan, cell: Cell, kinematics: Kinematics, request: SampleRequest
) -> SamplingPlan:
    A = _regressors(plan, cell, kinematics, request.loads)
    P = features(request.model, plan.q, plan.points[plan.tag], plan.grid)
    picked = choose(A, P, _expected(cell), TRACKER_SIGMA, request.count)
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


# ------------------------------------------------------------------------------ output


CSV_HEAD = (
    *("id", "group", "load"),
    *(f"q{i}_deg" for i in range(1, 7)),
    *("x_mm", "y_mm", "z_mm"),
    *("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"),
    *(f"dir{i}" for i in range(1, 7)),
)


def csv_text(sampling: Sampling) -> bytes:
    """Return the CSV to fill in: one row a reading, in the order of the program."""
    plan, cell = sampling.plan, sampling.cell
    kinematics = build(cell.robot)
    step = np.diff(plan.q, axis=0, prepend=plan.q[:1])
    direction = np.where(np.abs(step) > 1e-7, np.sign(step), 0.0).astype(int)
    lines = [
        "# fill in x_mm, y_mm, z_mm: the measured tool point in the robot root frame",
        "# (any tracker frame will do: then identify with --register)",
        "# fx_N..mz_Nm: load ON the tool at the tool point, axes of the robot root",
        ",".join(CSV_HEAD),
    ]
    for load in (None, *sampling.request.loads):
        wrench = np.zeros((len(plan), 6)) if load is None else load.wrench(plan.q, cell, kinematics)
        label = "none" if load is None else load.name
        for i in range(len(plan)):
            name = plan.name(i)
            cells = [
                f"{name}_{label}",
                f"T{int(plan.tag[i]) + 1:04d}",
                label,
                *(f"{v:z.6f}" for v in plan.q[i] / DEG),
                *("", "", ""),
                *(f"{v:z.4f}" for v in wrench[i]),
                *(str(int(v)) for v in direction[i]),
            ]
            lines.append(",".join(cells))
    return ("\n".join(lines) + "\n").encode()


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


def document(sampling: Sampling, files: list[str]) -> dict[str, object]:
    """Return the ``postproc.sample/1`` document."""
    plan, outlook = sampling.plan, sampling.outlook
    return {
        "schema": "postproc.sample/1",
        "files": files,
        "cells": len(plan.grid),
        "cell_mm": [round(float(v) / MM, 6) for v in plan.grid.size],
        "tags": len(plan.points),
        "tags_used": len(np.unique(plan.tag)),
        "postures": len(plan),
        "readings": len(plan) * (1 + len(sampling.request.loads)),
        "travel_deg": round(sampling.travel / DEG, 3),
        "dropped": [
            {"tag": f"T{tag + 1:04d}", "angle_deg": _angle(sampling, turn), "reason": reason}
            for tag, turn, reason in plan.dropped
        ]
        + [{"posture": name, "reason": "the way to it collides"} for name in sampling.blocked],
        "joints": [
            {
                "joint": joint + 1,
                "status": str(outlook.visibility[joint]),
                "expected_sd_percent": _percent(outlook.relative_sd[joint]),
                "shown_by": shown_text(sampling.shown_by.get(joint)),
            }
            for joint in range(6)
        ],
    }


def _angle(sampling: Sampling, turn: int) -> float:
    return round(float(sampling.request.rules.angles[turn]) / DEG, 6)


def _percent(value: float) -> float | None:
    return round(100.0 * float(value), 3) if math.isfinite(value) else None


def shown_text(load: ShowingLoad | None) -> str | None:
    """Return the load that would show a joint, in words; None for a joint that is seen."""
    if load is None:
        return None
    if load.motion < 1e-9:
        return "no force at the tool point; measure a point beside the axis, under a moment"
    direction = " ".join(f"{v:.2g}" for v in load.direction)
    return (
        f"{load.newton:.0f} N along ({direction}) of the robot root: moves the tool "
        f"{load.motion / UM:.0f} um by this joint"
    )
