"""The base from datum points, against scipy's weighted alignment and simulated measurements."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.errors import DataError, SourceRef
from postproc.geometry import apply, transform_from_kuka
from postproc.measurement import DatumPoints, fit_base, read_datum_points
from tests.cells import cell_text

NOISE = 3e-5


def part(rng, n, wrong=0, *, stated=True, flat=False):
    """Return points of a part that stands somewhere, its frame, and the wrong ones of them."""
    a = rng.uniform(-0.8, 0.8, (n, 3)) * [1.0, 1.0, 0.0 if flat else 0.3]
    T = transform_from_kuka([*rng.uniform(-500, 2000, 2), 600], rng.uniform(-180, 180, 3))
    sigma = NOISE * (rng.uniform(0.5, 3.0, n) if stated else np.ones(n))
    b = apply(T, a) + rng.normal(size=(n, 3)) * sigma[:, None]
    bad = rng.choice(n, wrong, replace=False)
    way = rng.normal(size=(wrong, 3))
    b[bad] += rng.uniform(1e-3, 5e-3) * way / np.linalg.norm(way, axis=1, keepdims=True)
    names = tuple(map(str, range(n)))
    return DatumPoints(SourceRef("p.csv"), names, a, b, sigma if stated else None, ()), T, set(bad)


def test_the_frame_is_that_of_the_weighted_alignment_of_scipy():
    rng = np.random.default_rng(1)
    for n in (3, 4, 7, 20):
        points, _, _ = part(rng, n)
        found, weight = fit_base(points), points.sigma**-2.0
        a, b = (np.average(p, axis=0, weights=weight) for p in (points.nominal, points.measured))
        R = Rotation.align_vectors(points.measured - b, points.nominal - a, weight)[0].as_matrix()
        assert np.allclose(found.T_robroot_base[:3, :3], R, atol=1e-9)
        assert np.allclose(found.T_robroot_base[:3, 3], b - R @ a, atol=1e-9)


def test_a_square_of_four_points_has_the_uncertainty_of_the_books():
    # at the middle sigma / sqrt(n) in each direction; a turn about z by sigma / (r sqrt(n))
    r, a = 0.5, np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]) * 0.5
    points = DatumPoints(SourceRef("p.csv"), tuple("abcd"), a, a, np.full(4, NOISE), ())
    found = fit_base(points)
    assert found.u95(np.zeros((1, 3)))[0] == pytest.approx(2.7955 * NOISE / 2.0, rel=1e-4)
    variance = np.diag(found.covariance)[3:] / (NOISE / r) ** 2
    assert variance == pytest.approx([1 / 2, 1 / 2, 1 / 4])


def test_outliers_are_named_and_nothing_else():
    rng, lines = np.random.default_rng(2), []
    covered = []
    for stated, (n, wrong) in product((True, False), ((4, 0), (4, 1), (6, 1), (8, 2), (16, 5))):
        named = blamed = 0
        for _ in range(40):
            points, T, bad = part(rng, n, wrong, stated=stated)
            found = fit_base(points)
            out = set(found.outliers.tolist())
            named, blamed = named + (out == bad), blamed + bool(out - bad)
            if out == bad:
                q = rng.uniform(-1.0, 1.0, (4, 3))
                off = np.linalg.norm(apply(found.T_robroot_base, q) - apply(T, q), axis=1)
                covered.extend(off <= found.u95(q))
        if named < 36 or blamed > 1:
            lines.append((stated, n, wrong, named, blamed))
    assert lines == []
    assert np.mean(covered) == pytest.approx(0.95, abs=0.03)


def test_of_three_points_and_of_four_in_a_plane_none_is_blamed():
    rng = np.random.default_rng(3)
    points, _, _ = part(rng, 3, 1)
    found = fit_base(points)
    assert len(found.outliers) == 0
    assert not found.agree
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    off = square + np.outer([0, 0, 2e-3, 0], [0, 0, 1])  # out of it: any of them may be
    off = off + rng.normal(size=(4, 3)) * 1e-6
    for sigma in (None, np.full(4, 1e-6)):
        found = fit_base(DatumPoints(SourceRef("p"), tuple("abcd"), square, off, sigma, ()))
        assert (len(found.outliers), found.agree) == (0, False), sigma


HEAD = "id,x_mm,y_mm,z_mm,mx_mm,my_mm,mz_mm"
ROWS = np.array([[0, 0, 0], [800, 0, 20], [800, 400, 0], [0, 300, -50], [300, 100, 90]], float)
PLACED = ROWS + np.array([1500, 100, 600])


def text(nominal=ROWS, measured=PLACED, head=HEAD, rows=slice(None)):
    lines = [
        f"D{i}," + ",".join(f"{v:.6f}" for v in (*a, *b))
        for i, (a, b) in enumerate(zip(nominal, measured, strict=True))
    ]
    return "\n".join([head, *lines[rows]]) + "\n"


WRONG = {
    "MEA015 2 distinct": text(rows=slice(2)),
    "MEA015 line": text(ROWS * [1, 0, 0], ROWS * [1, 0, 0] + 5),
    "MEA016 measured points are in inch": text(measured=PLACED / 25.4),
    "MEA016 nominal points are in inch": text(nominal=ROWS / 25.4),
    "MEA016 measured points are in m,": text(measured=PLACED / 1000.0),
    "MEA016 mirrored": text(measured=PLACED * [-1, 1, 1]),
    "MEA016 any place of the part": text(measured=PLACED[[1, 0, 2, 4, 3]]),
    "MEA016 1.03 times": text(measured=PLACED * 1.03),
    "MEA004 'mz_mm'": text(head=HEAD.replace("mz_mm", "mz")),
    "MEA014 D1 appears twice": text().replace("D2", "D1"),
    "MEA007 my_mm is empty": text().replace(",100.000000,", ",,", 1),
    "MEA006 'one'": text().replace(",100.000000,", ",one,", 1),
}


def test_points_that_give_no_frame_are_refused_by_name(tmp_path):
    wrong = []
    for expected, content in WRONG.items():
        code, words = expected.split(" ", 1)
        (tmp_path / "p.csv").write_text(content)
        try:
            fit_base(read_datum_points(tmp_path / "p.csv"))
            wrong.append((expected, "taken"))
        except DataError as error:
            if error.code != code or words not in error.message or error.source is None:
                wrong.append((expected, str(error)))
    assert wrong == []


def test_the_command_writes_the_cell_with_the_base(tmp_path, monkeypatch, capfd):
    from postproc.cell import load_cell
    from postproc.cli import app

    monkeypatch.chdir(tmp_path)
    mesh = 'meshes = [{ file = "box.stl" }]  # the panel\n'
    world = "base = { xyz_mm = [0, 0, 500], abc_deg = [90, 0, 0] }\n[tool]\n"
    cell = cell_text(mesh, origin=(1400, 0, 500)).replace("[tool]\n", world)
    (tmp_path / "box.stl").write_bytes(_box())
    (tmp_path / "cell.toml").write_text(cell)
    (tmp_path / "p.csv").write_text(text())
    (tmp_path / "h.csv").write_text("x,y,z,i,j,k,depth\n3000,0,0,0,0,1,5\n")
    (tmp_path / "sub").mkdir()
    call = "fit-base p.csv --cell cell.toml --job h.csv -o sub/new.toml"
    assert app.run(call.split()) == 0
    # T_world_base: turned by 90 degrees about z, then raised
    assert "BASE_DATA[1]={X -100.0000,Y 1500.0000,Z 1100.0000,A 90.0" in capfd.readouterr().out
    new = (tmp_path / "sub" / "new.toml").read_text()
    changed = [line for line in new.splitlines() if line not in cell.splitlines()]
    assert changed == [
        "frame = { xyz_mm = [1500.0, 100.0, 600.0], abc_deg = [0.0, 0.0, 0.0] }",
        'meshes = [{ file = "../box.stl" }]  # the panel',
    ]
    assert load_cell("sub/new.toml").workpiece.meshes[0].file.resolve() == tmp_path / "box.stl"
    (tmp_path / "bad.csv").write_text(text(measured=PLACED / 25.4))
    assert app.run(["fit-base", "bad.csv", "--cell", "cell.toml", "-o", "bad.toml"]) == 2
    assert not (tmp_path / "bad.toml").exists()
    assert capfd.readouterr().err.startswith("bad.csv:1: error MEA016: ")


def _box():
    import trimesh

    return trimesh.creation.box((10, 10, 10)).export(file_type="stl")
