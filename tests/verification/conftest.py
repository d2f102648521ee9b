"""Programs that the product itself has made, as text, for all tests of this folder."""

import pytest

from postproc.emitters.kuka.emitter import emit, render_files
from postproc.planning.planner import plan
from tests.verification.samples import apt_in, cell_in


@pytest.fixture(scope="session")
def emitted(tmp_path_factory):
    """Cell, toolpath and program files of the demo part, by style of the program."""
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
