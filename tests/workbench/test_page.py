"""A real browser clicks, drags and moves; the program is that of ``convert``."""

import json

import pytest

from postproc.cli import app

READY = "window.ppBench && ppBench.state().mapped && !ppBench.state().busy"


@pytest.fixture
def page(browser, running):
    running.settled()
    browser.call("Page.navigate", url=running.address[0])
    browser.wait(READY)
    browser.requests.clear()
    yield browser
    assert browser.problems == []
    own = running.address[0]
    assert [url for url in browser.requests if not url.startswith((own, "data:", "blob:"))] == []


def state(page):
    return page.run("ppBench.state()")


def replanned(page, number):
    page.wait(f"!ppBench.state().busy && ppBench.state().plan > {number}", 120)
    return state(page)


def saved_and_converted(page, folder):
    """Save the edits, run the call that the page names, and return its exit code."""
    page.run("(document.querySelector('#saved').textContent = '', 1)")
    page.click("#save")
    page.wait("document.querySelector('#saved').textContent.includes('convert')")
    call = page.run("document.querySelector('#saved').textContent").split("; ")[1].split()[1:]
    call[call.index("-o") + 1] = str(folder)
    return app.run([*call, "-q", "--json"])


def test_a_drag_pins_and_the_pins_make_the_program(page, running, tmp_path):
    before = state(page)
    x, y = page.run("ppBench.place(7, 0)")
    _, to = page.run("ppBench.place(7, 60)")
    page.mouse(("mousePressed", x, y), *(("mouseMoved", x, y + k * (to - y) / 8) for k in range(9)))
    page.wait("document.querySelector('#pose').textContent.includes(' 60 deg')")
    assert state(page)["shown"] == 7
    assert "free" in page.run("document.querySelector('#pose').textContent")
    page.mouse(("mouseReleased", x, to))
    after = replanned(page, before["plan"])
    assert list(after["pins"].values()) == [60]
    column = "ppBench.program().data.columns.find((c) => c.key === 'spin').values[7]"
    assert page.run(column) == pytest.approx(60.0)
    # selecting in one selects in all
    assert page.run("document.querySelector('#tags tr.selected').dataset.tag") == "7"
    assert page.run("document.querySelector('#cam .here').textContent").startswith("9  ")
    assert saved_and_converted(page, tmp_path) == 0
    shown = page.run("[...document.querySelectorAll('#krl .here')].map((e) => e.textContent)")
    text = (tmp_path / "holes.src").read_text().splitlines()
    assert shown
    for line in shown:
        number, _, words = line.partition("  ")
        assert text[int(number) - 1] == words
    page.click("#undo")
    assert replanned(page, after["plan"])["pins"] == {}


def test_the_part_moves_by_numbers_and_all_tags_recolour(page, running, tmp_path, capfd):
    x = "document.querySelector('input.place')"
    page.run(f"({x}.value = 4050, {x}.dispatchEvent(new Event('input')), 1)")
    page.wait("document.querySelector('#reach').textContent.includes('out of reach')")
    assert state(page)["preview"]
    assert state(page)["undo"] == 0
    page.click("#back")
    assert not state(page)["preview"]
    before = state(page)
    page.run(f"({x}.value = 2046, {x}.dispatchEvent(new Event('input')), 1)")
    page.wait("document.querySelector('#reach').textContent.includes('12 free')")
    page.click("#move")
    after = replanned(page, before["plan"])
    assert after["good"]
    assert after["things"][0]["xyz_mm"][0] == 2046
    assert saved_and_converted(page, tmp_path) == 0
    made = json.loads(capfd.readouterr().out)
    assert made["tags"] == 12
    shown = "ppBench.program().data.columns.find((c) => c.key === 'stiffness').values"
    shown = page.run(f"Array.from({shown})")
    assert sum(shown) / 12 == pytest.approx(made["stiffness"]["mean_N_per_mm"], abs=0.01)
    page.click("#undo")
    replanned(page, after["plan"])


def test_the_handle_in_the_view_moves_the_part(page):
    """A drag of its arrow moves the frame along it; undo and back put all where it was."""
    start = state(page)["things"][0]["xyz_mm"]
    (_, (x, y)) = page.run("(document.querySelector('#scene').scrollIntoView(), ppBench.grip())")
    page.mouse(("mouseMoved", x - 1, y), ("mouseMoved", x, y))
    page.wait("ppBench.held() === 'X'")
    (ox, oy), (x, y) = page.run("ppBench.grip()")
    steps = [(x + k * (x - ox) / 10, y + k * (y - oy) / 10) for k in range(9)]
    page.mouse(("mousePressed", x, y), *(("mouseMoved", *at) for at in steps))
    page.mouse(("mouseReleased", *steps[-1]))
    page.wait("ppBench.state().preview")
    moved = page.run("[...document.querySelectorAll('input.place')].map((e) => +e.value)")
    off = [a - b for a, b in zip(moved[:3], start, strict=True)]
    assert max(map(abs, off)) > 10.0
    assert state(page)["undo"] == 0
    page.click("#back")
    assert not state(page)["preview"]


def test_keys_turn_the_view(page):
    before = page.run("ppBench.program().scene.eye")
    page.run("(document.querySelector('#scene canvas').focus(), 1)")
    for key in ("ArrowLeft", "ArrowUp", "+"):
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, key=key)
    after = page.run("ppBench.program().scene.eye")
    assert before != after
    page.call("Input.dispatchKeyEvent", type="keyDown", key="0")


def test_keys_turn_and_pin(page):
    before = state(page)
    page.run("(document.querySelector('#map').focus(), 1)")
    for key in ("ArrowRight", "ArrowRight", "ArrowDown", "ArrowDown", "Enter"):
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, key=key)
    after = replanned(page, before["plan"])
    assert after["shown"] == 2
    assert len(after["pins"]) == 1
    page.click("#undo")
    replanned(page, after["plan"])
