"""Mesh files: what is read, and one clear error for each way in which they are broken."""

import struct

import numpy as np
import pytest
import trimesh

from postproc.cell.cell import MeshPlacement
from postproc.collision.mesh import (
    box,
    cylinder,
    decimated,
    load_mesh,
    solid,
    welded,
)
from postproc.errors import CellError
from postproc.geometry.frames import transform_from_kuka
from tests.collision.conftest import wavy_sheet, write_stl

MM = 1e-3


def volume(mesh):
    c = mesh.corners
    return np.einsum("fi,fi->f", c[:, 0], np.cross(c[:, 1], c[:, 2])).sum() / 6.0


def as_trimesh(mesh, unit=MM):
    return trimesh.Trimesh(mesh.vertices / unit, np.array(mesh.faces), process=False)


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "off"])
def test_formats_agree(kind, tmp_path):
    mesh = wavy_sheet()
    path = tmp_path / f"panel.{kind.upper() if kind == 'obj' else kind}"
    path.write_bytes(_exported(as_trimesh(mesh), kind))
    loaded = load_mesh(path, MM)
    assert len(loaded.faces) == len(mesh.faces)
    assert len(loaded.vertices) == len(mesh.vertices)
    assert volume(loaded) == pytest.approx(volume(mesh), rel=1e-5)
    assert load_mesh(path, 2 * MM).vertices.max() == pytest.approx(2 * loaded.vertices.max())


def _exported(mesh, kind):
    text = mesh.export(file_type=kind)
    return text.encode() if isinstance(text, str) else text


def test_ascii_stl_equals_binary(tmp_path):
    mesh = as_trimesh(cylinder(0.1, 0.3))
    (tmp_path / "a.stl").write_text(mesh.export(file_type="stl_ascii"))
    (tmp_path / "b.stl").write_bytes(mesh.export(file_type="stl"))
    ascii_, binary = load_mesh(tmp_path / "a.stl", MM), load_mesh(tmp_path / "b.stl", MM)
    assert np.array_equal(ascii_.faces, binary.faces)
    assert np.allclose(ascii_.vertices, binary.vertices, atol=1e-7)


def test_binary_stl_may_begin_with_solid_and_end_with_more(tmp_path):
    raw = write_stl(tmp_path / "a.stl", box(np.ones(3))).read_bytes()
    (tmp_path / "b.stl").write_bytes(b"solid" + raw[5:])
    (tmp_path / "c.stl").write_bytes(raw + b"trailer")
    for name in ("b.stl", "c.stl"):
        assert volume(load_mesh(tmp_path / name, MM)) == pytest.approx(1.0, rel=1e-6)


def broken_files():
    raw = bytes(80) + struct.pack("<I", 1) + struct.pack("<12fH", *range(12), 0)
    not_finite = bytes(80) + struct.pack("<I", 1) + struct.pack("<12fH", *[float("nan")] * 12, 0)
    flat = bytes(80) + struct.pack("<I", 1) + struct.pack("<12fH", *[1.0] * 12, 0)
    facet = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"
    corner = "vertex 0 0 {}\n"
    words = facet.format("vertex 0 0 zero\n" + corner.format(1) + corner.format(2))
    return {
        "empty": ("a.stl", b"", "COL002"),
        "cut": ("a.stl", raw[:-7], "COL001"),
        "short": ("a.stl", b"\x00" * 40, "COL001"),
        "noise": ("a.stl", bytes(range(256)) * 9, "COL001"),
        "no triangle": ("a.stl", bytes(84), "COL002"),
        "not finite": ("a.stl", not_finite, "COL003"),
        "no area": ("a.stl", flat, "COL002"),
        "ascii cut": (
            "a.stl",
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n",
            "COL001",
        ),
        "ascii word": ("a.stl", f"solid a\n{words}endsolid a\n".encode(), "COL003"),
        "ascii none": ("a.stl", b"solid a\nendsolid a\n", "COL002"),
        "no format": ("a.step", b"ISO-10303-21;", "COL001"),
        "broken ply": ("a.ply", b"ply\nformat ascii 1.0\nelement vertex many\n", "COL001"),
        "empty obj": ("a.obj", b"# nothing\n", ("COL001", "COL002")),
    }


@pytest.mark.parametrize("case", broken_files())
def test_broken_files_give_one_error_with_the_file(case, tmp_path):
    name, content, codes = broken_files()[case]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CellError) as caught:
        load_mesh(path, MM)
    assert caught.value.code in codes
    assert caught.value.source.path == str(path)
    assert str(caught.value).startswith(f"{path}:1: error COL")


def test_missing_file_and_wrong_unit(tmp_path):
    with pytest.raises(CellError, match="no such file") as caught:
        load_mesh(tmp_path / "none.stl", MM)
    assert caught.value.code == "COL001"
    path = write_stl(tmp_path / "big.stl", box(np.full(3, 50.0)))
    with pytest.raises(CellError, match="expected less than 10 km"):
        load_mesh(path, 1.0)
    with pytest.raises(CellError, match="neither file, size nor radius"):
        solid(MeshPlacement("thing", np.eye(4)))


def test_placement_of_boxes_cylinders_and_files(tmp_path):
    T = transform_from_kuka([100, 200, 300], [0, 90, 0])
    tube = solid(MeshPlacement("tube", T, radius=0.05, length=0.4))
    low, high = tube.vertices.min(axis=0), tube.vertices.max(axis=0)
    assert np.allclose((low + high) / 2, [0.1, 0.2, 0.3])
    assert high[0] - low[0] == pytest.approx(0.4)
    assert 0.1 <= high[1] - low[1] < 0.101
    plate = solid(MeshPlacement("plate", T, size=np.array([0.1, 0.2, 0.4])))
    assert volume(plate) == pytest.approx(0.008)
    assert np.allclose(np.ptp(plate.vertices, axis=0), [0.4, 0.2, 0.1])
    path = write_stl(tmp_path / "box.stl", box(np.array([0.1, 0.2, 0.4])))
    assert np.allclose(
        np.ptp(solid(MeshPlacement("file", T, path)).vertices, axis=0), [0.4, 0.2, 0.1]
    )


def test_primitives_are_closed_and_point_outward():
    assert volume(box(np.array([1.0, 2.0, 3.0]))) == pytest.approx(6.0)
    tube = cylinder(1.0, 1.0)
    assert np.pi < volume(tube) < 1.01 * np.pi
    assert trimesh.Trimesh(tube.vertices, np.array(tube.faces)).is_watertight


def test_welding_keeps_places_and_drops_what_has_no_area():
    mesh = wavy_sheet()
    again = welded(mesh.corners)
    assert np.array_equal(again.corners, mesh.corners)
    assert len(again.vertices) == len(mesh.vertices)
    sliver = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]])
    assert len(welded(np.concatenate([mesh.corners, sliver])).faces) == len(mesh.faces)
    assert len(welded(np.array([[[0.0, 0, 0], [-0.0, 1, 0], [0, 0, 1]]])).vertices) == 3


def test_decimation_keeps_the_shape_and_the_bound():
    mesh = wavy_sheet(60)
    coarse = decimated(mesh, 2000)
    assert len(coarse.faces) <= 2000 < len(mesh.faces)
    assert np.allclose(np.ptp(coarse.vertices, axis=0), np.ptp(mesh.vertices, axis=0), atol=0.05)
    assert decimated(mesh, len(mesh.faces)) is mesh
