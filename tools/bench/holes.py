"""Measure drilling as users run it: the whole of ``postproc convert``, defaults on.

    python -m tools.bench holes [--sizes 1000 10000] [--hard 10000] [--other CHECKOUT]

Each case is one command in a process of its own, from start of Python to the files that land:
read, plan with the default objective, write, lint, run the text, compare, strokes swept. The cell
is a user's (``cells``): the arm with its default solids, a panel of 4,096 triangles, eight
fixtures; ``hard`` has four beams between robot and panel; ``fine`` is the same panel as 262,144
triangles, ``clamps`` has ten clamps of 20,000 beside it, both with the first of the sizes, and so
has ``boxes``: the first cell with boxes as the links of the arm, which no user has. ``--other``
names another checkout, of the last release for instance, that runs the same cases in turn with this
one; then the ratios count, whatever else the machine does, and whether the files are the same.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from postproc.cell import MeshPlacement
from postproc.geometry import kuka_from_transform
from tests.cells import STIFFNESS
from tools.bench.cells import holes_file, write_cells
from tools.bench.workload import WORKLOADS, workload_cell

_NOT_A_USERS = ("PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED")
ROOT = Path(__file__).resolve().parents[2]
SIZES = (1000, 10000)
BOXES = "boxes"
"""The cell whose arm is made of boxes."""


class Used(NamedTuple):
    """Processor time [s] and peak memory [MiB] of a command; program files, None: it fails."""

    cpu: float
    mb: float
    files: dict[str, bytes] | None


def cell_file(target: Path, *, hard: bool = False, folder: Path = WORKLOADS) -> Path:
    """Write the scene of the workloads as the cell file of a user; keys that it needs, no more."""
    cell = workload_cell(hard, folder=folder)
    links = [("robot.link_meshes", solid, f"link = {i}\n") for i, solid in cell.robot.link_meshes]
    rest = [("workpiece.meshes", solid, "") for solid in cell.workpiece.meshes]
    rest += [("obstacles", solid, "") for solid in cell.obstacles]
    tools = [("tool.meshes", solid, "") for solid in cell.tool.meshes]
    text = (
        'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'
        f"{''.join(map(_solid, links))}[tool]\n"
        f'frame = {_placement(cell.tool.T_flange_tcp)}\naxis = "+z"\n'
        f"{''.join(map(_solid, [*tools, *rest]))}{STIFFNESS}"
        '[motion]\nfeed_mm_min = 600\npoints = "touch"\n'
    )
    target.write_text(text, encoding="utf-8")
    return target


def _solid(item: tuple[str, MeshPlacement, str]) -> str:
    table, solid, more = item
    place = _placement(solid.T_owner_mesh).strip("{} ").replace(", abc", "\nabc")
    return (
        f'[[{table}]]\nname = "{solid.name}"\nfile = "{solid.file}"\nscale = 1000\n{place}\n{more}'
    )


def _placement(T: np.ndarray) -> str:
    xyz, abc = (np.round(values, 9) + 0.0 for values in kuka_from_transform(T))
    return f"{{ xyz_mm = {xyz.tolist()}, abc_deg = {abc.tolist()} }}"


def converted(source: Path, cell: Path, folder: Path, checkout: Path = ROOT) -> Used:
    """Return what ``convert`` of a checkout uses, as in the second call of a user.

    The first call, of a few holes, compiles the modules, whatever their names are.

    Args:
        source: the holes.
        cell: cell file.
        folder: of the program, and of compiled modules.
        checkout: whose code is run.
    """
    environment = {key: value for key, value in os.environ.items() if key not in _NOT_A_USERS}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment |= {"PYTHONPATH": str(checkout), "PYTHONPYCACHEPREFIX": str(folder / "compiled")}
    few = folder / "few.csv"
    with source.open(encoding="utf-8") as lines:
        few.write_text("".join(islice(lines, 4)), encoding="utf-8")
    with (folder / "said.txt").open("wb") as said:
        for holes in (few, source):
            words = ["convert", str(holes), "--cell", str(cell), "-o", str(folder / "out")]
            done = subprocess.Popen(
                [sys.executable, "-m", "postproc", *words, "--quiet"],
                env=environment,
                cwd=folder,
                stderr=said,
            )
            _, status, used = os.wait4(done.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        raise SystemExit((folder / "said.txt").read_text(encoding="utf-8"))
    written = {file.name: file.read_bytes() for file in sorted((folder / "out").glob("*.[sd]*"))}
    return Used(used.ru_utime, used.ru_maxrss / 1024.0, written if code == 0 else None)


def measured(
    size: int, kind: str, other: Path | None = None, workloads: Path = WORKLOADS
) -> tuple[Used, Used | None]:
    """Return what one case uses here and, right after, in another checkout."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if kind == BOXES:
            cell = cell_file(folder / "boxes.toml", folder=workloads)
        else:
            write_cells(folder, workloads)
            cell = folder / f"{kind}.toml"
        source = holes_file(size, folder, workloads)
        own = converted(source, cell, folder)
        return own, None if other is None else converted(source, cell, folder, other)


def main() -> None:
    """Read the arguments, measure, print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workloads", type=Path, default=WORKLOADS)
    parser.add_argument("--sizes", type=int, nargs="*", default=list(SIZES))
    parser.add_argument("--hard", type=int, nargs="*", default=[SIZES[-1]])
    parser.add_argument("--other", type=Path, metavar="CHECKOUT")
    arguments = parser.parse_args()
    cases = [(size, "cell") for size in arguments.sizes]
    cases += [(size, "hard") for size in arguments.hard]
    kinds = ["fine", "clamps", *([BOXES] if arguments.workloads.is_dir() else [])]
    cases += [(size, kind) for size in arguments.sizes[:1] for kind in kinds]
    print(f"{'cell':>7}{'holes':>7}{'cpu s':>8}{'MB':>6}{'other: cpu s':>14}{'MB':>6}{'ratio':>7}")
    for size, kind in cases:
        own, other = measured(size, kind, arguments.other, arguments.workloads)
        line = f"{kind:>7}{size:>7}{own.cpu:>8.2f}{own.mb:>6.0f}"
        if other is not None:
            line += f"{other.cpu:>14.2f}{other.mb:>6.0f}{own.cpu / other.cpu:>7.2f}"
            line += "" if own.files == other.files else "  files differ"
        print(line if own.files is not None else f"{line}  no program", flush=True)


if __name__ == "__main__":
    main()
