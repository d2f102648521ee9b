"""Noise from repeats and intervals of numbers, against simulations with a known truth."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.shrinkage import NEW_POSES, shrink_interval
from postproc.gap.fit.fit import Free
from postproc.gap.fit.problem import pose_problem
from postproc.gap.fit.revisits import revisits
from postproc.gap.posterior.final import Named, frames_of
from postproc.measurement.file import read_measurements

NOISE = 2e-5


@pytest.mark.parametrize("apart", [0.0, 0.3])
@pytest.mark.parametrize("count", [40, 400])
def test_the_interval_of_the_shrinkage_holds_a_new_campaign(count, apart):
    """Rows of eight regions, the new ones in another: it may leave more of the gap, or less."""
    rng = np.random.default_rng(5)
    held, region = 0, (np.arange(count) % 8).astype(np.int32)
    for _ in range(150):
        rows = [rng.gamma(4.0, 1.0, n) for n in (count, NEW_POSES)]
        own = np.exp(apart * rng.normal(size=9))
        left = [0.8 * rng.gamma(6.0, 1.0 / 6.0, len(v)) for v in rows]
        left = [left[0] * own[region], left[1] * own[8]]
        each = np.arange(count, dtype=np.int32)
        low, high = shrink_interval(rows[0], left[0], each, region, np.zeros_like(each))
        new = 1.0 - np.sqrt(np.mean(left[1] ** 2) / np.mean(rows[1] ** 2))
        held += low <= new <= high
    assert 0.84 <= held / 150 <= 0.98


def test_a_course_of_time_widens_the_interval_of_the_shrinkage():
    rng = np.random.default_rng(6)
    stretch = np.repeat(np.arange(5, dtype=np.int32), 20)
    before, after = rng.gamma(9.0, 1.0, 100), rng.gamma(9.0, 0.1, 100) * (1.0 + stretch)
    each = np.arange(100, dtype=np.int32)
    steady = shrink_interval(before, after, each, each % 8, np.zeros_like(stretch))
    drifting = shrink_interval(before, after, each, each % 8, stretch)
    assert drifting[1] - drifting[0] > 1.5 * (steady[1] - steady[0])


def test_one_cluster_has_no_interval():
    one = np.zeros(5, dtype=np.int32)
    assert shrink_interval(np.ones(5), np.ones(5), one, one, one) == (0.0, 0.0)


@pytest.mark.parametrize("registered", [False, True])
@pytest.mark.parametrize("aside", [0.0, 3e-5])
def test_rows_left_out_are_missed_as_by_a_fit_without_them(
    registered, aside, world, tmp_path, kinematics, cell
):
    data, measured, *_ = world.make(72, {"joint_compliance": 2e-4}, n=120, noise=NOISE)
    path = tmp_path / "rows.csv"
    path.write_text(world.csv(data, measured))
    problem = pose_problem(read_measurements(path), kinematics, cell, None, registered)
    everything = np.ones(len(problem), dtype=bool)
    beside = aside * np.random.default_rng(1).normal(size=(len(problem), 3))
    free = {"joint_compliance": Free({})} | frames_of(problem)
    label = (np.arange(len(problem)) % 6).astype(np.int32)
    whole = Named.of(problem, free, NOISE, everything, beside)
    told = whole.missed(whole.tangent.parted(label))
    fitted = np.linalg.norm(problem.measured - whole.fit.point, axis=1)
    for k in range(6):
        here = label == k
        again = Named.of(problem, free, NOISE, ~here, beside).fit
        missed = np.linalg.norm(problem.measured - again.point, axis=1)
        error, change = (np.max(np.abs(v - missed)[here]) for v in (told, fitted))
        assert error < 0.05 * change


@pytest.fixture
def warming(world, tmp_path):
    """Rows that grow with the temperature, the first forty measured again when the arm is warm."""
    data, measured, *_ = world.make(71, {"thermal_drift": 2e-4}, n=160, noise=NOISE)
    lines = world.csv(data, measured).splitlines()
    header, body = lines[0].split(","), [line.split(",") for line in lines[1:]]
    rng = np.random.default_rng(7)
    again = [row.copy() for row in body[:40]]
    for row in again:
        for axis in ("x_mm", "y_mm", "z_mm"):
            at = header.index(axis)
            row[at] = f"{float(row[at]) + rng.normal(0.0, 1e3 * NOISE * np.sqrt(2.0)):.6f}"
        at = header.index("id") if "id" in header else None
        if at is not None:
            row[at] += "_again"
    path = tmp_path / "rows.csv"
    path.write_text("\n".join([lines[0], *(",".join(row) for row in [*body, *again])]))
    return read_measurements(path)


def test_repeats_at_another_temperature_count_once_it_is_regressed_out(warming, kinematics, cell):
    problem = pose_problem(warming, kinematics, cell)
    everything = np.ones(len(problem), dtype=bool)
    found = revisits(problem.samples, problem.gap, everything, problem.set_ups.unit)
    assert 100 <= found.freedom <= 3 * 70
    assert found.noise == pytest.approx(NOISE, rel=0.25)


def test_the_noise_of_a_diagnosis_is_that_of_the_repeats(warming, kinematics, cell):
    diagnosis = diagnose(pose_problem(warming, kinematics, cell))
    assert diagnosis.noise == pytest.approx(NOISE, rel=0.25)
    assert set(diagnosis.adopted) <= {"thermal_drift", "base_frame", "tool_frame"}
