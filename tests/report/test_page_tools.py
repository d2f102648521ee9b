"""Findings, list and charts of a page answer: filters, search, pointer, zoom; a dark scheme."""

from postproc.cli import app
from postproc.report.pages.batch import batch_page
from tests.places import PANEL
from tests.report.conftest import panel_cell

READY = "window.ppPage && ppPage.state().ready"


def choose(page, selector, value, event="input"):
    page.run(
        f"(() => {{ const e = document.querySelector('{selector}'); e.value = '{value}';"
        f" e.dispatchEvent(new Event('{event}')); }})()"
    )


def press(page, key):
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=key)


def test_the_list_is_searched_and_filtered(browser, holes):
    browser.open(holes / "program.html", READY)
    names = browser.run(
        "[...document.querySelectorAll('#tags tbody tr')].map(r => r.cells[0].textContent)"
    )
    choose(browser, "#search", names[5].lower())
    assert browser.run("ppPage.state().rows") == 1
    choose(browser, "#search", "")
    counts = []
    for state in "012":
        choose(browser, "#state", state, "change")
        counts.append(browser.run("ppPage.state().rows"))
    assert sum(counts) == browser.run("ppPage.state().tags")
    choose(browser, "#state", "", "change")
    browser.run("(document.querySelector('#list').focus(), ppPage.select(3), 1)")
    press(browser, "ArrowDown")
    assert browser.run("ppPage.state().shown") == 4
    assert browser.run("document.querySelector('header p.lead').className") == "lead good"
    lead = browser.run("document.querySelector('header').textContent")
    assert f"{counts[0]} good, {counts[1]} acceptable, {counts[2]} critical" in lead
    assert "Good: 24 tags" in lead
    assert "Smallest" in lead


def test_findings_are_filtered_and_lead_to_their_tags(browser, blocked):
    browser.open(blocked / "program.html", READY)
    shown = (
        "[...document.querySelectorAll('#findings .finding')].filter(e => e.offsetParent).length"
    )
    before = browser.run(shown)
    assert before > 0
    browser.click("#findings .finding.error[data-goto]")
    first = browser.run("+document.querySelector('#findings .finding.error').dataset.goto")
    assert browser.run("ppPage.state().shown") == first
    browser.click("#findings input[name=error]")
    assert browser.run(shown) < before
    assert "No program" in browser.run("document.querySelector('header').textContent")


def test_charts_answer_the_pointer(browser, holes):
    browser.open(holes / "program.html", READY)
    browser.run("(document.querySelector('#angles').scrollIntoView({block: 'center'}), 1)")
    x, y, width = browser.run(
        "(() => { const b = document.querySelector('#angles svg').getBoundingClientRect();"
        " return [b.x, b.y + b.height / 2, b.width]; })()"
    )
    browser.mouse(("mouseMoved", x + width / 2, y))
    browser.wait("document.querySelector('#angles .tip').textContent.includes('A6')")
    ticks = (
        "[...document.querySelectorAll('#angles text:not(.tip)')].map(e => e.textContent).join()"
    )
    before = browser.run(ticks)
    wheel = {"x": x + width / 2, "y": y, "deltaX": 0, "deltaY": -200, "modifiers": 2}
    browser.call("Input.dispatchMouseEvent", type="mouseWheel", **wheel)
    browser.wait(f"{ticks} !== {before!r}")
    browser.run(
        "document.querySelector('#angles svg').dispatchEvent(new MouseEvent('dblclick')) || 1"
    )
    assert browser.run(ticks) == before
    steps = [("mouseMoved", x + width * (0.4 + 0.05 * k), y) for k in range(5)]
    browser.mouse(("mousePressed", x + width * 0.4, y), *steps, ("mouseReleased", *steps[-1][1:]))
    assert browser.run(ticks) != before
    browser.run("(document.querySelector('#angles svg').focus(), 1)")
    press(browser, "0")
    assert browser.run(ticks) == before
    browser.run("(document.querySelector('#angles a.export').click(), 1)")
    link = browser.run("document.querySelector('#angles a.export').href")
    text = browser.run(f"fetch({link!r}).then((answer) => answer.text())")
    assert text.splitlines()[0] == 'line,"time [s]",value'
    assert len(text.splitlines()) == 1 + 6 * browser.run("ppPage.state().moves")
    assert browser.problems == []


