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


_ITEM: list[pytest.Item] = []
"""The test that runs."""


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Note which test runs, before any of its fixtures."""
    _ITEM[:] = [item]


@pytest.fixture(autouse=True, scope="session")
def _causes_where_they_are_read():
    """Let the command look for the causes of failing tags only for tests marked ``causes``.

    The search converts the job again with every change that may cure it.
    """
    from postproc.jobs import convert

    search = convert.causes

    def asked(*arguments):
        return search(*arguments) if _ITEM[0].get_closest_marker("causes") else ()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(convert, "causes", asked)
        yield


@pytest.fixture
def batch_here(monkeypatch):
    """Let batches run their jobs in this process, where what they make is the subject."""
    from postproc.batch import run
    from postproc.batch.child import run_job

    monkeypatch.setattr(run, "run_local", lambda jobs, *_: map(run_job, jobs))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that accepts changed golden programs."""
    parser.addoption(
        "--update-golden",
        action="store_true",
        help="write the programs of tests/golden anew and tell what changed",
    )


@pytest.fixture(scope="session")
def emitted(tmp_path_factory):
    """Cell, toolpath and program files of the demo part, by style of the program."""
    # not before the variables above are set
    from postproc.emitters.kuka.emitter import emit, render_files
    from postproc.planning.planner import plan
    from tests.samples import apt_in, cell_in

    known = {}

    def make(motion="dense", points="inline", kss="8.6", per_file=1000):
        key = motion, points, kss, per_file
        if key not in known:
            folder = tmp_path_factory.mktemp("emitted")
            table = (
                f'[krl]\nmotion = "{motion}"\npoints = "{points}"\nkss = "{kss}"\n'
                f"max_points_per_file = {per_file}\n"
            )
            cell, toolpath = cell_in(folder, table), apt_in(folder)
            known[key] = cell, toolpath, render_files(emit(plan(toolpath, cell), cell))
        return known[key]

    return make
