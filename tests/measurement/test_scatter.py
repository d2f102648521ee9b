"""The scatter of readings against its law."""

import numpy as np
import pytest
from scipy.stats import chi

from postproc.measurement import robust_sigma


def test_the_median_length_of_normal_errors_gives_their_sd():
    assert robust_sigma(np.array([2e-5 * chi(3).median()])) == pytest.approx(2e-5, rel=3e-5)


def test_faults_do_not_count():
    errors = np.random.default_rng(3).normal(scale=1e-5, size=(4000, 3))
    errors[:200] += 1.0
    assert robust_sigma(np.linalg.norm(errors, axis=1)) == pytest.approx(1e-5, rel=0.08)
