"""Findings, list and charts of a page answer: filters, search, pointer, zoom; a dark scheme."""

from postproc.report.pages.batch import batch_page

READY = "window.ppPage && ppPage.state().ready"


def choose(page, selector, value, event="input"):
    page.run(
        f"(() => {{ const e = document.querySelector('{selector}'); e.value = '{value}';"
        f" e.dispatchEvent(new Event('{event}')); }})()"
    )


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
    ticks = "[...document.querySelectorAll('#angles text')].map(e => e.textContent).join()"
    before = browser.run(ticks)
    wheel = {"x": x + width / 2, "y": y, "deltaX": 0, "deltaY": -200, "modifiers": 2}
    browser.call("Input.dispatchMouseEvent", type="mouseWheel", **wheel)
    browser.wait(f"{ticks} !== {before!r}")
    browser.run(
        "document.querySelector('#angles svg').dispatchEvent(new MouseEvent('dblclick')) || 1"
    )
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
    finally:
        browser.call("Emulation.setEmulatedMedia", features=[])


def test_a_batch_leads_with_what_failed():
    entries = {
        "a.csv": {"status": "ok", "program": "A", "tags": 3, "cycle_time_s": 12.34, "errors": []},
        "<b>.csv": {"status": "failed", "errors": [f"b.csv:{k}: error X: no" for k in range(5)]},
    }
    text = batch_page({"entries": entries}).decode()
    assert "1 of 2 inputs have a program that passed every check, 1 failed." in text
    assert "&lt;b&gt;.csv" in text
    assert "and 2 more" in text
    assert text.index("Failed") < text.index("Programs")
    assert "12.3" in text
