import base64
import gzip
import json
import re

import numpy as np
import pytest

from tests.browsers import chromium
from tests.places import FIXTURES, PANEL, PANEL_CELL
from tools.dev.make_pictures import campaign


@pytest.fixture(scope="session")
def browser():
    with chromium() as started:
        yield started


def data_of(page):
    """Return the data of a page, packed arrays and texts unpacked."""
    text = re.search(
        rb'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL
    ).group(1)
    return unpacked(json.loads(text))


def unpacked(value):
    if isinstance(value, dict) and value.get("type") == "gzip":
        return gzip.decompress(base64.b64decode(value["data"])).decode()
    if isinstance(value, dict) and set(value) == {"type", "shape", "data"}:
        array = np.frombuffer(
            base64.b64decode(value["data"]), dtype=f"<{value['type'][0]}{_SIZE[value['type']]}"
        )
        return array.reshape(value["shape"])
    if isinstance(value, dict):
        return {key: unpacked(item) for key, item in value.items()}
    if isinstance(value, list):
        return [unpacked(item) for item in value]
    return value


_SIZE = {"float32": 4, "int32": 4, "uint16": 2, "uint8": 1}


def panel_cell(extra="", replacing=()):
    """Return the text of the panel's cell with absolute mesh paths and further tables."""
    text = PANEL_CELL.read_text()
    text = text.replace('file = "', f'file = "{PANEL.as_posix()}/')
    for old, new in replacing:
        text = text.replace(old, new)
    return text + extra


@pytest.fixture(scope="session")
def holes(tmp_path_factory):
    """A folder with 24 holes of the panel, converted and verified, with both pages."""
    from postproc.cli import app

    folder = tmp_path_factory.mktemp("holes")
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (folder / "holes.csv").write_text("\n".join([lines[0], *lines[60:84]]) + "\n")
    (folder / "cell.toml").write_text(panel_cell())
    common = ["--cell", str(folder / "cell.toml"), "-q"]
    source = str(folder / "holes.csv")
    page = str(folder / "program.html")
    assert app.run(["convert", source, *common, "-o", str(folder), "--report", page]) == 0
    text, page = str(folder / "holes.src"), str(folder / "verify.html")
    assert app.run(["verify", text, *common, "--against", source, "--report", page]) == 0
    return folder


@pytest.fixture(scope="session")
def blocked(tmp_path_factory):
    """A folder with 6 holes of the panel where a post stands in the way of some."""
    from postproc.cli import app

    folder = tmp_path_factory.mktemp("blocked")
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (folder / "holes.csv").write_text("\n".join([lines[0], *lines[64:104:8]]) + "\n")
    post = '\n[[obstacles]]\nname = "post"\nbox = { size_mm = [300, 300, 2000] }\n'
    (folder / "cell.toml").write_text(panel_cell(post + "xyz_mm = [1850, 0, 1000]\n"))
    code = app.run(
        [
            *("convert", str(folder / "holes.csv"), "--cell", str(folder / "cell.toml"), "-q"),
            *("-o", str(folder / "out"), "--report", str(folder / "program.html")),
        ]
    )
    assert code == 1
    assert not (folder / "out").exists()
    return folder


@pytest.fixture(scope="session")
def measured(tmp_path_factory):
    """A folder with pages of measuring: diagnosis, plan, identification, stiffness, cell."""
    from postproc.cli import app

    folder = tmp_path_factory.mktemp("measured")
    (folder / "rows.csv").write_text(campaign(rows=120))
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (folder / "holes.csv").write_text("\n".join(lines[:5]) + "\n")
    cell = ["--cell", str(PANEL_CELL), "-q"]
    twin = ["--cell", str(FIXTURES / "drift_campaign" / "cell.toml"), "-q"]
    rows, holes = str(folder / "rows.csv"), str(folder / "holes.csv")
    page = {name: str(folder / f"{name}.html") for name in ("identify", "stiffness", "cell")}
    model = str(folder / "model.toml")
    box = [str(v) for v in (1000, -600, 1200, 1400, 600, 1800)]
    calls = (
        ["diagnose", rows, *twin, "-o", str(folder)],
        ["identify", rows, *twin, "-o", model, "--report", page["identify"]],
        ["stiffness", holes, *cell, "-o", page["stiffness"]],
        ["sample", *cell, "--box", *box, "--grid", "400", "-o", str(folder / "plan")],
        ["check", str(PANEL_CELL), "-q", "--report", page["cell"]],
    )
    for call in calls:
        assert app.run(call) in (0, 1), call
    return folder
