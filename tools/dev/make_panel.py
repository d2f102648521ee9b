"""Write the files of fixtures/drilling_panel: a curved panel, 240 holes, a fixture around it.

Run: python -m tools.dev.make_panel    (the output is the same bytes every time)
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import trimesh

CASE = Path(__file__).resolve().parents[2] / "fixtures" / "drilling_panel"
RADIUS = 1800.0  # mm, curvature of the skin about the CAM x axis
WIDTH, HEIGHT, THICKNESS = 1400.0, 900.0, 4.0
ROWS, COLUMNS = 12, 20
SPINDLE_Z, DRILL_TIP, DRILL_LENGTH = 362.0, 307.0, 77.0  # mm, in the flange


def surface(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) mm and outward normals (n, 3) of the skin over its unrolled coordinates."""
    angle = y / RADIUS
    points = np.column_stack([x, RADIUS * np.sin(angle), RADIUS * (np.cos(angle) - 1.0)])
    normals = np.column_stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)])
    return points, normals


def holes() -> str:
    """The drilling list, rows in serpentine order."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["id", "x", "y", "z", "i", "j", "k", "depth", "diameter", "feed", "operation"])
    for row, y in enumerate(np.linspace(-360.0, 360.0, ROWS)):
        x = np.linspace(-570.0, 570.0, COLUMNS)
        if row % 2:
            x = x[::-1]
        points, normals = surface(x, np.full(COLUMNS, y))
        for column, (point, normal) in enumerate(zip(points, normals, strict=True)):
            name = f"R{row + 1:02d}H{column + 1:02d}"
            numbers = [f"{v:.4f}" for v in point] + [f"{v:.8f}" for v in normal]
            numbers = [n.replace("-0.0000", "0.0000") if float(n) == 0 else n for n in numbers]
            operation = "stringer" if row in (3, 8) else "skin"
            writer.writerow([name, *numbers, "6.0", "4.8", "120", operation])
    return text.getvalue()


def panel() -> trimesh.Trimesh:
    """The skin: a thin curved slab, closed."""
    nx, ny = 14, 36
    x, y = np.meshgrid(
        np.linspace(-WIDTH / 2, WIDTH / 2, nx), np.linspace(-HEIGHT / 2, HEIGHT / 2, ny)
    )
    top, normals = surface(x.ravel(), y.ravel())
    vertices = np.vstack([top, top - THICKNESS * normals])
    index = np.arange(nx * ny).reshape(ny, nx)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.vstack([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    rim = np.concatenate([index[0, :], index[1:, -1], index[-1, -2::-1], index[-2:0:-1, 0]])
    following = np.roll(rim, -1)
    n = nx * ny
    walls = np.vstack(
        [np.stack([following, rim, rim + n], -1), np.stack([following, rim + n, following + n], -1)]
    )
    return trimesh.Trimesh(vertices, np.vstack([faces, faces[:, ::-1] + n, walls]), process=False)


def fixture() -> trimesh.Trimesh:
    """Beams behind the skin, two side posts and three clamps that reach over its face."""
    boxes = [
        ((1500.0, 80.0, 120.0), (0.0, 0.0, -130.0)),
        ((80.0, 1100.0, 160.0), (-760.0, 0.0, -20.0)),
        ((80.0, 1100.0, 160.0), (760.0, 0.0, -20.0)),
        ((80.0, 60.0, 150.0), (-690.0, 300.0, 70.0)),
        ((80.0, 60.0, 150.0), (690.0, 300.0, 70.0)),
        ((70.0, 70.0, 260.0), (0.0, 560.0, 80.0)),
    ]
    return trimesh.util.concatenate(
        [
            trimesh.creation.box(extents, trimesh.transformations.translation_matrix(centre))
            for extents, centre in boxes
        ]
    )


def across(start: float, end: float, radius: float, sections: int) -> trimesh.Trimesh:
    """A cylinder along the axis of the spindle, flange x, from start to end [mm]."""
    place = trimesh.transformations.translation_matrix(((start + end) / 2, 0, SPINDLE_Z))
    place = place @ trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0))
    return trimesh.creation.cylinder(radius, end - start, sections=sections, transform=place)


def spindle() -> trimesh.Trimesh:
    """The angle head: a mount on the flange, the spindle across it, a collet in front.

    The spindle reaches as far past the flange as the wrist of a large arm is wide: with less, the
    wrist and not the drill would meet the skin first.
    """
    mount = trimesh.creation.box(
        (160.0, 160.0, 280.0), trimesh.transformations.translation_matrix((0, 0, 145.0))
    )
    collet = DRILL_TIP - DRILL_LENGTH
    return trimesh.util.concatenate(
        [
            mount,
            across(-180.0, collet - 60.0, 75.0, 32),
            across(collet - 60.0, collet, 35.0, 32),
        ]
    )


def drill() -> trimesh.Trimesh:
    """The drill in front of the collet: the part that may touch the work."""
    return across(DRILL_TIP - DRILL_LENGTH, DRILL_TIP, 2.4, 16)


def main() -> None:
    """Write all files."""
    CASE.mkdir(parents=True, exist_ok=True)
    (CASE / "panel.csv").write_text(holes(), encoding="ascii", newline="")
    for name, mesh in (
        ("panel", panel()),
        ("fixture", fixture()),
        ("spindle", spindle()),
        ("drill", drill()),
    ):
        if not mesh.is_watertight:
            raise SystemExit(f"{name} is not closed")
        (CASE / f"{name}.stl").write_bytes(mesh.export(file_type="stl"))
        print(name, mesh.bounds.tolist(), f"{mesh.volume / 1e9:.5f} m3")


if __name__ == "__main__":
    main()
