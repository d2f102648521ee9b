"""Noise from repeats and intervals of numbers, against simulations with a known truth."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.shrinkage import NEW_POSES, shrink_interval
from postproc.gap.choice.evidence import Evidence
from postproc.gap.choice.fitting import Named
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.effect import EFFECTS
from postproc.gap.fit.fit import Free, fit
from postproc.gap.fit.intervals import deviations
from postproc.gap.fit.linear import block_of
from postproc.gap.fit.problem import pose_problem
from postproc.gap.fit.regression import Regression
from postproc.gap.fit.revisits import revisits
from postproc.measurement.file import read_measurements

NOISE = 2e-5
BACKLASH = dict(EFFECTS)["backlash"]


@pytest.mark.parametrize("count", [40, 80, 400])
def test_the_interval_of_the_shrinkage_holds_a_new_campaign(count):
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        rows = [rng.gamma(4.0, 1.0, n) for n in (count, NEW_POSES)]
        left = [0.2 * rng.gamma(6.0, 1.0 / 6.0, len(v)) * 4.0 for v in rows]
        each = np.arange(count, dtype=np.int32)
        low, high = shrink_interval(rows[0], left[0], each, np.zeros_like(each))
        new = 1.0 - np.sqrt(np.mean(left[1] ** 2) / np.mean(rows[1] ** 2))
        held += low <= new <= high
    assert 0.84 <= held / 300 <= 0.96


def test_a_course_of_time_widens_the_interval_of_the_shrinkage():
    rng = np.random.default_rng(6)
    stretch = np.repeat(np.arange(5, dtype=np.int32), 20)
    before, after = rng.gamma(9.0, 1.0, 100), rng.gamma(9.0, 0.1, 100) * (1.0 + stretch)
    each = np.arange(100, dtype=np.int32)
    steady = shrink_interval(before, after, each, np.zeros_like(stretch))
    drifting = shrink_interval(before, after, each, stretch)
    assert drifting[1] - drifting[0] > 1.5 * (steady[1] - steady[0])


def test_one_cluster_has_no_interval():
    one = np.zeros(5, dtype=np.int32)
    assert shrink_interval(np.ones(5), np.ones(5), one, one) == (0.0, 0.0)


@pytest.mark.parametrize("registered", [False, True])
@pytest.mark.parametrize("beside", [(), ("link_bending",)])
def test_rows_left_out_are_missed_as_by_a_fit_without_them(
    registered, beside, world, tmp_path, kinematics, cell
):
    data, measured, *_ = world.make(72, {"joint_compliance": 2e-4}, n=120, noise=NOISE)
    path = tmp_path / "rows.csv"
    path.write_text(world.csv(data, measured))
    problem = pose_problem(read_measurements(path), kinematics, cell, None, registered)
    everything = np.ones(len(problem), dtype=bool)
    regression = Regression(
        problem.samples,
        problem.gap,
        np.full(len(problem), 1.0 / NOISE),
        problem.split.fold,
        problem.blocks(everything),
        problem.always,
    )
    standing = {"joint_compliance": Standing.ADOPTED} | dict.fromkeys(beside, Standing.RESEMBLED)
    choice = Choice(standing, dict.fromkeys(standing, Evidence(1.0, 1.0)), {}, {})
    label = (np.arange(len(problem)) % 6).astype(np.int32)
    whole = Named.of(problem, regression, choice, NOISE, everything)
    told = whole.missed(label)
    fitted = np.linalg.norm(problem.measured - whole.fit.point, axis=1)
    for k in range(6):
        here = label == k
        again = Named.of(problem, regression, choice, NOISE, ~here).fit
        missed = np.linalg.norm(problem.measured - again.point, axis=1)
        error, change = (np.max(np.abs(v - missed)[here]) for v in (told, fitted))
        assert error < 0.05 * change


def test_the_jackknife_of_a_mean_is_its_standard_error(samples):
    """With one number for each joint and rows in folds of one, the closed form of a mean holds."""
    block = block_of(BACKLASH, samples, {})
    y = np.random.default_rng(2).normal(0.0, NOISE, (len(samples), 3))
    fold = (np.arange(len(samples)) % 12).astype(np.int32)
    weight = np.full(len(samples), 1.0 / NOISE)
    regression = Regression(samples, y, weight, fold, (block,), ())
    result = fit(samples, samples.point + y, weight, {}, {"backlash": Free({})})
    found = deviations(regression, result, ("backlash",), ())["backlash"]
    own = result.deviation("backlash")
    assert np.all(found >= own)
    assert np.median(found / own) < 1.6


def test_an_effect_that_is_not_named_widens_the_interval(samples):
    named, beside = (block_of(dict(EFFECTS)[n], samples, {}) for n in ("joint_offset", "backlash"))
    rng = np.random.default_rng(3)
    y = beside.X @ (3.0 * np.ones(6)) + rng.normal(0.0, NOISE, (len(samples), 3))
    weight = np.full(len(samples), 1.0 / NOISE)
    fold = (np.arange(len(samples)) % 6).astype(np.int32)
    regression = Regression(samples, y, weight, fold, (named, beside), ())
    result = fit(samples, samples.point + y, weight, {}, {"joint_offset": Free({})})
    alone = deviations(regression, result, ("joint_offset",), ())["joint_offset"]
    with_it = deviations(regression, result, ("joint_offset",), ("backlash",))["joint_offset"]
    numbers = result.theta
    assert np.all(with_it >= alone)
    assert np.max(np.abs(numbers) / with_it) < 3.0


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
