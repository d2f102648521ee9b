"""Solids that are there: read, closed, of the size of things, where the tool works."""

import json
import re
import sys

import numpy as np
import pytest
import trimesh

from postproc.cli.app import run
from postproc.collision import load_mesh
from postproc.errors import CellError
from tests.stepfile import step_box

CELL = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = {{ xyz_mm = [107, 0, 362] }}
axis = "+x"
[workpiece]
frame = {{ xyz_mm = [1600, 0, 700] }}
meshes = [{{ {mesh} }}]
[motion]
feed_mm_min = 600
[optimize]
step_deg = 60
"""
HOLES = "id,x,y,z,i,j,k,depth\n" + "".join(f"H{i},{100 * i},0,0,0,0,1,5\n" for i in range(4))


@pytest.fixture
def shop(tmp_path, capsys):
    """Return a function that writes the cell of a plate and gives the answer of a command."""
    (tmp_path / "p.csv").write_text(HOLES)
    plate = trimesh.creation.box((400, 200, 10))
    plate.apply_translation((150, 0, -5))
    plate.export(tmp_path / "plate.stl")
    (tmp_path / "plate.step").write_text(step_box((400, 200, 10), (-50, -100, -10)))

    def asking(command, mesh, *more):
        (tmp_path / "cell.toml").write_text(CELL.format(mesh=mesh))
        cell = ["--cell", str(tmp_path / "cell.toml")]
        call = {
            "check": ["check", str(tmp_path / "cell.toml")],
            "convert": ["convert", str(tmp_path / "p.csv"), *cell, "-o", str(tmp_path / "out")],
        }[command]
        capsys.readouterr()
        code = run([*call, *more])
        said = capsys.readouterr()
        return code, said.out + said.err

    return asking


@pytest.mark.parametrize("command", ["check", "convert"])
def test_what_a_scale_makes_of_a_plate(shop, command):
    """Good as mm; a tenth of a mm stops; elsewhere and of another unit is told."""
    table = {
        'file = "plate.stl"': (0, None),
        'file = "plate.stl", scale = 1e-3': (1, r"error CEL150: .*measures 0.4 mm"),
    }
    if command == "convert":
        table |= {
            'file = "plate.stl", xyz_mm = [0, 900, 0]': (None, r"CEL151: no tag .* than 800 mm to"),
            'file = "plate.stl", scale = 0.03937': (None, r"CEL151: tags reach over 300 mm"),
        }
    else:
        table |= {
            'file = "plate.step"': (0, None),
            'file = "plate.step", scale = 1e-3': (1, r"error CEL150: .*measures 0.4 mm"),
            'file = "plate.stl", scale = 1000': (None, r"warning CEL150: .*measures 4e\+05 mm"),
            'file = "plate.stl", scale = 0.02': (0, r"warning CEL150: .*measures 8 mm"),
        }
    for mesh, (code, pattern) in table.items():
        got, said = shop(command, mesh)
        assert code in (None, got), (mesh, said)
        if pattern is None:
            assert "CEL15" not in said
        else:
            assert re.search(pattern, said), (mesh, said)


BROKEN = {
    "nan.stl": lambda: trimesh.creation.box((np.nan, 1, 1)).export(file_type="stl"),
    "short.stl": lambda: trimesh.creation.box((1, 1, 1)).export(file_type="stl")[:-20],
    "lying.stl": lambda: bytes(80) + (10**9).to_bytes(4, "little") + bytes(50),
    "empty.stl": lambda: b"",
    "text.step": lambda: b"hello\n" * 50,
    "half.step": lambda: step_box((400, 200, 10), (0, 0, 0))[:3000].encode(),
    "none.stp": lambda: b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
    "plate.iges": lambda: b"nothing",
}


@pytest.mark.slow
def test_what_convert_cannot_read_is_no_solid_of_a_cell(shop, tmp_path, capsys):
    call = ["new-cell", "--robot", "kuka_kr500_r2830", "-o", str(tmp_path / "new.toml")]
    for name, content in BROKEN.items():
        (tmp_path / name).write_bytes(content())
        with pytest.raises(CellError, match="COL00"):
            load_mesh(tmp_path / name, 1e-3)
    for name, commands in (("nan.stl", ("check", "convert")), ("half.step", ("check",))):
        for command in commands:
            code, said = shop(command, f'file = "{name}"')
            assert code == 2, (name, command)
            assert said.count("error COL00") == 1, said
        assert run([*call, "--workpiece-mesh", str(tmp_path / name)]) == 2, name
        assert "error COL00" in capsys.readouterr().err
        assert not (tmp_path / "new.toml").exists()
    assert run([*call, "--workpiece-mesh", str(tmp_path / "plate.step"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)


def test_an_open_mesh_is_told(shop, tmp_path):
    sheet = trimesh.load(tmp_path / "plate.stl")
    sheet.update_faces(np.arange(len(sheet.faces)) > 1)
    sheet.export(tmp_path / "sheet.stl")
    code, said = shop("check", 'file = "sheet.stl"')
    assert code == 0
    assert re.search(r"warning COL103: .* is not closed", said)


def test_a_step_file_is_read_in_its_own_unit(tmp_path):
    for unit, size in (("", 1e3), (".CENTI.", 10.0)):
        (tmp_path / "box.stp").write_text(step_box((40, 20, 1), (3, 4, 5), unit))
        mesh = load_mesh(tmp_path / "box.stp", 1e-3)
        assert len(mesh.faces) == 12
        low, high = mesh.vertices.min(axis=0) * 1e3, mesh.vertices.max(axis=0) * 1e3
        np.testing.assert_allclose([low, high], size * np.array([(3, 4, 5), (43, 24, 6)]), 1e-6)


def test_without_the_extra_a_step_file_says_how_to_get_it(shop, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "cascadio", None)
    how = 'pip install "postproc[step]"'
    for command in ("check", "convert"):
        code, said = shop(command, 'file = "plate.step"')
        assert code == 2
        assert how in said.partition("\n")[0]
    mesh = str(tmp_path / "plate.step")
    call = ["new-cell", "--robot", "kuka_kr500_r2830", "-o", str(tmp_path / "n.toml")]
    assert run([*call, "--workpiece-mesh", mesh]) == 2
    assert how in capsys.readouterr().err.partition("\n")[0]
    with pytest.raises(CellError, match="PLG008"):
        load_mesh(tmp_path / "plate.step", 1e-3)
