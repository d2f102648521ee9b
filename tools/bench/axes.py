"""Hard cases with external axes: cuts carried by a table, places in reach by a little, walls."""

from __future__ import annotations

import numpy as np

from postproc.cell import Cell, parse_cell
from postproc.model import MotionKind, ToolPath
from tests.cells import STIFFNESS, cell_text
from tools.bench.paths import bare_path

Made = tuple[ToolPath, Cell]


def _made(path: ToolPath, axis: str, *tables: str, origin: tuple[float, float, float]) -> Made:
    text = cell_text(f'[[external_axes]]\nname = "E1"\n{axis}', STIFFNESS, *tables, origin=origin)
    return path, parse_cell(text.encode(), "cell.toml")


def _table(x: float, z: float, half: float) -> str:
    """Return a table that turns either way from where it stands [mm, deg]."""
    place = f'kind = "positioner"\naxis = "+z"\nxyz_mm = [{x}, 0, {z}]\n'
    return f"{place}range_deg = [-{half}, {half}]\nspeed_deg_s = 30\n"


def _rail(half: float, speed: float) -> str:
    return f'kind = "rail"\naxis = "+y"\nrange_mm = [-{half}, {half}]\nspeed_mm_s = {speed}\n'


def _circle(angle: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)


def rim() -> Made:
    """Return a leaning cut round a part on a table: held, the arm gives way on its far side."""
    out = _circle(np.linspace(-np.pi, np.pi, 121))
    points = np.vstack([0.28 * out[:1], 0.25 * out, 0.28 * out[-1:]])
    axes = (out[np.r_[0, 0:121, 120]] + [0.0, 0.0, 1.0]) / np.sqrt(2.0)
    kind = np.full(123, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    path = bare_path("rim", points, axes, feed=0.025, kind=kind)
    return _made(path, _table(2000, 800, 189), origin=(2000, 0, 800))


def ring() -> Made:
    """Return holes round a table that reach the arm only within few degrees of its turn."""
    points = 0.4 * _circle(np.radians(15.0 + 60.0 * np.arange(6)))
    path = bare_path("ring", points, [0.0, 0.0, 1.0], feed=0.01, kind=MotionKind.HOLE)
    wishes = "[optimize]\nstep_deg = 30\n"
    return _made(path, _table(3854.8, 500, 180), wishes, origin=(3854.8, 0, 700))


def walled() -> Made:
    """Return a hole behind a wall that a rail leads past."""
    path = bare_path("hole", np.zeros((1, 3)), [-1.0, 0.0, 0.0], feed=0.01, kind=MotionKind.HOLE)
    size = "box = { size_mm = [200, 1400, 2400] }\nxyz_mm = [1000, 0, 1200]\n"
    wall = f'[[obstacles]]\nname = "wall"\n{size}'
    return _made(path, _rail(3000, 1000), wall, origin=(1900, 0, 1000))


def slow_rail() -> Made:
    """Return a cut longer than the reach, along which a slow rail must move all the time."""
    y = np.linspace(-3.0, 3.0, 121)
    points = np.stack([0.05 * np.sin(2.0 * y), y, 0.05 * np.cos(3.0 * y)], axis=1)
    axes = np.stack([-np.ones(121), 0.2 * np.sin(y), 0.1 * np.cos(2.0 * y)], axis=1)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    kind = np.full(121, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    path = bare_path("edge", points, axes, feed=0.05, kind=kind)
    return _made(path, _rail(3500, 20), origin=(1900, 0, 1000))
