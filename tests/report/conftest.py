import base64
import gzip
import importlib.util
import json
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
PANEL = ROOT / "fixtures" / "drilling_panel"


def tool(name):
    """Return a module of the tools folder."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def browser():
    drive = tool("browser")
    command = drive.installed()
    if command is None:
        pytest.skip("no Chromium is installed")
    started = drive.Browser(command)
    yield started
    started.close()


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
    text = (PANEL / "cell.toml").read_text()
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
