"""Where no way can lead, since home or the start of a cut stands in something: what and where."""

import re

import numpy as np

from postproc.cell import load_cell
from postproc.jobs.convert import ConvertRequest, convert
from postproc.kinematics import build
from postproc.units import DEG, MM
from tests.jobs.emitted import CELL

HOME = (0, -90, 90, 0, 30, 0)
PART = "UNITS/MM\nRAPID\nGOTO/0,0,80,0,0,1\nFEDRAT/600,MMPM\nGOTO/0,0,-5\nGOTO/60,0,-5\nFINI\n"
SOLID = CELL.replace("[motion]\n", f"[motion]\nhome_deg = {list(HOME)}\n").replace(
    "[workpiece]\n",
    'meshes = [{ name = "head", box = { size_mm = [80, 80, 80] }, xyz_mm = [0, 0, 60] }]\n'
    "cutter = { diameter_mm = 10, length_mm = 60 }\n[workpiece]\n"
    "meshes = [{ box = { size_mm = [300, 300, 20] }, xyz_mm = [0, 0, -10] }]\n",
)


def failures(folder, cell, cam):
    """The errors of a conversion."""
    (folder / "cell.toml").write_text(cell)
    (folder / "part.apt").write_text(cam)
    done = convert(ConvertRequest(str(folder / "part.apt"), str(folder / "cell.toml")))
    return [finding.message for finding in done.findings if finding.is_error]


def post_at_home(folder):
    """The middle of the head at home, and a cube of 0.2 m round it."""
    (folder / "cell.toml").write_text(SOLID)
    cell = load_cell(str(folder / "cell.toml"))
    T = np.asarray(cell.robot.T_world_robroot) @ build(cell.robot).fk(np.array(HOME) * DEG)
    place = T[:3, 3] + 0.06 * T[:3, 2]
    text = '[[obstacles]]\nname = "post"\nbox = { size_mm = [200, 200, 200] }\n'
    return place, text + f"xyz_mm = {[round(float(v) / MM, 3) for v in place]}\n"


def test_all_is_free_without_the_post(tmp_path):
    assert failures(tmp_path, SOLID, PART) == []


def test_a_home_that_stands_in_something_is_named_with_what_and_where(tmp_path):
    place, post = post_at_home(tmp_path)
    said = [text for text in failures(tmp_path, SOLID + post, PART) if "from home" in text]
    assert len(said) == 2  # on the way there and on the way back
    for text in said:
        assert "no path leads from home" in text
        assert "post" in text
        at = np.array(re.search(r"about \[(.*)\] mm", text)[1].split(","), dtype=float)
        assert np.abs(at * MM - place).max() <= 0.1 + 1e-3  # on the cube, or in it


def test_a_cut_that_begins_in_material_is_named_with_what_and_where(tmp_path):
    buried = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,-60,0,0,1\nGOTO/60,0,-60\nFINI\n"
    text = " ".join(failures(tmp_path, SOLID, buried))
    assert "the tool cannot come here: tool cutter stands in workpiece" in text
    assert re.search(r"about \[.*\] mm from the robot root", text)


def test_a_cut_that_begins_in_material_is_entered_with_the_feed(tmp_path):
    """Whatever the cutter takes away on its way down, it takes away as it cuts."""
    shallow = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,-5,0,0,1\nGOTO/60,0,-5\nFINI\n"
    assert failures(tmp_path, SOLID, shallow) == []
