"""The ``sample`` job: a measuring plan free of collision, and the motions that drive it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import IntArray
from postproc.cell import Cell, require_numbers
from postproc.errors import StiffnessError
from postproc.jobs import drive
from postproc.jobs.drive import with_free_ways
from postproc.kinematics import Kinematics, build
from postproc.progress import Progress
from postproc.stiffness.identify import observe, showing_load
from postproc.stiffness.sample import (
    TRACKER_SIGMA,
    SampleRequest,
    Sampling,
    SamplingPlan,
    choose,
    expected_compliance,
    features,
    largest_force,
    load_regressors,
    plan_sampling,
    travel_order,
)

FIRST_LINE = 5
"""Line of the first reading in the CSV, behind the remarks and the header."""


def sample(cell: Cell, request: SampleRequest, progress: Progress | None = None) -> Sampling:
    """Plan the measurement.

    Raises:
        CellError: CEL030 for an arm with unknown limits or speeds.
        StiffnessError: STF020 to STF024.
    """
    if request.count < 3 or not request.loads:
        raise StiffnessError("STF024", "a measuring plan needs a load and at least 3 postures")
    report = progress or (lambda done, total, what: None)
    require_numbers(cell)
    kinematics = build(cell.robot)
    T_flange_tcp = np.asarray(cell.tool.T_flange_tcp)
    rules = replace(
        request.rules, joint_margin=cell.limits.joint_margin, singularity=cell.limits.singularity
    )
    report(0, 3, "postures")
    # in a cell without solids nothing can be hit but the arm itself
    solid = cell.obstacles or cell.workpiece.meshes or cell.tool.meshes
    checks = drive.Checks.of(cell, kinematics) if solid else None
    is_free = checks.is_free if checks else None
    plan = plan_sampling(request.grid, kinematics, T_flange_tcp, rules, is_free)
    if request.method == "optimal":
        report(1, 3, "choosing")
        plan = _most_telling(plan, cell, kinematics, request)
    report(2, 3, "ways between postures")
    plan, blocked, way, back = with_free_ways(plan, checks.are_free if checks else None)
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


def program_files(sampling: Sampling) -> Mapping[str, bytes]:
    """Return the files of the program that drives the plan."""
    return drive.program_files(drive_of(sampling))


def drive_of(sampling: Sampling) -> drive.Drive:
    """Return the motions of all passes: unloaded, then each load, with a stop to change it.

    Every pass takes the postures in the same order, so that play in the gears is the same with
    and without load and cancels.
    """
    plan, request = sampling.plan, sampling.request
    row = _rows(sampling)
    reads = row > 0
    n = len(plan)
    labels = ["none", *(load.name for load in request.loads)]
    readings = n * len(labels)
    return drive.Drive(
        name=request.name,
        cell=sampling.cell,
        q=plan.q[np.abs(row) - 1],
        reads=reads,
        names=tuple(f"{plan.name(i)}_{label}" for label in labels for i in range(n)),
        line=np.arange(FIRST_LINE, readings + FIRST_LINE, dtype=np.int32),
        notes=_notes(sampling, np.flatnonzero(reads)[::n].astype(np.int32)),
        speed=request.speed,
        wait=request.wait,
        halt=request.halt,
        command="sample",
    )


def _rows(sampling: Sampling) -> IntArray:
    """Return posture numbers (1-based) in the order of driving; negative: pass without reading."""
    back = tuple(-number for number in sampling.back)
    numbers = sampling.way + (back + sampling.way) * len(sampling.request.loads)
    return np.array(numbers, dtype=np.int32)


def _notes(sampling: Sampling, first: IntArray) -> tuple[drive.Note, ...]:
    """Return what is said before each pass, at the moves ``first``."""
    loads = sampling.request.loads
    texts = ["unloaded readings", *(f"put on load: {load.name}" for load in loads)]
    return tuple(
        drive.Note(int(move), k * len(sampling.plan) + FIRST_LINE, text, k > 0)
        for k, (move, text) in enumerate(zip(first, texts, strict=True))
    )
