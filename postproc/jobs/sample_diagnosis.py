"""The ``sample --for-diagnosis`` job: a campaign that can tell what is wrong with an arm.

Postures spread over a box and the wrist, each reached from a side of its own; three of them are
read again and again from one side, which tells the noise and a drift.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.cell import Cell, require_numbers
from postproc.errors import StiffnessError
from postproc.gap import (
    APPROACH,
    USUAL_NOISE,
    Open,
    Outlook,
    Promise,
    Reach,
    RobotModel,
    Samples,
    make_samples,
    outlook,
)
from postproc.geometry import apply, rotation_about, transform
from postproc.jobs import drive
from postproc.jobs.drive import free_ways
from postproc.jobs.job_rows import JobRows
from postproc.kinematics import Kinematics, build
from postproc.measurement import DIRECTION, JOINTS, POSITION, WRENCH, cells, table_to_fill_in
from postproc.model import ToolPath
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.stiffness.sample import (
    Load,
    SampleRequest,
    SamplingRules,
    best_orientation,
    reachable,
    travel_order,
)
from postproc.units import DEG, MM

FIRST_LINE = 6
"""Line of the first reading in the CSV, behind the remarks and the header."""
REVISITED, READINGS = 3, 5
"""Postures that are read again, and how often each is read in a pass."""
_EACH = 25
"""Postures tried for each one that is wanted."""
_TILT = 60.0 * DEG
_PAUSE = 30.0
"""Time between readings [s] that the outlook counts on."""
_WARMING = 5.0
"""Warming of the arm [K] that it counts on."""
_SEED = 29
_FRESH = 400
"""Fresh poses that the promise is told for: more change no digit of it."""
_ABOUT = 0.15
"""How far about the tags of a job [m] half of the postures tried for it lie."""
_OTHERS = 1500
"""Postures that those of a plan may be exchanged for."""


@dataclass(frozen=True, slots=True)
class DiagnosisPlan:
    """Readings in the order of driving, SI.

    q (n, 6); direction (n, 6) side of the last motion; posture (n,) number of each reading's
    posture; load (n,) number of its load, -1 without; nodes (m, 6), reads (m,): the way and the
    reading taken at each of its postures, -1 for none; blocked: postures without a free way;
    outlook: what it will tell; promise: what it will leave; left_out: names of tags of its job
    that cannot be driven to, for which nothing is promised.
    """

    cell: Cell
    request: SampleRequest
    q: FloatArray
    direction: FloatArray
    posture: IntArray
    load: IntArray
    nodes: FloatArray
    reads: IntArray
    blocked: int
    outlook: Outlook
    promise: Promise
    left_out: tuple[str, ...] = ()

    @property
    def points(self) -> FloatArray:
        """Tool points (n, 3) of the readings [m], robroot."""
        T = build(self.cell.robot).fk(self.q) @ np.asarray(self.cell.tool.T_flange_tcp)
        return np.asarray(T[:, :3, 3])

    def name(self, reading: int) -> str:
        """Return the name of a reading; the same posture, the same first part."""
        load = int(self.load[reading])
        of = "none" if load < 0 else self.request.loads[load].name
        return f"P{int(self.posture[reading]) + 1:03d}_{of}_{reading + 1}"


def plan_diagnosis(
    cell: Cell,
    request: SampleRequest,
    part: ToolPath | None = None,
    progress: Progress | None = None,
) -> DiagnosisPlan:
    """Plan a campaign for ``diagnose``; ``part``: the job that it is for.

    Postures are chosen for where the arm drives in that job. The grid and angles of the request are
    not used. STF022 where no posture can be taken, STF024 for fewer than 12, STF029 where no tag of
    the job can be driven to.
    """
    if request.count < 4 * REVISITED:
        raise StiffnessError("STF024", f"a diagnosis needs at least {4 * REVISITED} postures")
    report = progress or (lambda done, total, what: None)
    require_numbers(cell)
    kinematics = build(cell.robot)
    job = JobRows.nothing() if part is None else JobRows.of(part, cell)
    report(0, 3, "postures")
    checks = drive.Checks.of(cell, kinematics)
    model = RobotModel.of(kinematics, cell)
    q, side = _postures(model, cell, request, checks, job)
    count, passes = min(request.count, len(q)), [-1, *range(len(request.loads))]
    sigma = cell.instrument.sigma or USUAL_NOISE
    open_ = Open.of(_known(model, cell, request, q, side, job), sigma)
    number = np.arange(len(q) * len(passes)).reshape(len(passes), -1).T
    at_job = number.size + np.arange(len(job.q))
    chosen = np.arange(count)
    # half stay far apart: that costs a tenth at the job, and no cause, and no other place, for it
    if len(job.q):
        chosen = open_.exchanged(chosen, count // 2, number, at_job)
    report(1, 3, "ways between postures")
    nodes, reads, blocked = _ways(q[chosen], side[chosen], kinematics, checks)
    posture = np.tile(reads[reads >= 0], len(passes))
    load = np.repeat(passes, np.count_nonzero(reads >= 0))
    numbers = np.where(reads >= 0, np.cumsum(reads >= 0) - 1, -1)
    taken = np.count_nonzero(reads >= 0)
    way = [np.where(numbers >= 0, numbers + k * taken, -1) for k in range(len(passes))]
    report(2, 3, "what it will tell")
    read, others = chosen[posture], np.setdiff1d(np.arange(len(q)), chosen)
    samples = _samples(model, cell, request, q[read], side[read], load)
    fresh = number[others[:_FRESH] if len(others) else chosen].ravel()
    return DiagnosisPlan(
        cell,
        request,
        q[read],
        side[read],
        posture.astype(np.int32),
        load.astype(np.int32),
        np.tile(nodes, (len(passes), 1)),
        np.concatenate(way).astype(np.int32),
        blocked,
        outlook(samples, sigma),
        open_.promise(number[read, load + 1], fresh, at_job),
        job.left_out,
    )


def _postures(
    model: RobotModel, cell: Cell, request: SampleRequest, checks: drive.Checks, job: JobRows
) -> tuple[FloatArray, FloatArray]:
    """Return postures (k, 6) [rad], some to exchange last, and the side of each (k, 6)."""
    kinematics = model.arm.kinematics
    rng = np.random.default_rng(_SEED)
    limits, grid = cell.limits, request.grid
    rules = SamplingRules(
        np.array([0.0, 0.0, 1.0]),
        np.zeros(1),
        request.rules.R_robroot_tcp,
        limits.joint_margin + APPROACH,
        limits.singularity,
    )
    n = _EACH * request.count
    low = np.asarray(grid.origin)
    high = low + np.asarray(grid.size) * np.array(grid.counts)
    points = low + rng.random((n, 3)) * (high - low)
    T_flange_tcp = np.asarray(cell.tool.T_flange_tcp)
    R = rules.R_robroot_tcp
    if R is None:
        R = best_orientation(points[:100], kinematics, T_flange_tcp, rules)
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turns = np.array(
        [
            rotation_about(one, np.array([angle]))[0]
            for one, angle in zip(axis, rng.uniform(0.0, _TILT, n), strict=True)
        ]
    )
    R_robroot_tcp = R @ turns
    if len(job.q):
        about = rng.integers(len(job.q), size=n // 2)
        T = kinematics.fk(job.q[about])
        near = apply(T, job.point[about]) + rng.normal(0.0, _ABOUT, (n // 2, 3))
        points[: n // 2] = np.clip(near, low, high)
        R_robroot_tcp[: n // 2] = T[:, :3, :3] @ T_flange_tcp[:3, :3] @ turns[: n // 2]
    found, reason = reachable(transform(R_robroot_tcp, points), kinematics, T_flange_tcp, rules)
    q = np.round(found[reason == 0] / DEG, 5) * DEG
    side = rng.choice([-1.0, 1.0], q.shape)
    samples = make_samples(model.arm, q)
    reach = Reach(limits.joint_margin, limits.singularity, checks.is_free, checks.are_free)
    good = np.flatnonzero(reach.allows(samples, q - APPROACH * side))
    if len(good) < 4 * REVISITED:
        text = f"{len(good)} of {n} postures can be taken, too few for a diagnosis"
        raise StiffnessError("STF022", text, hint="move or widen the box")
    q, side = q[good], side[good]
    chosen = _far_apart(q, request.count)
    order = np.append(chosen, np.setdiff1d(np.arange(len(q)), chosen)[:_OTHERS])
    return q[order], side[order]


def _far_apart(q: FloatArray, count: int) -> IntArray:
    """Return postures each as far as can be from those before."""
    chosen = [0]
    away = np.linalg.norm(q - q[0], axis=1)
    while len(chosen) < min(count, len(q)):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(q - q[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int32)


def _ways(
    q: FloatArray, side: FloatArray, kinematics: Kinematics, checks: drive.Checks
) -> tuple[FloatArray, IntArray, int]:
    """Return the way (m, 6), repeats between, its readings (m,), and how many have no free way."""
    first = min(REVISITED, len(q))
    tour = travel_order(q[first:], np.arange(len(q) - first, dtype=np.int32), kinematics) + first
    order: list[int] = []
    for part in np.array_split(tour, READINGS):
        order += [*range(first), *(int(k) for k in part)]
    stops = [p for k in order for p in (q[k] - APPROACH * side[k], q[k])]
    kept, nodes, way, _ = free_ways(np.array(stops), checks.are_free, np.zeros((0, 6)))
    label = [order[int(k) // 2] if int(k) % 2 else -1 for k in kept]
    reads = np.array([label[k - 1] if k > 0 else -1 for k in way], dtype=np.int32)
    return nodes[np.abs(way) - 1], reads, len(q) - len(set(label) - {-1})


def _known(
    model: RobotModel,
    cell: Cell,
    request: SampleRequest,
    q: FloatArray,
    side: FloatArray,
    job: JobRows,
) -> Samples:
    """Return all postures in each pass, and behind them the job: whenever that may be."""
    passes = 1 + len(request.loads)
    every = np.tile(q, (passes, 1))
    load = np.repeat(np.arange(-1, passes - 1, dtype=np.int32), len(q))
    wrench = _wrenches(cell, request.loads, model.arm.kinematics, every, load)
    wrench = np.vstack([wrench, job.wrench])
    seen = np.vstack([np.tile(model.arm.p_flange_point, (len(every), 1)), job.point])
    rows = make_samples(
        model.arm,
        np.vstack([every, job.q]),
        direction=np.vstack([np.tile(side, (passes, 1)), job.side]),
        wrench=wrench if np.any(wrench) else None,
    )
    return replace(rows, seen=seen).at(rows.q)


def _samples(
    model: RobotModel,
    cell: Cell,
    request: SampleRequest,
    q: FloatArray,
    side: FloatArray,
    load: IntArray,
) -> Samples:
    time = _PAUSE * np.arange(len(q))
    wrench = _wrenches(cell, request.loads, model.arm.kinematics, q, load)
    return make_samples(
        model.arm,
        q,
        direction=side,
        time=time,
        temperature=20.0 + _WARMING * (1.0 - np.exp(-2.0 * time / max(time[-1], 1.0))),
        wrench=wrench if np.any(wrench) else None,
    )


def _wrenches(
    cell: Cell, loads: tuple[Load, ...], kinematics: Kinematics, q: FloatArray, load: IntArray
) -> FloatArray:
    wrench = np.zeros((len(q), 6))
    for number, one in enumerate(loads):
        here = load == number
        wrench[here] = one.wrench(q[here], cell, kinematics)
    return wrench


def csv_text(plan: DiagnosisPlan) -> bytes:
    """Return the table to fill in."""
    notes = (
        "fill in x_mm, y_mm, z_mm, time_s (since the start) and temp_C (of the arm)",
        "delete rows that were not taken; then: diagnose this file",
        "q, dir, loads are what the program drives; the same P number is the same posture",
        f"a model of these readings {plan.promise.words}",
    )
    wrench = _wrenches(plan.cell, plan.request.loads, build(plan.cell.robot), plan.q, plan.load)
    rows = []
    for i in range(len(plan.q)):
        row = {"id": plan.name(i), **cells(JOINTS, plan.q[i] / DEG, 5)}
        row |= dict.fromkeys((*POSITION, "time_s", "temp_C"), "")
        row |= cells(DIRECTION, plan.direction[i], 0)
        rows.append(row | (cells(WRENCH, wrench[i], 4) if plan.request.loads else {}))
    return table_to_fill_in(notes, rows)


def drive_of(plan: DiagnosisPlan) -> drive.Drive:
    """Return the motions: from the chosen side to each posture, a stop to change the load."""
    request = plan.request
    order = [int(k) for k in plan.reads if k >= 0]
    notes = [drive.Note(0, FIRST_LINE, f"a model of these {plan.promise.words}", stop=False)]
    for number, load in enumerate(request.loads):
        first = int(np.argmax(plan.load == number))
        move = int(np.argmax(plan.reads == first))
        notes.append(drive.Note(move, first + FIRST_LINE, f"put on load: {load.name}", stop=True))
    return drive.Drive(
        name=request.name,
        cell=plan.cell,
        q=plan.nodes,
        reads=plan.reads >= 0,
        names=tuple(plan.name(k) for k in order),
        line=np.array([k + FIRST_LINE for k in order], dtype=np.int32),
        notes=tuple(notes),
        speed=request.speed,
        wait=request.wait,
        halt=request.halt,
        command="sample",
    )


def files(plan: DiagnosisPlan) -> dict[str, bytes]:
    """Return the table to fill in and the program."""
    out = dict(drive.program_files(drive_of(plan)))
    out[f"{plan.request.name}.csv"] = csv_text(plan)
    return out


def diagnosis_plan_document(plan: DiagnosisPlan, names: list[str]) -> dict[str, Any]:
    """Return the ``postproc.diagnosis_plan/1`` document."""
    return {
        "schema": "postproc.diagnosis_plan/1",
        "files": names,
        "postures": len(np.unique(plan.posture)),
        "readings": len(plan.q),
        "blocked": plan.blocked,
        "left_out": list(plan.left_out),
        "promise": {
            "rows": len(plan.q),
            "rms_left_mm": round(plan.promise.left / MM, 5),
            "at_the_job_mm": None if plan.promise.job is None else round(plan.promise.job / MM, 5),
            "can_tell": list(plan.outlook.can_tell),
        },
        **plan.outlook.entry(),
    }
