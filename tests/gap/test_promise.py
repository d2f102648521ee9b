"""What a plan is said to leave, against arms that are drawn, measured and fitted one by one."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap import Open
from tests.gap import synthetic
from tests.gap.conftest import samples_from

SIGMA = 3e-5
ROWS, FRESH, JOB = np.arange(40), np.arange(40, 70), np.arange(70, 90)


@pytest.fixture(scope="module")
def opened(cell, kinematics):
    data = synthetic.campaign(np.random.default_rng(3), 90)
    whole = Open.of(samples_from(cell, kinematics, data), SIGMA)
    some = np.arange(0, whole.A.shape[2], 4)  # of all effects: it is the algebra that is tested
    return Open(whole.A[:, :, some], whole.chance[some], whole.arms[:8, some], SIGMA)


def left(opened, rows, some, width):
    """Return the 3D rms [m] that the most probable numbers of readings leave, drawn anew."""
    rng = np.random.default_rng(1)
    A = (opened.A * width).reshape(len(opened.A) * 3, -1)
    part, at = (np.add.outer(3 * index, np.arange(3)).ravel() for index in (rows, some))
    u = rng.normal(size=(A.shape[1], 200))
    read = A[part] @ u + rng.normal(size=(len(part), 200))
    # noise and prior as further readings of unit weight
    more = np.vstack([A[part], np.eye(A.shape[1])])
    found = np.linalg.lstsq(more, np.vstack([read, np.zeros_like(u)]), rcond=None)[0]
    missed = (A[at] @ (u - found)).reshape(len(some), 3, -1)
    return SIGMA * np.sqrt(np.mean(np.sum(missed**2, axis=1)))


def test_the_promise_is_what_fits_of_drawn_arms_leave(opened):
    told = opened.promise(ROWS, FRESH, JOB)
    fresh = np.array([left(opened, ROWS, FRESH, width) for width in opened.arms])
    job = np.mean([left(opened, ROWS, JOB, width) for width in opened.arms])
    noisy = np.mean(np.sqrt(fresh**2 + 3.0 * SIGMA**2))
    assert told.left == pytest.approx(noisy, rel=0.05)
    assert told.job == pytest.approx(job, rel=0.07)


def test_more_rows_leave_less_and_without_a_job_nothing_is_said_of_it(opened):
    nobody = np.zeros(0, dtype=int)
    few, many = (opened.promise(ROWS[:n], FRESH, nobody) for n in (15, 40))
    assert many.left < few.left
    assert few.job is many.job is None
    assert many.words == f"leaves {1e3 * many.left:.3f} mm at fresh poses"


def test_exchanged_postures_leave_less_at_the_job_the_first_stay(opened):
    """No other exchange of one posture would leave less: brute force over all of them."""
    width = np.sqrt(opened.chance)
    rows = np.arange(70)[:, None]
    A = (opened.A * width).reshape(len(opened.A), 3, -1)

    def square(plan):
        own, at = (A[index].reshape(-1, A.shape[2]) for index in (plan, JOB))
        return np.trace(at @ np.linalg.inv(own.T @ own + np.eye(A.shape[2])) @ at.T)

    start = np.arange(12)
    plan = opened.exchanged(start, 3, rows, JOB)
    assert list(plan[:3]) == [0, 1, 2]
    assert len(set(plan.tolist())) == 12
    assert square(plan) < 0.8 * square(start)
    out = 3 + int(np.argmin([square(np.delete(plan, k)) for k in range(3, 12)]))
    others = np.setdiff1d(rows.ravel(), plan)
    tried = [square(np.append(np.delete(plan, out), other)) for other in others]
    assert min(tried) > square(plan) * (1.0 - 1e-9)
