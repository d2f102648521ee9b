"""The loop closed on real CAM files: read, plan, write, read the text back, run it, compare."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.errors import Severity
from postproc.krl.lint import lint
from postproc.krl.text.parse import parse_files
from postproc.planning.planner import plan
from postproc.readers.base import ReadOptions, read
from postproc.verification.verify import verify
from tests.places import SHARED

CORPUS = SHARED / "corpus" / "apt"
CELL = """
schema = "postproc.cell/1"
[robot]
model = "kuka_kr210_r2700_2"
[tool]
frame = { xyz_mm = [150, 0, 200], abc_deg = [0, 90, 0] }
axis = "+z"
[workpiece]
frame = { xyz_mm = [1600, -200, 700], abc_deg = [0, 0, 0] }
[motion]
feed_mm_min = 600
rapid_percent = 30
"""
FILES = [
    "az__Dem-target1.apt",
    "az__SlewMachine.apt",
    "az__Suporte-parede-side-drill.apt",
    "azhist__Interface-glue2.apt",
    "creo__bohren_1.ncl.8",
    "nx___10_KONTUR_125_N2_162.cls",
    "nx__standart_drill.clsf",
]


@pytest.mark.corpus
@pytest.mark.skipif(not CORPUS.is_dir(), reason="the corpus of real CAM files is not there")
@pytest.mark.parametrize("name", FILES)
def test_real_files_come_back_from_the_text(name, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    cell = load_cell(tmp_path / "cell.toml")
    options = ReadOptions(units="mm", tool_axis=(0.0, 0.0, 1.0), accept_words=("CUTCOM",))
    for toolpath in one_tool_each(read(str(CORPUS / name), options)):
        comes_back(toolpath, cell)


def one_tool_each(toolpath):
    """The stretches of a toolpath by their tool, as files of one tool each."""
    for index in np.unique(toolpath.tool):
        part = toolpath.rows(toolpath.tool == index)
        yield replace(part, tools=toolpath.tools[index : index + 1], tool=0 * part.tool)


def comes_back(toolpath, cell):
    modules = parse_files(render_files(emit(plan(toolpath, cell), cell)))
    assert [i for i in lint(modules) if i.severity is Severity.ERROR] == []
    report = verify(modules, modules[0].name, cell, toolpath, collisions=False)
    assert report.violations == ()
    assert report.matched == len(toolpath)
    assert report.position_error < 0.01e-3
    assert report.axis_error < 1e-4
