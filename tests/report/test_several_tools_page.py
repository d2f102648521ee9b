"""Pages of jobs with several tools and setups: each tag is shown with its own."""

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.kinematics import build
from tests import wing
from tests.report.conftest import data_of

READY = "window.ppPage && ppPage.state().ready"
FIRST, LAST = 1, 28
"""Tags of a hole of the first tool in the first setup, and of the last in the last."""


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    """A folder with the pages of a wing panel's program, its verification and its cell."""
    from postproc.cli import app

    folder = tmp_path_factory.mktemp("wing")
    cell, cam = folder / "cell.toml", folder / "wing.cls"
    cell.write_text(wing.cell_text("[optimize]\nstep_deg = 30\n"))
    cam.write_text(wing.apt_text(3))
    page = {name: str(folder / f"{name}.html") for name in ("program", "verify", "cell")}
    common = ["--cell", str(cell), "-q"]
    calls = (
        ["convert", str(cam), *common, "-o", str(folder), "--report", page["program"]],
        [
            *("verify", str(folder / "wing.src"), *common, "--against", str(cam)),
            *("--report", page["verify"]),
        ],
        ["check", str(cell), "-q", "--report", page["cell"]],
    )
    for call in calls:
        assert app.run(call) == 0, call
    return folder


def text(browser, selector):
    return browser.run(f"document.querySelector('{selector}').textContent")


@pytest.mark.parametrize("name", ["program", "verify"])
def test_each_row_is_drawn_in_its_own_base(job, name):
    """The tip by forward kinematics lies at the drawn place of what the move serves."""
    cell = load_cell(job / "cell.toml")
    data = data_of((job / f"{name}.html").read_bytes())
    frames = np.array(data["frames"])[data["frame"]]
    assert {tuple(pair) for pair in frames.tolist()} == {(t, b) for t in range(3) for b in (0, 1)}
    T = build(cell.robot).fk(np.asarray(data["q"], dtype=np.float64))
    tip = (T @ cell.tcp_of(frames[:, 0]))[:, :3, 3]
    drawn = data["positions"] @ cell.T_robroot_base[:3, :3].T + cell.T_robroot_base[:3, 3]
    np.testing.assert_allclose(tip, drawn, atol=2e-5)


def test_a_tag_shows_its_tool_and_what_stands_there(browser, job):
    browser.open(job / "program.html", READY)
    cell = load_cell(job / "cell.toml")
    for tag, words, tool, base in (
        (FIRST, "tool 7 drill, base 3", 0, 0),
        (LAST, "tool 9 ream, base 4", 2, 1),
    ):
        browser.run(f"ppPage.select({tag})")
        assert words in text(browser, "#which")
        shown = browser.run("ppPage.state()")
        assert shown["solids"].count("tool cutter") == 1
        assert shown["solids"].count("tool") == 1
        T = build(cell.robot).fk(np.array(shown["angles"])) @ cell.tools[tool].T_flange_tcp
        in_base = np.linalg.inv(cell.bases[base].T_robroot_base) @ T
        off = np.array(in_base[:2, 3]) / 0.015
        np.testing.assert_allclose(off, np.round(off), atol=0.01, err_msg="above a hole")
    assert browser.problems == []


def test_tags_have_columns_of_tool_and_base(job):
    data = data_of((job / "program.html").read_bytes())
    values = {column["key"]: column["values"] for column in data["columns"]}
    assert set(values["tool"].tolist()) == {7.0, 8.0, 9.0}
    assert set(values["base"].tolist()) == {3.0, 4.0}
    assert (values["tool"][LAST], values["base"][LAST]) == (9.0, 4.0)


def test_the_page_of_a_cell_draws_the_tool_that_is_chosen(browser, job):
    browser.open(job / "cell.html", READY)
    assert browser.run("[...document.querySelectorAll('#tool option')].map(o => o.text)") == [
        "7 drill",
        "8 csink",
        "9 ream",
    ]
    data = data_of((job / "cell.html").read_bytes())
    cutters = [body["vertices"] for body in data["bodies"] if body["kind"] == "cutting"]
    lengths = [float(np.ptp(vertices, axis=0).max()) for vertices in cutters]
    np.testing.assert_allclose(lengths, np.array(list(wing.LENGTHS.values())) / 1e3, atol=1e-5)
    for place in range(3):
        browser.run(
            f"(() => {{ const e = document.querySelector('#tool'); e.value = '{place}';"
            " e.dispatchEvent(new Event('change')); })()"
        )
        assert browser.run("ppPage.state()")["solids"].count("tool cutter") == 1
    facts = text(browser, "body")
    for name in ("tool 7", "tool 8", "tool 9", "workpiece 3", "workpiece 4"):
        assert f"{name} xyz mm" in facts
    assert browser.problems == []


def test_the_page_of_a_job_with_a_missing_tool_says_so(browser, job, tmp_path):
    from postproc.cli import app

    cell = tmp_path / "cell.toml"
    cell.write_text(wing.cell_text(tools=wing.TOOLS[:2]))
    page = tmp_path / "page.html"
    call = ["convert", str(job / "wing.cls"), "--cell", str(cell), "-q", "-o", str(tmp_path / "o")]
    assert app.run([*call, "--report", str(page)]) == 1
    browser.open(page, READY)
    assert "no tool, base 3" in text(browser, "#which")
    assert "is no tool of" in text(browser, "#which")
    assert browser.problems == []
