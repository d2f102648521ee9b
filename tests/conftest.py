"""Set before anything loads numpy: many small matrices are slower on many threads than on one."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

# the same examples everywhere, and no verdict that depends on how busy the machine is
settings.register_profile(
    "postproc", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("postproc")

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that accepts changed golden programs."""
    parser.addoption(
        "--update-golden",
        action="store_true",
        help="write the programs of tests/golden anew and tell what changed",
    )
