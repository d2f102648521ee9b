"""What a longer program of the same name has left goes; what others wrote stays, named."""

import json
import re

import pytest

from postproc.cli.app import run
from postproc.emitters import former_parts

pytestmark = pytest.mark.usefixtures("batch_here")
CELL = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = { xyz_mm = [107, 0, 362] }
axis = "+x"
[workpiece]
frame = { xyz_mm = [1600, 0, 700] }
[motion]
feed_mm_min = 600
[optimize]
step_deg = 45
[krl]
max_points_per_file = 5
"""


def holes(count):
    rows = "".join(f"H{i},{30 * i},0,0,0,0,1,5\n" for i in range(count))
    return f"id,x,y,z,i,j,k,depth\n{rows}"


@pytest.fixture
def make(tmp_path, capsys):
    """Return a function that makes a program of so many holes, by convert or batch."""

    def making(way, count, source="P.csv", *more):
        (tmp_path / "cell.toml").write_text(CELL)
        (tmp_path / source).write_text(holes(count))
        where = ["--cell", str(tmp_path / "cell.toml"), "-o", str(tmp_path / "out"), "--json"]
        capsys.readouterr()
        assert run([way, str(tmp_path / source), *where, *more]) == 0
        said = capsys.readouterr()
        return json.loads(said.out), said.err

    return making


def names(folder):
    return {path.name for path in folder.iterdir()} - {"manifest.json"}


@pytest.mark.parametrize("first", ["convert", "batch"])
@pytest.mark.parametrize("second", ["convert", "batch"])
def test_parts_of_a_longer_program_go_and_all_else_stays(make, tmp_path, first, second):
    out = tmp_path / "out"
    make(first, 7)
    long = names(out)
    foreign = {
        "P_900.src": "DEF P_900( )\nHALT\nEND\n",
        "P_901.src": (out / "P_003.src").read_text(),
        "P_902.dat": "DEFDAT P_902\nENDDAT\n",
        "P_003_old.src": (out / "P_003.src").read_text(),
        "PP_003.src": (out / "P_003.src").read_text().replace("P_003", "PP_003"),
        "Q_003.src": (out / "P_003.src").read_text().replace("P_003", "Q_003"),
        "P_3.src": (out / "P_003.src").read_text().replace("P_003", "P_3"),
        "main.src": "DEF main( )\nP_004()\nEND\n",
        "readme.txt": "P_005()\n",
    }
    for name, text in foreign.items():
        (out / name).write_text(text)
    said, told = make(second, 2)
    short = {name for name in names(out) if name in long}
    called = re.findall(r"^(P_\d+)\(", (out / "P.src").read_text(), re.MULTILINE)
    kept = {f"{part}.{end}" for part in ("P", *called, "P_004") for end in ("src", "dat")}
    assert short == kept
    assert set(foreign) <= names(out)
    assert set(said["removed"]) == long - kept
    for name in ("P_900.src", "P_901.src", "P_902.dat", "P_004.src"):
        assert re.search(rf"warning CNV012: .*{name}", told)
    assert not re.search(r"CNV012: .*(PP_003|Q_003|P_3\.|_old)", told)
    assert make(second, 2, "P.csv", *(["--force"] if second == "batch" else []))[0]["removed"] == []


def test_sections_of_an_input_that_shrank_go(make, tmp_path):
    make("batch", 9, "W.csv", "--split", "count:3")
    before = names(tmp_path / "out")
    said, _ = make("batch", 4, "W.csv", "--split", "count:3")
    after = names(tmp_path / "out")
    assert after < before
    assert set(said["removed"]) == before - after
    text = "".join(path.read_text() for path in (tmp_path / "out").glob("*.src")).upper()
    assert all(f"DEF {name[:-4].upper()}(" in text for name in after if name.endswith(".src"))


def test_nothing_goes_where_no_program_was_made(tmp_path):
    (tmp_path / "P_003.src").write_text("DEF P_003( )\n; part 3 of 4: motions 1 to 2\nEND\n")
    assert former_parts(tmp_path, "P", {}).ours == ()
    assert former_parts(tmp_path / "none", "P", {"P.src": b""}).ours == ()
    assert former_parts(tmp_path, "P", {"P.src": b""}).ours == ("P_003.src",)