def test_the_whole_robot_and_its_tool_are_in_the_first_view(browser, holes):
    """Nothing that is drawn touches the edge of the picture; the ground is a plain colour."""
    browser.open(holes / "program.html", READY)
    edge = browser.run(
        "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {"
        " const c = document.querySelector('#scene canvas');"
        " const d = new OffscreenCanvas(c.width, c.height).getContext('2d'); d.drawImage(c, 0, 0);"
        " const is = (x, y) => { const p = d.getImageData(x, y, 1, 1).data;"
        "   return p[0] > p[2] + 60; };"  # the orange of the arm
        " let hits = 0, inside = 0; for (let x = 0; x < c.width; x += 3)"
        " { hits += is(x, 1) + is(x, c.height - 2); inside += is(x, c.height / 2 | 0); }"
        " for (let y = 0; y < c.height; y += 3) hits += is(1, y) + is(c.width - 2, y);"
        " done([hits, inside]); })))"
    )
    assert edge[0] == 0
    assert edge[1] > 0


def test_a_dark_scheme_is_readable(browser, holes):
    feature = [{"name": "prefers-color-scheme", "value": "dark"}]
    browser.call("Emulation.setEmulatedMedia", features=feature)
    try:
        browser.open(holes / "program.html", READY)
        ink, paper = browser.run(
            "['color', 'backgroundColor'].map(k =>"
            " getComputedStyle(document.querySelector(k === 'color' ? 'h2' : 'section'))[k])"
        )
        light = [sum(map(int, c[4:-1].split(","))) / 3 for c in (ink, paper)]
        assert light[0] - light[1] > 120
        corner = browser.run(
            "(() => { const c = document.querySelector('#scene canvas');"
            " const d = new OffscreenCanvas(c.width, c.height).getContext('2d');"
            " d.drawImage(c, 0, 0); return [...d.getImageData(2, 2, 1, 1).data]; })()"
        )
        assert sum(corner[:3]) / 3 < 80
    finally:
        browser.call("Emulation.setEmulatedMedia", features=[])


def test_what_an_arm_misses_is_drawn_and_a_rail_under_it(browser, tmp_path):
    """The words beside the line say the distance from the tool's point to the tag."""
    far = panel_cell(replacing=[("xyz_mm = [2050,", "xyz_mm = [3300,")])
    rail = '[[external_axes]]\nname = "E1"\nkind = "rail"\naxis = "+x"\nrange_mm = [-10, 10]\n'
    rail += "speed_mm_s = 500\n"
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (tmp_path / "hole.csv").write_text("\n".join([lines[0], lines[80]]) + "\n")
    cell, page = str(tmp_path / "cell.toml"), tmp_path / "page.html"
    call = ["convert", str(tmp_path / "hole.csv"), "--cell", cell, "-q", "-o", str(tmp_path / "o")]
    missing = []
    for extra in ("", rail):
        (tmp_path / "cell.toml").write_text(f"{far}\n{extra}")
        assert app.run([*call, "--report", str(page)]) == 1
        browser.open(page, READY)
        words = browser.run("document.querySelector('.gap').textContent")
        state = browser.run("ppPage.state()")
        tag = browser.run("ppPage.scene.inWorld(ppPage.data.point(0))")
        off = sum((a - b) ** 2 for a, b in zip(state["toolTip"], tag, strict=True)) ** 0.5 * 1e3
        assert words == f"{off:.0f} mm missing"
        missing.append(off)
    # the rail stands where it takes the arm nearest to the tag, and is drawn there
    assert missing[0] - 10.5 < missing[1] < missing[0] - 5.0
    assert app.run(["check", cell, "-q", "--report", str(page)]) == 0
    browser.open(page, READY)
    assert "rail E1" in browser.run("ppPage.state().solids")
    slide = "(e => { e.value = 10; e.dispatchEvent(new Event('input')); })"
    browser.run(f"{slide}(document.querySelector('#axis7')) || 1")
    browser.call("Page.reload")
    browser.wait("window.ppPage && ppPage.state().values[6] > 0.0099")


def test_a_batch_leads_with_what_failed():
    entries = {
        "a.csv": {"status": "ok", "program": "A", "tags": 3, "cycle_time_s": 12.34, "errors": []},
        "<b>.csv": {"status": "failed", "errors": [f"b.csv:{k}: error X: no" for k in range(5)]},
    }
    text = batch_page({"entries": entries}, {"a.csv": "a%20b.html"}).decode()
    assert '<a href="a%20b.html">a.csv</a>' in text
    assert "1 of 2 inputs have a program that passed every check, 1 failed." in text
    assert "&lt;b&gt;.csv" in text
    assert "and 2 more" in text
    assert text.index("Failed") < text.index("Programs")
    assert "12.3" in text
