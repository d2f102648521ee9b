"""The site is built without a warning: every link, anchor and page of it is there."""

import json
import os
import subprocess
import sys
import tomllib

import jsonschema
import pytest

from postproc.codes import groups
from tests.places import ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("material", reason="the extra 'docs' is not installed")
    folder = tmp_path_factory.mktemp("site")
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr, done.stderr
    return folder


@pytest.mark.slow
def test_the_reference_is_whole(site):
    for group in groups():
        page = site / "reference" / "findings" / f"{group.prefix.lower()}.html"
        codes = page.read_text(encoding="utf-8")
        for entry in group.entries:
            assert f'id="{entry.code}"' in codes
    keys = (site / "reference" / "cell.html").read_text(encoding="utf-8")
    assert "singularity_deg" in keys
    names = (site / "reference" / "python.html").read_text(encoding="utf-8")
    for name in ("convert", "VerifyReport", "load_cell"):
        assert f">{name}" in names


@pytest.mark.slow
def test_the_cell_schema_takes_the_cells_of_the_examples(site):
    schema = json.loads((site / "schemas" / "cell.schema.json").read_text(encoding="utf-8"))
    check = jsonschema.Draft202012Validator(schema)
    cells = sorted((ROOT / "fixtures").glob("*/cell.toml"))
    assert cells
    for path in cells:
        cell = tomllib.loads(path.read_text(encoding="utf-8"))
        assert [error.message for error in check.iter_errors(cell)] == [], path
        assert list(check.iter_errors({**cell, "nobody": 1})), path


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere(site):
    """A cell has no internet: pages name no script, style or picture of another server."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        for mark in ('<script src="http', '<link rel="stylesheet" href="http', '<img src="http'):
            assert mark not in text, page
