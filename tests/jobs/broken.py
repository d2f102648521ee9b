"""Jobs that are good, broken by one thing at a time; what broke them is known."""

from pathlib import Path

import numpy as np

from postproc.cell import load_cell
from postproc.jobs.convert import ConvertRequest, convert, read_toolpath
from tests.cells import cell_text
from tools.bench.contours import SOLIDS

KINDS = {
    "reach": "the arm does not get to",
    "margin": "joint_margin_deg",
    "singular": "singularity_deg",
    "collision": "'lid' is in the way",
    "clearance": "clearance_mm",
    "axis": 'is "-x"',
    "side": "wrong side",
}
"""What is broken, and words of the sentence that names it."""
MOTION = '[process]\nspindle = "unit"\n[motion]\nfeed_mm_min = 300\n'


def made(folder: Path, *tables, axis="+x", frame=(1700, 0, 700), abc=(0, 0, 0)):
    """Write and load a cell with its part at a frame [mm, deg]."""
    at = tuple(float(v) for v in frame)
    text = cell_text(*tables, MOTION, tool=SOLIDS, origin=at)
    text = text.replace('axis = "+x"', f'axis = "{axis}"')
    where = f"{list(at)}, abc_deg = "
    text = text.replace(f"{where}[0, 0, 0]", f"{where}{list(abc)}")
    (folder / "cell.toml").write_text(text)
    return load_cell(folder / "cell.toml")


def good(folder, cell):
    request = ConvertRequest(str(folder / "holes.csv"), str(folder / "cell.toml"))
    toolpath = read_toolpath(request, cell)
    return convert(request, None, toolpath, cell)


def broken(kind, rng, folder: Path):
    """Return the broken conversion, or None where the draw broke nothing."""
    n = int(rng.integers(3, 9))
    points = rng.uniform(-150, 150, (n, 3)) * [1, 1, 0.2]
    rows = "\n".join(
        f"H{k},{','.join(f'{v:.3f}' for v in p)},0,0,1,8" for k, p in enumerate(points)
    )
    (folder / "holes.csv").write_text(f"id,x,y,z,i,j,k,depth\n{rows}\n")
    x, y = float(rng.integers(1450, 1850)), float(rng.integers(-300, 300))
    frame = (x, y, float(rng.integers(500, 800)))
    if not good(folder, made(folder, frame=frame)).good:
        return None
    if kind == "reach":
        far = float(rng.integers(3500, 4500)) / np.hypot(x, y)
        cell = made(folder, frame=(round(x * far), round(y * far), frame[2]))
    elif kind == "margin":
        cell = made(folder, f"[limits]\njoint_margin_deg = {rng.integers(60, 85)}\n", frame=frame)
    elif kind == "singular":
        cell = made(folder, "[limits]\nsingularity_deg = 89\n", frame=frame)
    elif kind == "clearance":
        box = _box("beam", (frame[0], frame[1], frame[2] + 520))
        cell = made(
            folder, box, f"[limits]\nclearance_mm = {rng.integers(300, 500)}\n", frame=frame
        )
    elif kind == "collision":
        x, y, z = frame
        boxes = [
            _box("post", (x, y + 900, z)),
            _box("lid", (x, y, z + 60)),
            _box("rack", (x + 600, y - 900, z)),
        ]
        cell = made(folder, *boxes, frame=frame)
    elif kind == "axis":
        frame = (x, y, float(rng.integers(-100, 200)))
        if not good(folder, made(folder, frame=frame)).good:
            return None
        cell = made(folder, axis="-x", frame=frame)
    else:  # a panel that stands upright, drilled from the side away from the robot
        frame = (float(rng.integers(1700, 1950)), y, 1000.0)
        if not good(folder, made(folder, frame=frame, abc=(0, -90, 0))).good:
            return None
        cell = made(folder, frame=frame, abc=(180, -90, 0))
    done = good(folder, cell)
    return None if done.good else done


def _box(name, at):
    size = [500, 500, 60] if name == "lid" else [100, 100, 400]
    return (
        f'[[obstacles]]\nname = "{name}"\nbox = {{ size_mm = {size} }}\n'
        f"xyz_mm = {[round(float(v), 1) for v in at]}\n"
    )
