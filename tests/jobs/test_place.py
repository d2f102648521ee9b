"""place finds what is known to be there, proves it, and says so where nothing is."""

import json

import numpy as np
import pytest

import postproc as pp
from postproc.cell import load_cell
from postproc.cli import app
from postproc.jobs.convert import ConvertRequest, convert, read_toolpath
from postproc.jobs.place import place
from tests.cells import cell_text
from tests.jobs.places import part

SPINDLE = '[process]\nspindle = "unit"\n[motion]\nfeed_mm_min = 300\n'
HOLES = "x,y,z,i,j,k,depth\n0,0,0,0,0,1,5\n60,0,0,0,0,1,5\n0,60,0,0,0,1,5\n"


@pytest.mark.slow
def test_a_place_is_found_where_there_is_one(tmp_path):
    cell, toolpath, box, _ = part(np.random.default_rng(3), tmp_path)
    job = place(toolpath, cell, box)
    assert job.good
    assert (job.frame["xyz_mm"] >= box[:3]).all()
    assert (job.frame["xyz_mm"] <= box[3:]).all()
    (tmp_path / "two.toml").write_bytes(job.cell_file(tmp_path / "two.toml"))
    request = ConvertRequest(toolpath.path, str(tmp_path / "two.toml"))
    again = convert(request)
    assert again.good
    assert again.files == job.conversion.files


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(cell_text(SPINDLE, origin=(6000, 0, 700)))
    (tmp_path / "h.csv").write_text(HOLES)
    return tmp_path


@pytest.mark.slow
def test_the_robot_goes_to_the_part(folder, capfd):
    call = "place h.csv --cell cell.toml --move robot --json -q -o n.toml --box"
    assert app.run([*call.split(), *["3500", "-500", "0", "5000", "500", "300"]]) == 0
    frame = json.loads(capfd.readouterr().out)["frame"]
    new, old = load_cell("n.toml"), load_cell("cell.toml")
    assert frame["xyz_mm"] == pytest.approx(new.robot.T_world_robroot[:3, 3] * 1e3)
    world = new.robot.T_world_robroot @ new.T_robroot_base  # the part stays
    assert np.allclose(world, old.T_robroot_base, atol=1e-8)
    toolpath = read_toolpath(ConvertRequest("h.csv", "n.toml"), new)
    assert convert(ConvertRequest("h.csv", "n.toml"), None, toolpath, new).good


@pytest.mark.slow
def test_without_any_place_the_best_one_is_told_and_nothing_written(folder, capfd):
    call = "place h.csv --cell cell.toml --box 4000 0 0 4100 100 100 --json -o n.toml"
    assert app.run([*call.split(), "-q"]) == 1
    document = json.loads(capfd.readouterr().out)
    assert (document["good"], document["tags_good"]) == (False, 0)
    assert not (folder / "n.toml").exists()
    found = pp.place("h.csv", "cell.toml", [4000, 0, 0, 4100, 100, 100]).document
    assert json.loads(json.dumps(found)) == document


def test_wrong_calls_are_one_line(folder, capfd):
    wrong = []
    for options, code in (
        ("", "CLI016"),
        ("--box 1 0 0 0 1 1", "CLI016"),
        ("--box 0 0 0 1 1 nan", "CLI001"),
        ("--box 0 0 0 1 1 1 --move rail", "CEL043"),
        ("--box 0 0 0 1 1 1 --free abc", "CLI001"),
    ):
        result = app.run(["place", "h.csv", "--cell", "cell.toml", *options.split()])
        err = capfd.readouterr().err
        if result != 2 or f"error {code}: " not in err.splitlines()[0]:
            wrong.append((options, result, err))
    assert wrong == []
