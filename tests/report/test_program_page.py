import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.kinematics import build
from postproc.krl.text.parse import parse_module
from postproc.krl.text.program import Axes, Move, MoveWord
from tests.report.conftest import data_of

READY = "window.ppPage && ppPage.state().ready"


@pytest.fixture
def page(browser, holes):
    browser.open(holes / "program.html", READY)
    return browser


@pytest.fixture(scope="module")
def data(holes):
    return data_of((holes / "program.html").read_bytes())


def state(page):
    return page.run("ppPage.state()")


def row_of_column(data, key):
    return next(c["values"] for c in data["columns"] if c["key"] == key)


def test_opens_without_a_request_and_without_an_error(page, holes):
    page.run("new Promise(done => setTimeout(done, 200))")
    assert page.requests == [(holes / "program.html").as_uri()]
    assert page.problems == []
    assert page.run("document.querySelector('#scene canvas') !== null")


def test_a_click_on_a_tag_sends_the_robot_there(page, data, holes):
    page.click("#tags tr[data-tag='7']")
    shown = state(page)
    assert shown["shown"] == 7
    move = int(data["move_of_tag"][7])
    np.testing.assert_allclose(shown["angles"], data["q"][move], atol=1e-6)
    # the robot that is drawn stands where forward kinematics says
    cell = load_cell(holes / "cell.toml")
    T = build(cell.robot).link_frames(np.asarray(shown["angles"]))[6]
    np.testing.assert_allclose(shown["tip"], T[:3, 3], atol=1e-6)
    # and the tool point lies at the hole, at the bottom of its stroke
    tip = build(cell.robot).fk(np.asarray(shown["angles"])) @ cell.tool.T_flange_tcp
    np.testing.assert_allclose(shown["toolTip"], tip[:3, 3], atol=1e-6)
    in_part = np.linalg.inv(cell.T_robroot_base) @ tip
    off = in_part[:3, 3] - data["tag_positions"][7]
    np.testing.assert_allclose(off, -0.006 * data["tag_axes"][7] - 0.0 * off, atol=2.1e-3)


def test_the_lines_of_both_texts_stand_side_by_side(page, holes):
    page.click("#tags tr[data-tag='7']")
    cam = page.run("document.querySelector('#cam .here').textContent")
    line = (holes / "holes.csv").read_text().splitlines()[8]
    assert cam == f"9  {line}"
    shown = page.run("[...document.querySelectorAll('#krl .here')].map(e => e.textContent)")
    source = (holes / "holes.src").read_text().splitlines()
    for text in shown:
        number, _, words = text.partition("  ")
        assert source[int(number) - 1] == words
        assert words.endswith("; CAM line 9: R04H07")
    assert shown


def test_the_slider_moves_the_robot_through_time(page, data):
    x, y, width = page.run(
        "(() => { const e = document.querySelector('#slider'); e.scrollIntoView();"
        " const b = e.getBoundingClientRect(); return [b.x, b.y + b.height / 2, b.width]; })()"
    )
    page.mouse(
        ("mousePressed", x + 8, y),
        ("mouseMoved", x + 0.3 * width, y),
        ("mouseMoved", x + 0.6 * width, y),
        ("mouseReleased", x + 0.6 * width, y),
    )
    shown = state(page)
    total = float(data["time"][-1])
    assert shown["clock"] == pytest.approx(0.6 * total, abs=0.03 * total)
    expected = [np.interp(shown["clock"], data["time"], data["q"][:, j]) for j in range(6)]
    np.testing.assert_allclose(shown["angles"], expected, atol=1e-5)


def test_play_runs_and_stops(page):
    page.click("#play")
    page.wait("ppPage.state().clock > 6")
    page.click("#play")
    at = state(page)["clock"]
    assert not state(page)["playing"]
    page.run("new Promise(done => setTimeout(done, 100))")
    assert state(page)["clock"] == at


@pytest.mark.parametrize("key", ["stiffness", "clearance", "margin"])
def test_the_list_sorts_by_a_column(page, data, key):
    number = 3 + [c["key"] for c in data["columns"]].index(key)
    page.click(f"#tags th:nth-child({number})")
    values = row_of_column(data, key)
    assert state(page)["first"] == int(np.argsort(values, kind="stable")[0])
    page.click(f"#tags th:nth-child({number})")
    assert values[state(page)["first"]] == values.max()
    shown = page.run(f"document.querySelector('#tags tbody td:nth-child({number})').textContent")
    assert float(shown) == pytest.approx(float(values.max()), rel=1e-3)


