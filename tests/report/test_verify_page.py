import numpy as np
import pytest

from tests.report.conftest import data_of

READY = "window.ppPage && ppPage.state().ready"


@pytest.fixture(scope="module")
def spoiled(holes, tmp_path_factory):
    """The program with one drilling motion 3 mm off, verified."""
    from postproc.cli import app

    folder = tmp_path_factory.mktemp("spoiled")
    lines = (holes / "holes.src").read_text().splitlines()
    at = [i for i, text in enumerate(lines) if text.startswith("LIN {X ")][4]
    value = lines[at].split("{X ")[1].split(",")[0]
    lines[at] = lines[at].replace(value, f"{float(value) + 3.0:.4f}", 1)
    (folder / "holes.src").write_text("\n".join(lines) + "\n")
    (folder / "holes.dat").write_bytes((holes / "holes.dat").read_bytes())
    code = app.run(
        [
            *("verify", str(folder / "holes.src"), "--cell", str(holes / "cell.toml"), "-q"),
            *("--against", str(holes / "holes.csv"), "--report", str(folder / "verify.html")),
        ]
    )
    assert code == 1
    return folder / "verify.html", at + 1


def test_a_good_program(browser, holes):
    browser.open(holes / "verify.html", READY)
    data = data_of((holes / "verify.html").read_bytes())
    assert browser.run("document.querySelector('p.lead').textContent").startswith(
        "The program is good"
    )
    browser.click("#tags tr[data-tag='6']")
    shown = browser.run("ppPage.state()")
    np.testing.assert_allclose(shown["angles"], data["q"][6], atol=1e-6)
    assert shown["line"] == data["krl_line"][6]
    assert browser.problems == []
    assert browser.requests == [(holes / "verify.html").as_uri()]


def test_a_violation_is_what_the_page_opens_on(browser, spoiled):
    path, line = spoiled
    browser.open(path, READY)
    data = data_of(path.read_bytes())
    assert data["failing"]
    lines = {int(data["krl_line"][int(row)]) for row in data["failing"]}
    assert any(abs(found - line) <= 8 for found in lines)
    assert browser.run("ppPage.state()")["shown"] == min(int(row) for row in data["failing"])
    browser.click("#findings [data-goto]")
    assert browser.run("document.querySelector('#which').className") == "bad"
