"""Ten thousand tags: the page stays within 8 MB, opens and answers."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.emitters.kuka.emitter import emit, render_files
from postproc.jobs.convert import ConvertRequest, make_plan, read_toolpath
from postproc.report.pages.program import program_page
from postproc.report.parts.program_text import program_text
from tests.places import PANEL, PANEL_CELL

COPIES = 100
PER_MOVE = (
    *("kind", "role", "T_base_tcp", "aux", "q", "spin", "branch", "speed", "ptp_fraction"),
    *("blend", "dwell", "duration", "external"),
)


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
    big = replace(
        plan,
        name="many",
        toolpath=many,
        tag=np.concatenate([plan.tag + k * n for k in range(COPIES)]),
        events=(),
        **{name: np.concatenate([getattr(plan, name)] * COPIES) for name in PER_MOVE},
        **{
            name: np.tile(getattr(plan, name), COPIES)
            for name in ("stiffness", "stiffness_initial")
        },
        clearance=np.full(n * COPIES, 0.01),
    )
    modules = emit(big, cell)
    text = program_text(render_files(modules), modules[0].name, cell)
    assert len(text) == len(big)
    path = folder / "many.html"
    path.write_bytes(program_page(big, cell, (), text))
    return path


def test_ten_thousand_tags_fit_in_8_megabytes(page):
    assert page.stat().st_size <= 8_000_000


def test_they_are_shown_fluently(browser, page):
    browser.open(page, "window.ppPage && ppPage.state().ready")
    assert browser.run("ppPage.state().tags") == 10_000
    assert browser.run("document.querySelectorAll('#tags tr').length") < 120
    seconds = browser.run(
        "(() => { const t = performance.now(); for (let i = 0; i < 100; i++) ppPage.seek(i * 97);"
        " return (performance.now() - t) / 1e5; })()"
    )
    assert seconds < 0.03
    browser.click("#tags th:nth-child(4)")
    browser.run("ppPage.select(7777)")
    assert browser.run("document.querySelector('#tags tr.selected').dataset.tag") == "7777"
    paths = browser.run(
        "[...document.querySelectorAll('#angles path')].map(p => p.getAttribute('d').length)"
    )
    assert max(paths) < 40_000
