"""Cells as a user has them, with the arm's default solids, and holes to drill in them.

Where the shared workloads are at hand they are theirs (``make_cells.py``); else a scene of the same
size: a curved panel of 4,096 and of 262,144 triangles, eight fixtures, an angle head, ten clamps of
20,000 triangles beside the panel.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.collision.mesh import Mesh, box, joined
from postproc.geometry import transform
from tests.cells import STIFFNESS
from tests.collision.conftest import write_stl

KINDS = ("cell", "hard", "fine", "clamps", "free")
"""As a user begins; with four beams more; a fine panel; clamps; no solids but the arm."""
_RADIUS = 2.2
"""Of the panel [m]."""
_HEAD = (
    ((-0.13, -0.13, 0.0), (0.13, 0.13, 0.04)),
    ((0.06, -0.09, 0.04), (0.12, 0.09, 0.34)),
    ((-0.2, -0.08, 0.26), (0.16, 0.08, 0.42)),
    ((0.16, -0.035, 0.305), (0.34, 0.035, 0.375)),
)
"""An angle head on the flange: boxes by two corners [m]."""
_FIXTURES = (
    *(((2.17, y, 0.0), (2.27, y + 0.1, 2.0)) for y in (-1.13, 1.03)),
    *(((2.19, -1.1, z), (2.29, 1.1, z + 0.1)) for z in (0.63, 1.3, 1.97)),
    *(((2.14, y, 0.6), (2.2, y + 0.1, 0.7)) for y in (-0.5, 0.4)),
    ((-1.5, -3.0, -0.055), (4.5, 3.0, -0.005)),
)
_BEAMS = (
    *(((1.69, -1.15, z), (1.81, 1.15, z + 0.12)) for z in (0.34, 2.24)),
    *(((1.66, y, 0.2), (1.74, y + 0.08, 2.2)) for y in (-1.19, 1.11)),
)
_TOP = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = { xyz_mm = [360, 0, 340], abc_deg = [0, -90, -180] }
axis = "+z"
"""


def write_cells(folder: Path, workloads: Path) -> None:
    """Write the cells ``KIND.toml`` and their meshes into a folder."""
    script = workloads / "make_cells.py"
    if script.is_file():
        words, sys.argv = sys.argv, [str(script), str(folder)]
        runpy.run_path(str(script), run_name="__main__")
        sys.argv = words
        return
    folder.mkdir(parents=True, exist_ok=True)
    meshes = {"coarse": _panel(32), "panel_fine": _panel(256)}
    meshes["head"] = joined([_block(*corners) for corners in _HEAD])
    meshes |= {f"fixture_{k}": _block(*corners) for k, corners in enumerate(_FIXTURES)}
    meshes |= {f"beam_{k}": _block(*corners) for k, corners in enumerate(_BEAMS)}
    for k in range(10):
        meshes[f"clamp_{k}"] = ball(100).moved(_at(2.1, -0.9 + 0.2 * k, 0.62))
    for name, mesh in meshes.items():
        write_stl(folder / f"{name}.stl", mesh)
    fixtures, beams, clamps = (
        "".join(
            f'[[obstacles]]\nname = "{n}"\nfile = "{n}.stl"\n' for n in meshes if n.startswith(k)
        )
        for k in ("fixture", "beam", "clamp")
    )
    place = "[workpiece]\nframe = { xyz_mm = [0, 0, 0], abc_deg = [0, 0, 0] }\n"
    head, part, fine = (
        f'meshes = [{{ file = "{n}.stl" }}]\n' for n in ("head", "coarse", "panel_fine")
    )
    rest = {
        "cell": head + place + part + fixtures,
        "hard": head + place + part + fixtures + beams,
        "fine": head + place + fine + fixtures,
        "clamps": head + place + part + fixtures + clamps,
        "free": place,
    }
    for kind, text in rest.items():
        (folder / f"{kind}.toml").write_text(_TOP + text + STIFFNESS, encoding="utf-8")


def holes_file(count: int, folder: Path, workloads: Path) -> Path:
    """Return the CSV file of so many holes: the shared one, else one of serpentine rows."""
    shared = workloads / f"workload_{count}.csv"
    if shared.is_file():
        return shared
    across = max(2, round((2.0 * count) ** 0.5))
    number = np.arange(count)
    row, column = number // across, number % across
    column = np.where(row % 2 == 1, across - 1 - column, column)
    point, normal = _skin(
        1.8 * column / (across - 1) - 0.9, 1.08 * row / max(1, int(row.max())) - 0.54
    )
    file = folder / f"holes_{count}.csv"
    table = np.column_stack([1e3 * point, normal])
    np.savetxt(file, table, "%.6f", ",", header="x,y,z,i,j,k", comments="")
    return file


def _skin(y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points [m] and outward normals (n, 3) of the panel's skin, which bends about y."""
    point = np.stack([2.05 + z**2 / (2.0 * _RADIUS), y, 1.35 + z], axis=-1)
    normal = np.stack([-np.ones_like(y), np.zeros_like(y), z / _RADIUS], axis=-1)
    return point, normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _panel(count: int) -> Mesh:
    """Return the panel as a closed plate 3 mm thick, of ``count`` squares a side on both faces."""
    y, z = np.meshgrid(
        np.linspace(-1, 1, count + 1), np.linspace(-0.58, 0.58, count + 1), indexing="ij"
    )
    point, normal = (rows.reshape(-1, 3) for rows in _skin(y, z))
    index = np.arange(len(point)).reshape(y.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    skin = np.vstack([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (a, d, c))])
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
    after, low = np.roll(rim, -1), len(point)
    walls = [np.stack([rim, after, after + low], 1), np.stack([rim, after + low, rim + low], 1)]
    faces = np.vstack([skin, skin[:, ::-1] + low, *walls])
    return Mesh(np.vstack([point, point - 0.003 * normal]), faces.astype(np.int32))


def ball(count: int) -> Mesh:
    """Return a ball of about ``2 count^2`` triangles."""
    turn = 2.0 * np.pi * np.arange(count) / count
    height = np.pi * np.arange(1, count) / count
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    rows = np.sin(height)[:, None, None] * ring
    up = np.broadcast_to(np.cos(height)[:, None, None], (*rows.shape[:2], 1))
    points = np.vstack(
        [np.concatenate([rows, up], axis=-1).reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]]
    )
    i = np.arange((count - 2) * count)
    j = i - i % count + (i + 1) % count
    n, k = (count - 1) * count, np.arange(count)
    after = (k + 1) % count
    caps = [
        np.stack([k, after, np.full(count, n)], 1),
        np.stack([n - count + after, n - count + k, np.full(count, n + 1)], 1),
    ]
    sides = [np.stack([i, i + count, j + count], 1), np.stack([i, j + count, j], 1)]
    return Mesh(0.035 * points, np.vstack([*sides, *caps]).astype(np.int32))


def _block(low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
    """Return a box by two corners [m]."""
    return box(np.subtract(high, low)).moved(_at(*0.5 * np.add(low, high)))


def _at(x: float, y: float, z: float) -> FloatArray:
    return transform(np.eye(3), np.array([x, y, z]))
