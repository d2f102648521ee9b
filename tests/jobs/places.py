"""Random drilled parts of which a place is known where the whole job can be run."""

from pathlib import Path

import numpy as np

from postproc.cell import load_cell
from postproc.geometry import transform_from_kuka
from postproc.jobs.convert import ConvertRequest, convert, read_toolpath
from tests.cells import STIFFNESS, cell_text

ROBOTS = ("kuka_kr500_r2830", "kuka_kr210_r2700_2", "kuka_kr6_r900_2")


def part(rng, folder: Path):
    """Return cell, toolpath, box [mm] and a frame in it where the job is good.

    The cell itself has the part far away.
    """
    robot = ROBOTS[int(rng.integers(len(ROBOTS)))]
    size = 0.32 if "kr6" in robot else 1.0
    tool = (round(107.0 * size, 1), 0.0, round(362.0 * size, 1))
    n = int(rng.integers(3, 8))
    points = rng.uniform(-1.0, 1.0, (n, 3)) * np.array([500.0, 400.0, 60.0]) * size
    lean = np.column_stack([rng.normal(size=(n, 2)) * 0.15, np.ones(n)])
    axes = lean / np.linalg.norm(lean, axis=1, keepdims=True)
    rows = "\n".join(
        f"H{k},{','.join(f'{v:.3f}' for v in points[k])},{','.join(f'{v:.6f}' for v in axes[k])},8"
        for k in range(n)
    )
    (folder / "holes.csv").write_text(f"id,x,y,z,i,j,k,depth\n{rows}\n")
    post = rng.uniform(-1.0, 1.0, 2) * 900.0 * size
    extra = (
        f'[[obstacles]]\nname = "post"\nbox = {{ size_mm = [150, 150, {1600 * size:.0f}] }}\n'
        f"xyz_mm = [{1300 * size + abs(post[0]):.0f}, {post[1]:.0f}, {800 * size:.0f}]\n"
    )
    turn = [float(rng.integers(-180, 180)), float(rng.choice([0, 0, -60, 45])), 0.0]
    text = cell_text(
        STIFFNESS if "500" in robot else "",
        '[process]\nspindle = "unit"\n',
        extra,
        "[motion]\nfeed_mm_min = 300\n",
        robot=robot,
        tcp=tool,
    )
    text = text.replace("abc_deg = [0, 0, 0] }\n[", f"abc_deg = {turn} }}\n[")
    (folder / "cell.toml").write_text(text.replace("[1700, 0, 700]", "[9000, 9000, 0]"))
    cell = load_cell(folder / "cell.toml")
    toolpath = read_toolpath(ConvertRequest(str(folder / "holes.csv"), cell.path), cell)
    for _ in range(60):
        xyz = rng.uniform([700, -1400, 0], [2600, 1400, 1700]) * size
        T = transform_from_kuka(np.round(xyz), turn)
        here = cell.rebased(lambda _, T=T: T)
        made = convert(ConvertRequest(toolpath.path, cell.path), None, toolpath, here)
        if made.good:
            low = xyz - rng.uniform(0.0, 1500.0, 3) * size
            return cell, toolpath, np.round([*low, *(xyz + rng.uniform(0.0, 1500.0, 3) * size)]), T
    return None
