"""Ten thousand tags: the page stays within 8 MB, opens and answers."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.emitters import Against, emit, emitter_of
from postproc.jobs.convert import Conversion, ConvertRequest, make_plan, read_toolpath
from postproc.jobs.pages import page_of_conversion, program_text
from postproc.model import Plan
from tests.places import PANEL, PANEL_CELL

COPIES = 100


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many")
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (folder / "one.csv").write_text("\n".join([lines[0], *lines[81:181]]) + "\n")
    names = [f"K{k}{line}" for k in range(COPIES) for line in lines[81:181]]
    (folder / "many.csv").write_text("\n".join([lines[0], *names]) + "\n")
    request = ConvertRequest(str(folder / "one.csv"), str(PANEL_CELL))
    cell = load_cell(PANEL_CELL)
    plan = make_plan(read_toolpath(request, cell), cell, request, None)
    many = read_toolpath(replace(request, source=str(folder / "many.csv")), cell)
    n = len(plan.toolpath)
    whole = Plan.concat([plan.within(many, k * n) for k in range(COPIES)])
    big = replace(whole, name="many", events=(), clearance=np.full(n * COPIES, 0.01))
    program = emit(big, cell)
    files, name = program.files, program.name
    read = emitter_of(cell).read_back(program, cell, Against())
    assert len(program_text(files, read)) == len(big)
    path = folder / "many.html"
    path.write_bytes(page_of_conversion(Conversion(cell, many, big, files, name, (), read=read)))
    return path


def test_ten_thousand_tags_fit_in_8_megabytes(page):
    assert page.stat().st_size <= 8_000_000


def test_only_those_in_sight_are_drawn(browser, page):
    browser.open(page, "window.ppPage && ppPage.state().ready")
    assert browser.run("ppPage.state().tags") == 10_000
    assert browser.run("document.querySelectorAll('#tags tr').length") < 120
    browser.click("#tags th:nth-child(4)")
    browser.run("ppPage.select(7777)")
    assert browser.run("document.querySelector('#tags tr.selected').dataset.tag") == "7777"
    paths = browser.run(
        "[...document.querySelectorAll('#angles path')].map(p => p.getAttribute('d').length)"
    )
    assert max(paths) < 40_000
