import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cli import app
from postproc.kinematics import build
from postproc.report.parts.headline import headline
from tests.places import PANEL_CELL
from tests.report.conftest import data_of
from tools.dev.hidden_twin import Twin

READY = "window.ppPage && ppPage.state().ready"
PAGES = ("report.html", "identify.html", "plan/sample.html")


@pytest.mark.slow
@pytest.mark.parametrize("name", [*PAGES, "stiffness.html", "cell.html"])
def test_every_page_opens_alone_and_without_an_error(browser, measured, name):
    path = measured / name
    if not path.exists():
        path = next((measured / "plan").glob("*.html"))
    browser.open(path)
    browser.run("new Promise(done => setTimeout(done, 200))")
    assert browser.problems == []
    assert browser.requests == [path.as_uri()]
    assert browser.run("document.querySelector('p.lead').textContent.length") > 10
    assert browser.print_pages().startswith(b"%PDF")


def test_the_diagnosis_leads_with_one_sentence_and_rows_move_the_robot(browser, measured):
    browser.open(measured / "report.html", READY)
    lead = browser.run("[...document.querySelectorAll('header p')].map(p => p.textContent)")
    assert len(lead) == 1
    assert "the joints give way under the load on the tool" in lead[0]
    data = data_of((measured / "report.html").read_bytes())
    rows = data["rows"]
    browser.click("#tags tr[data-tag='3']")
    state = browser.run("ppPage.state()")
    np.testing.assert_allclose(state["angles"], rows["q"][3], atol=1e-6)
    gap = next(c["values"] for c in rows["columns"] if c["key"] == "gap")
    browser.click("#tags th:nth-child(2)")
    assert browser.run("ppPage.state()")["first"] == int(np.argmin(gap))
    # the gap that is shown is what the made-up robot does, not what the product says of it
    twin = Twin()
    nominal = twin.point(rows["q"].astype(float))
    np.testing.assert_allclose(
        gap, np.linalg.norm(rows["points"] - nominal, axis=1) * 1e3, atol=2e-3
    )


def test_the_plan_shows_its_postures(browser, measured):
    path = next((measured / "plan").glob("*.html"))
    browser.open(path, READY)
    rows = data_of(path.read_bytes())["rows"]
    cell = load_cell(PANEL_CELL)
    last = len(rows["names"]) - 1
    browser.run(f"ppPage.select({last})")
    state = browser.run("ppPage.state()")
    np.testing.assert_allclose(
        state["tip"], build(cell.robot).link_frames(rows["q"][last].astype(float))[6][:3, 3],
        atol=1e-5,
    )  # fmt: skip
    tool = build(cell.robot).fk(rows["q"].astype(float)) @ cell.tool.T_flange_tcp
    np.testing.assert_allclose(tool[:, :3, 3], rows["points"], atol=1e-5)


def test_tables_sort(browser, measured):
    browser.open(measured / "report.html", READY)
    table = (
        "[...document.querySelectorAll('table.data')].find("
        "t => [...t.rows].filter(r => isFinite(parseFloat(r.cells[2]?.textContent))).length > 3)"
    )
    browser.run(f"{table}.querySelector('th:nth-child(3)').click()")
    cells = f"[...{table}.tBodies[0].rows].map(r => r.cells[2])"
    shown = browser.run(f"{cells}.map(cell => parseFloat(cell.textContent))")
    numbers = [value for value in shown if isinstance(value, int | float)]
    assert len(numbers) > 3
    assert numbers == sorted(numbers)


def test_the_cell_can_be_moved_by_its_axes(browser, measured):
    browser.open(measured / "cell.html", READY)
    before = browser.run("ppPage.state()")
    browser.run(
        "(() => { const e = document.querySelector('#axis1'); e.value = 30;"
        " e.dispatchEvent(new Event('input')); })()"
    )
    after = browser.run("ppPage.state()")
    assert np.degrees(after["angles"][0]) == pytest.approx(30.0, abs=0.01)
    assert after["tip"] != before["tip"]
    cell = load_cell(PANEL_CELL)
    T = build(cell.robot).link_frames(np.array(after["angles"]))[6]
    np.testing.assert_allclose(after["tip"], T[:3, 3], atol=1e-6)


@pytest.fixture(scope="module")
def moved(holes, tmp_path_factory):
    """The program with every drilling point moved by 0.3 mm along X."""
    folder = tmp_path_factory.mktemp("moved")
    lines = (holes / "holes.src").read_text().splitlines()
    for i, text in enumerate(lines):
        if text.startswith("LIN {X "):
            value = text.split("{X ")[1].split(",")[0]
            lines[i] = text.replace(value, f"{float(value) + 0.3:.4f}", 1)
    (folder / "holes.src").write_text("\n".join(lines) + "\n")
    (folder / "holes.dat").write_bytes((holes / "holes.dat").read_bytes())
    page = folder / "diff.html"
    call = ["diff", str(holes / "holes.src"), str(folder / "holes.src"), "-q", "--html", str(page)]
    assert app.run(call) == 1
    return page


def test_moved_points_are_drawn(browser, moved):
    browser.open(moved, READY)
    assert browser.problems == []
    assert browser.requests == [moved.as_uri()]
    rows = data_of(moved.read_bytes())["rows"]
    np.testing.assert_allclose(rows["vectors"], np.tile([3e-4, 0, 0], (len(rows["names"]), 1)),
                               atol=1e-7)  # fmt: skip
    assert browser.run("ppPage.state().rows") == len(rows["names"])
    browser.click("#tags tr[data-tag='2']")
    assert browser.run("ppPage.state().shown") == 2


def test_same_programs_have_a_page_too(browser, holes, tmp_path):
    page, text = tmp_path / "same.html", str(holes / "holes.src")
    assert app.run(["diff", text, text, "-q", "--html", str(page)]) == 0
    browser.open(page)
    assert browser.run("document.querySelector('p.lead').textContent").startswith("Same")
    assert browser.problems == []


def _content(verdict, adopted, joints=(0.7, 0.3), low=0.8):
    effects = [
        {"name": name, "title": title, "adopted": True, "confounded_with": twins}
        for name, title, twins in adopted
    ]
    return {
        "verdict": verdict,
        "gap": {"rms_mm": 0.31},
        "shrinkage": {"value": 0.87, "ci": [low, 0.9], "rms_after_mm": 0.04},
        "effects": effects,
        "residual": {"depends_on": []},
        "where": {"joints": [{"joint": j + 2, "share": s} for j, s in enumerate(joints)]},
    }


def test_headlines():
    one = [("joint_compliance", "the joints give way", [])]
    assert headline(_content("explained", one)) == (
        "Most of the 0.31 mm gap, 87 %, has one cause: the joints give way, mostly at joint 2; "
        "adding it to the model leaves 0.040 mm."
    )
    two = [*one, ("tool_frame", "the tool frame is off", ["joint_offset"])]
    text = headline(_content("explained", two, (0.5, 0.4)))
    assert "has 2 causes: the joints give way; then tool frame, mostly at joints 2 and 3" in text
    assert text.endswith("These rows cannot tell tool_frame from joint_offset.")
    assert "unexplained" in headline(_content("unexplained", one))
    assert headline(_content("explained", one, low=-0.7)).startswith("Perhaps part of the 0.31")
    assert headline(_content("unexplained", [])).startswith("Unexplained")
    assert headline(_content("no_gap", [])).startswith("No gap")