def test_the_colours_follow_the_choice(page):
    for key in ("feed", "clearance", "margin", "deviation", "stiffness"):
        page.run(
            f"(() => {{ const e = document.querySelector('#colour'); e.value = '{key}';"
            " e.dispatchEvent(new Event('change')); })()"
        )
        assert state(page)["colour"] == key
        assert page.run("document.querySelector('#low').textContent") != ""


def test_the_curve_over_the_turn_passes_the_chosen_stiffness(data, page):
    spins = np.asarray(data["spin_map"]["spins"])
    turn, stiffness = row_of_column(data, "spin"), row_of_column(data, "stiffness")
    for tag in (0, 7, 23):
        curve = np.array([np.nan if v is None else v for v in page.run(f"ppPage.spinCurve({tag})")])
        near = np.argmin(np.abs(spins - turn[tag]))
        if abs(spins[near] - turn[tag]) < 1e-6:
            assert curve[near] == pytest.approx(stiffness[tag], rel=1e-3)
        low, high = np.nanmin(curve[near - 1 : near + 2]), np.nanmax(curve[near - 1 : near + 2])
        assert low * 0.98 <= stiffness[tag] <= high * 1.02
    assert "chosen" in page.run("document.querySelector('#spin').textContent")


def test_the_page_says_what_the_program_says(data, holes):
    """Joints of the page against the axis values in the text; deviations are rounding alone."""
    moves = [s for s in parse_module(holes / "holes.src").main.statements if isinstance(s, Move)]
    assert len(moves) == len(data["q"])
    for row, move in enumerate(moves):
        if move.word is MoveWord.PTP and isinstance(move.target, Axes):
            np.testing.assert_allclose(np.degrees(data["q"][row]), move.target.six, atol=2e-5)
        assert data["krl_line"][row] == move.line
    assert row_of_column(data, "deviation").max() < 2e-4


def test_a_failing_page_opens_on_the_first_failing_tag_and_the_pair_that_hits(browser, blocked):
    data = data_of((blocked / "program.html").read_bytes())
    browser.open(blocked / "program.html", READY)
    shown = state(browser)
    first = min(int(tag) for tag in data["failing"])
    assert shown["shown"] == first
    pose = data["poses"][str(first)]
    assert shown["colliding"] == pose["pair"]
    assert " hits ".join(pose["pair"]) in data["failing"][str(first)]
    assert " hits ".join(pose["pair"]) in browser.run(
        "document.querySelector('#which').textContent"
    )
    np.testing.assert_allclose(shown["angles"], pose["q"], atol=1e-9)
    # the pair that is shown does collide there, by a second look at the scene
    from postproc.collision.scene import Scene

    cell = load_cell(blocked / "cell.toml")
    scene = Scene.build(cell, build(cell.robot))
    hits = scene.check(np.array([pose["q"]]), True)
    assert hits.hit[0]
    # and the point that is marked is the one where they meet: robroot stands in the world's origin
    assert shown["meeting"] == pytest.approx(pose["point"])
    meeting = scene.meeting_point(np.array(pose["q"]), scene.pairs.index(tuple(pose["pair"])))
    np.testing.assert_allclose(pose["point"], meeting, atol=1e-9)
    assert browser.problems == []


def test_failing_only(browser, blocked):
    data = data_of((blocked / "program.html").read_bytes())
    browser.open(blocked / "program.html", READY)
    browser.click("#failing")
    assert state(browser)["rows"] == len(data["failing"])
    tags = browser.run(
        "[...document.querySelectorAll('#tags tr[data-tag]')].map(r => +r.dataset.tag)"
    )
    assert sorted(tags) == sorted(int(tag) for tag in data["failing"])


def test_prints(page):
    assert page.print_pages().startswith(b"%PDF")


def test_works_without_3d(browser, holes):
    none = "HTMLCanvasElement.prototype.getContext = () => null;"
    hidden = browser.call("Page.addScriptToEvaluateOnNewDocument", source=none)
    try:
        browser.open(holes / "program.html", READY)
    finally:
        browser.call("Page.removeScriptToEvaluateOnNewDocument", **hidden)
    assert browser.run("document.querySelector('#scene').textContent").startswith(
        "This browser shows no 3D"
    )
    browser.click("#tags tr[data-tag='7']")
    assert state(browser)["shown"] == 7
    assert browser.run("document.querySelector('#krl .here') !== null")


def test_same_bytes_again(holes, tmp_path):
    from postproc.cli import app

    again = tmp_path / "again.html"
    code = app.run(
        [
            *("convert", str(holes / "holes.csv"), "--cell", str(holes / "cell.toml"), "-q"),
            *("-o", str(tmp_path), "--report", str(again)),
        ]
    )
    assert code == 0
    assert again.read_bytes() == (holes / "program.html").read_bytes()
