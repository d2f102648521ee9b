"""Programs without a home: how they begin and end in material, and clearances that ask for much."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.cell import parse_cell
from postproc.jobs.convert import ConvertRequest, convert, document
from postproc.krl.text.parse import parse_files
from postproc.model import MoveKind
from postproc.units import MM
from postproc.verification.verify import verify

PLATE = (
    'meshes = [{ name = "plate", box = { size_mm = [400, 300, 40] }, xyz_mm = [200, 150, -20] }]\n'
)
CLAMP = """\
[[obstacles]]
name = "clamp"
box = { size_mm = [40, 40, 200] }
xyz_mm = [1535, -50, 700]
"""
CELL = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr210_r2700_2"
[tool]
frame = { xyz_mm = [0, 0, 300], abc_deg = [0, 0, 0] }
axis = "+z"
cutter = { diameter_mm = 12, length_mm = 60 }
meshes = [{ name = "body", cylinder = { radius_mm = 50, length_mm = 239 }, xyz_mm = [0, 0, 120] }]
[workpiece]
frame = { xyz_mm = [1500, -150, 600], abc_deg = [0, 0, 0] }
"""
BESIDE, OVER = [(20, 100)], [(200, 100), (300, 100), (300, 200)]
"""Under the clamp, and where the plate is clear."""


def slot(points):
    """Return a CAM text: down, 10 mm deep through points, up."""
    lines = [f"GOTO/{x},{y},-10" for x, y in points]
    (first, last) = (f"GOTO/{x},{y},60" for x, y in (points[0], points[-1]))
    head = f"UNITS/MM\nSPINDL/6000,RPM,CLW\nRAPID\n{first}\nFEDRAT/600,MMPM\n"
    return head + "\n".join(lines) + f"\nRAPID\n{last}\nSPINDL/OFF\nFINI\n"


def converted(folder, points, cell, *, partial=False):
    (folder / "cell.toml").write_text(cell)
    (folder / "part.apt").write_text(slot(points))
    request = ConvertRequest(str(folder / "part.apt"), str(folder / "cell.toml"), partial=partial)
    return convert(request)


def moves(job):
    text = "".join(data.decode() for name, data in job.files.items() if name.endswith(".src"))
    return re.findall(
        r"^(PTP|LIN|PP_SPINDLE_OFF)\W.*?(?:Z (-?[\d.]+))?(?:,A -?[\d.]+,B.*)?$", text, re.M
    )


def test_no_program_begins_in_the_material(tmp_path):
    job = converted(tmp_path, BESIDE + OVER, CELL + PLATE + CLAMP, partial=True)
    first, second = moves(job)[:2]
    assert (first[0], second) == ("PTP", ("LIN", "-10.0000"))
    row = int(np.argmax(job.plan.kind == MoveKind.PTP))
    above, down = job.plan.T_base_tcp[row : row + 2, :3, 3] / MM
    assert above - down == pytest.approx([0.0, 0.0, 70.0])  # as high as the file comes from
    assert job.plan.speed[row + 1] == pytest.approx(0.01)


def test_verify_sees_where_the_first_motion_of_a_program_ends(tmp_path):
    free = converted(tmp_path, BESIDE + OVER, CELL)
    name = next(name for name in free.files if name.endswith(".src"))
    lines = free.files[name].split(b"\r\n")
    first = next(i for i, line in enumerate(lines) if line.startswith(b"PTP"))
    lines[first] = b"PTP " + _axes(free) + b"}"
    modules = parse_files({**free.files, name: b"\r\n".join(lines)})
    for cell, is_met in ((CELL, False), (CELL + PLATE, True)):
        report = verify(modules, modules[0].name, parse_cell(cell.encode(), "cell.toml"))
        hits = [item for item in report.violations if item.code == "collision"]
        assert [item.source.line for item in hits] == [first + 1] * is_met


def _axes(job):
    """Return the joints at the first point in the material, as a program says them."""
    row = next(i for i, T in enumerate(job.plan.T_base_tcp) if T[2, 3] < 0.0)
    degrees = [
        f"A{i + 1} {value:.5f}" for i, value in enumerate(job.plan.q[row] * 57.29577951308232)
    ]
    return ("{" + ",".join(degrees)).encode()


def test_a_program_that_stops_before_the_end_of_the_file_leaves_the_material(tmp_path):
    job = converted(tmp_path, OVER[::-1] + BESIDE, CELL + PLATE + CLAMP, partial=True)
    *_, before, last, off = moves(job)
    assert (before[0], float(before[1])) == ("LIN", -10.0)
    assert (last[0], float(last[1])) == ("LIN", 60.0)
    assert off[0] == "PP_SPINDLE_OFF"


def test_a_large_clearance_that_is_kept_is_a_good_margin(tmp_path):
    few = document(converted(tmp_path, OVER, CELL + PLATE))
    wide = document(converted(tmp_path, OVER, CELL + PLATE + "[limits]\nclearance_mm = 30\n"))
    assert few["grades"] == wide["grades"]
    assert few["grades"]["good"] == few["tags"]
    assert wide["clearance"]["smallest_mm"] == 36.0  # no solid so near
