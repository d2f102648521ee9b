"""Few rows and large gaps, candidates that are found late, readings of something else."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.fit.problem import pose_problem
from postproc.measurement.file import read_measurements

NOISE = 2e-5
MANY = {
    "joint_compliance": 3e-3,
    "payload_error": 4e-4,
    "gear_coupling": 3e-4,
    "base_frame": 8e-4,
    "tool_frame": 5e-4,
}
"""More causes than forty rows let stand side by side."""


@pytest.fixture
def problem(world, kinematics, cell, tmp_path):
    """A table ready for diagnosis."""

    def make(data, measured, leave_out=(), register=False):
        path = tmp_path / "rows.csv"
        path.write_text(world.csv(data, measured, leave_out))
        return pose_problem(read_measurements(path), kinematics, cell, None, register)

    return make


@pytest.fixture
def told(problem):
    """Diagnose a table."""
    return lambda *table, **options: diagnose(problem(*table, **options))


@pytest.mark.parametrize("seed", [3, 8])
def test_a_large_give_is_named_in_a_small_campaign(world, told, seed):
    data, measured, *_ = world.make(seed, MANY, n=40, noise=NOISE, repeats=10)
    found = told(data, measured)
    assert "joint_compliance" in found.adopted
    before, after = found.total[:2]
    assert after < 0.5 * before


@pytest.mark.parametrize("seed", [3, 4])
def test_waves_that_are_found_late_are_neither_noise_nor_wander(world, told, seed):
    """Three gears with an overtone each, in few rows that nobody noted the time of."""
    rng = np.random.default_rng(seed)
    noise, data = 3.0 * NOISE, world.make(seed, {}, n=86, noise=0.0, repeats=16)[0]
    data["wrench"][:] = 0.0
    truth, phase = world.Truth(), rng.uniform(0.0, 6.28, (3, 2))

    def law(d, now):
        out = np.zeros_like(d["q"])
        for j, (n, size) in enumerate(((8, 5e-4), (17, 3e-4), (3, 5e-4))):
            for k in (1, 2):
                out[:, j] += size / k * np.sin(k * n * now["actual"][:, j] + phase[j, k - 1])
        return out

    truth.joint.append(law)
    measured = world.solve(truth, data) + rng.normal(0, noise, (86, 3))
    found = told(data, measured, ("time", "wrench"))
    assert found.adopted == ("transmission_error",)
    assert found.noise < 1.5 * noise
    assert found.total[1] < 3.0 * noise


@pytest.mark.parametrize(("n", "faults"), [(14, 1), (26, 3)])
@pytest.mark.parametrize("register", [False, True])
def test_readings_of_something_else_move_nothing(world, told, n, faults, register):
    data, measured, *_ = world.make(61, {}, n=n, noise=NOISE, repeats=6)
    clean = told(data, measured, register=register)
    again = np.unique(data["q"], axis=0, return_inverse=True, return_counts=True)
    once = np.flatnonzero(again[2][again[1].ravel()] == 1)
    rows = np.random.default_rng(n).choice(once, faults, replace=False)
    measured[rows] = np.array([[0.3, -1.1, 2.0], [4.0, 0.2, 0.1], [-1.0, 2.5, 0.4]])[:faults]
    found = told(data, measured, register=register)
    assert set(np.flatnonzero(found.outlier)) >= set(rows)
    assert found.verdict == clean.verdict
    assert found.noise == pytest.approx(clean.noise, rel=0.5)
