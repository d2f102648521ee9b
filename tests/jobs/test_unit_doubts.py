"""Lengths without a unit: mm, unless only another unit fits the cell."""

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.errors import ReadError
from postproc.jobs.unit_doubts import check_units
from postproc.readers import ReadOptions, read

CELL = """schema = "postproc.cell/1"
name = "mill"
[robot]
model = "kuka_kr500_r2830"
[tool]
number = 2
name = "spindle"
frame = {{ xyz_mm = [0, 0, 350], abc_deg = [0, 0, 0] }}
axis = "+z"
mass_kg = 60
cog_mm = [0, 0, 150]
[workpiece]
number = 3
frame = {{ xyz_mm = {place}, abc_deg = [0, 0, 0] }}
"""


def table(folder, points, scale=1.0):
    rows = "".join(f"{x:.9g},{y:.9g},{z:.9g},0,0,1\n" for x, y, z in np.asarray(points) * scale)
    path = folder / "p.csv"
    path.write_text("x,y,z,i,j,k\n" + rows)
    return path


def cell_at(folder, place):
    path = folder / "cell.toml"
    path.write_text(CELL.format(place=list(place)))
    return load_cell(path)


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1.0), ("m", 1e-3), ("inch", 1 / 25.4)])
def test_what_only_another_unit_brings_within_reach_is_asked(tmp_path, unit, scale):
    points = [[1500, y, 700] for y in (-900, -300, 300, 900)]  # of the robot's root
    path = table(tmp_path, points, scale)
    cell = cell_at(tmp_path, (0, 0, 0))
    toolpath = read(path, options=ReadOptions(tool_axis=(0, 0, 1)))
    if unit == "mm":
        check_units(toolpath, cell)
        return
    with pytest.raises(ReadError, match="CNV013") as caught:
        check_units(toolpath, cell)
    assert f"--units {unit}" in caught.value.hint
    check_units(read(path, options=ReadOptions(units=unit)), cell)


def test_what_is_beyond_reach_in_any_unit_is_no_question_of_units(tmp_path):
    path = table(tmp_path, [[9000, 0, 0], [9100, 0, 0]])
    check_units(read(path), cell_at(tmp_path, (0, 0, 0)))


def block(low, high):
    """Return the text of an STL solid: a box between two corners [mm]."""
    corner = np.array([low, high])
    facets = []
    for axis, side in ((a, s) for a in range(3) for s in (0, 1)):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        ring = []
        for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))[:: 1 if side else -1]:
            point = [0.0, 0.0, 0.0]
            point[axis], point[one], point[two] = corner[side, axis], corner[i, one], corner[j, two]
            ring.append("vertex {} {} {}".format(*point))
        for three in ((0, 1, 2), (0, 2, 3)):
            lines = "\n".join(ring[k] for k in three)
            facets.append(f"facet normal 0 0 0\nouter loop\n{lines}\nendloop\nendfacet")
    return "solid part\n" + "\n".join(facets) + "\nendsolid part\n"


def test_what_only_another_unit_brings_onto_the_part_is_asked(tmp_path):
    (tmp_path / "part.stl").write_text(block((300, 300, 0), (500, 500, 20)))
    text = CELL.format(place=[1300, -300, 500]) + 'meshes = [{ file = "part.stl" }]\n'
    (tmp_path / "cell.toml").write_text(text)
    cell = load_cell(tmp_path / "cell.toml")
    points = np.array([[320, 320, 20], [480, 320, 20], [400, 470, 20]])
    check_units(read(table(tmp_path, points)), cell)
    path = table(tmp_path, points, 1 / 25.4)
    with pytest.raises(ReadError, match="CNV013") as caught:
        check_units(read(path), cell)
    assert "on the workpiece" in caught.value.message
    check_units(read(path, options=ReadOptions(units="inch")), cell)
