"""Write the CAM file of ``fixtures/wing_panel``: one skin panel, three tools, one APT file.

Run: python -m tools.dev.make_wing    (the output is the same bytes every time)

The panel is that of ``fixtures/drilling_panel``. Tool 1 drills the skin, tool 2 the larger holes of
the stringer, tool 3 trims the right edge along the curve of the skin.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tools.dev.make_panel import surface

CASE = Path(__file__).resolve().parents[2] / "fixtures" / "wing_panel"
SKIN_ROWS, SKIN_X = (-240.0, -120.0, 120.0, 240.0), np.linspace(-400.0, 400.0, 6)
STRINGER_X = np.linspace(-350.0, 350.0, 6)
EDGE_X, EDGE_Y = 500.0, np.linspace(-250.0, 250.0, 26)
SAFE = 60.0
"""Height above the skin of rapids [mm]."""


def goto(point: np.ndarray, axis: np.ndarray) -> str:
    """Return a GOTO."""
    numbers = [f"{value:z.4f}" for value in point] + [f"{value:z.7f}" for value in axis]
    return "GOTO/" + ",".join(numbers)


def drilled(rows: tuple[float, ...], x: np.ndarray, depth: float, feed: float) -> Iterator[str]:
    """Yield a drill cycle over rows in serpentine order."""
    yield f"CYCLE/DRILL,FEDTO,{depth},MMPM,{feed},RAPTO,5.,RTRCTO,40."
    for k, y in enumerate(rows):
        line = x if k % 2 == 0 else x[::-1]
        points, normals = surface(line, np.full(len(line), y))
        yield from (goto(*pair) for pair in zip(points, normals, strict=True))
    yield "CYCLE/OFF"


def trimmed() -> Iterator[str]:
    """Yield the cut along the edge: in from above, along the curve, out."""
    points, normals = surface(np.full(len(EDGE_Y), EDGE_X), EDGE_Y)
    depth = points - 6.0 * normals
    yield "RAPID"
    yield goto(points[0] + SAFE * normals[0], normals[0])
    yield "FEDRAT/300.,MMPM"
    yield goto(depth[0], normals[0])
    yield "FEDRAT/900.,MMPM"
    yield from (goto(*pair) for pair in zip(depth[1:], normals[1:], strict=True))
    yield "RAPID"
    yield goto(points[-1] + SAFE * normals[-1], normals[-1])


def text() -> str:
    """Return the APT file."""
    lines = ["PARTNO/WING PANEL", "UNITS/MM", "MULTAX/ON"]
    lines += ["LOADTL/1", "SPINDL/3200,RPM,CLW", *drilled(SKIN_ROWS, SKIN_X, 6.0, 180.0)]
    lines += ["SPINDL/OFF", "LOADTL/2", "SPINDL/2400,RPM,CLW"]
    lines += [*drilled((0.0,), STRINGER_X, 8.0, 140.0), "SPINDL/OFF"]
    lines += ["LOADTL/3", "SPINDL/12000,RPM,CLW", "COOLNT/AIR", *trimmed()]
    lines += ["COOLNT/OFF", "SPINDL/OFF", "FINI"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the file."""
    CASE.mkdir(parents=True, exist_ok=True)
    (CASE / "panel.apt").write_text(text(), encoding="ascii", newline="")


if __name__ == "__main__":
    main()
