"""The spin map as files: what picture and page show, and that failing jobs have it."""

from __future__ import annotations

import base64
import contextlib
import csv
import io
import json
import re

import numpy as np
import pytest
from PIL import Image

from postproc.cli import app
from postproc.jobs.convert import ConvertRequest, convert
from postproc.planning import spin_map
from postproc.planning.checks.working import Grade
from postproc.planning.maps.spin_map import SpinClass, SpinMap
from postproc.report.pages.spin_map import spin_map_page
from postproc.report.parts.spin_map_picture import CLASS_COLOURS, columns_of, draw
from tests.places import PANEL, PANEL_CELL
from tests.report.conftest import data_of


class _Path:
    """Stands in for a toolpath of n tags."""

    def __init__(self, n):
        self.line = np.arange(n) + 2
        self._n = n

    def __len__(self):
        return self._n

    def tag_name(self, tag):
        return f"T{tag}"


class _Plan:
    name = "job"

    def __init__(self, n):
        self.toolpath = _Path(n)
        self.stiffness = np.full(n, 5e5)


def a_map(n, width=36, seed=1):
    rng = np.random.default_rng(seed)
    classes = rng.integers(0, 5, (n, width))
    stiffness = np.where(classes == 0, rng.uniform(4e5, 9e5, (n, width)), np.nan)
    spins = (np.arange(width) - width // 2) * np.deg2rad(360 / width)
    chosen = rng.choice(spins, n)
    return SpinMap(_Plan(n), spins, classes, stiffness, chosen, rng.integers(0, 4, n))


def test_columns_show_the_hardest_of_their_tags():
    whole = a_map(10_400)
    columns = columns_of(whole)
    assert len(columns) <= 1500
    assert columns.last[-1] == 10_399
    assert (columns.first[1:] == columns.last[:-1] + 1).all()
    for k in (0, 7, len(columns) - 1):
        tags = np.arange(columns.first[k], columns.last[k] + 1)
        assert (columns.classes[k] == whole.classes[tags].max(axis=0)).all()
        free = (whole.classes[tags] == SpinClass.FREE).all(axis=0)
        least = np.where(free, whole.stiffness[tags].min(axis=0), np.nan)
        assert np.array_equal(columns.stiffness[k], least, equal_nan=True)
        assert columns.low[k] == whole.chosen[tags].min()
        assert columns.grade[k] == whole.grade[tags].max()


def test_one_column_a_tag_where_they_fit():
    columns = columns_of(a_map(1500))
    assert len(columns) == 1500
    assert (columns.first == columns.last).all()


def test_cells_of_the_picture_have_the_colours_of_their_classes():
    whole = a_map(20, 12)
    picture = draw(whole)
    pixels = np.asarray(Image.open(io.BytesIO(picture.png)))
    assert pixels.shape == (picture.size[1], picture.size[0], 3)
    left, top, wide, high = picture.box
    seen = 0
    for tag in range(20):
        for s in range(12):
            # off the middle, where the chosen line runs
            x = left + int((tag + 0.15) * wide / 20)
            y = top + int((12 - s - 0.85) * high / 12)
            kind = SpinClass(int(whole.classes[tag, s]))
            if kind is SpinClass.FREE:
                continue
            wanted = CLASS_COLOURS[kind]
            seen += "#{:02x}{:02x}{:02x}".format(*pixels[y, x]) == wanted
    total = int((whole.classes != SpinClass.FREE).sum())
    assert seen >= 0.93 * total  # the line hides a few


def test_picture_of_many_tags_is_bounded():
    picture = draw(a_map(12_000))
    assert picture.size[0] < 1700
    assert len(picture.png) < 400_000


@pytest.fixture(scope="module")
def blocked_maps(tmp_path_factory):
    """Files of a job of which one post bars some holes; exit code 1."""
    folder = tmp_path_factory.mktemp("maps")
    lines = (PANEL / "panel.csv").read_text().splitlines()
    (folder / "holes.csv").write_text("\n".join([lines[0], *lines[64:104:8]]) + "\n")
    text = PANEL_CELL.read_text().replace('file = "', f'file = "{PANEL.as_posix()}/')
    post = '\n[[obstacles]]\nname = "post"\nbox = { size_mm = [300, 300, 2000] }\n'
    (folder / "cell.toml").write_text(text + post + "xyz_mm = [1850, 0, 1000]\n")
    call = ["convert", str(folder / "holes.csv"), "--cell", str(folder / "cell.toml"), "--json"]
    for kind in ("html", "png", "csv"):
        call += ["--spin-map", str(folder / f"map.{kind}")]
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert app.run([*call, "-o", str(folder / "out")]) == 1
    (folder / "said.json").write_text(said.getvalue())
    assert not (folder / "out").exists()
    return folder


def test_failing_tags_have_a_map(blocked_maps):
    with (blocked_maps / "map.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    by_tag = {}
    for row in rows:
        by_tag.setdefault(row["tag"], []).append(row)
    assert len(by_tag) == 5
    barred = [cells for cells in by_tag.values() if all(r["class"] != "free" for r in cells)]
    assert barred
    for cells in barred:
        assert {r["grade"] for r in cells} == {"invalid"}
        assert "collision" in {r["class"] for r in cells}
    free = [r for r in rows if r["class"] == "free"]
    assert free
    assert all(float(r["stiffness_N_per_mm"]) > 0.0 for r in free)
    with Image.open(blocked_maps / "map.png") as picture:
        assert picture.format == "PNG"


def test_the_page_stands_alone_and_says_what_the_csv_says(blocked_maps):
    page = (blocked_maps / "map.html").read_bytes()
    assert not re.search(rb"(src|href)=[\"'](https?:|//)", page)
    data = data_of(page)
    assert data["classes"].shape == (5, 36)
    with (blocked_maps / "map.csv").open(newline="") as stream:
        kinds = [row["class"] for row in csv.DictReader(stream)]
    names = [kind.name.lower() for kind in SpinClass]
    assert [names[k] for k in data["classes"].ravel()] == kinds
    code = re.search(rb'src="data:image/png;base64,([^"]+)"', page)[1]
    assert base64.b64decode(code) == (blocked_maps / "map.png").read_bytes()
    barred = int((data["classes"] != 0).all(axis=1).sum())
    assert f"{barred} of 5 tags have no free spin".encode() in page


def test_same_bytes_every_time(blocked_maps):
    made = convert(ConvertRequest(*(str(blocked_maps / n) for n in ("holes.csv", "cell.toml"))))
    page = spin_map_page(spin_map(made.plan, made.cell), made.cell.name)
    assert page == (blocked_maps / "map.html").read_bytes()


def test_another_suffix_is_refused_before_any_work(tmp_path, capsys):
    code = app.run(["convert", "no.csv", "--cell", "no.toml", "-o", "out", "--spin-map", "a.svg"])
    assert code == 2
    assert "expected a name that ends in .html, .png, .csv" in capsys.readouterr().err


def test_counts_of_the_document(blocked_maps):
    document = json.loads((blocked_maps / "said.json").read_text())
    assert list(document["grades"]) == [grade.name.lower() for grade in Grade]
    assert sum(document["grades"].values()) == 5
    assert document["grades"]["invalid"] >= len(document["failures"]) > 0
