"""What one edit changes of a plan: a hole moved, added, removed, a feed, the base, the tool length.

Panels of holes in a user's cell (``cells``), each edit converted freely and with ``--keep`` of the
program before. Printed are the poses of holes that nobody edited which turned by more than .001
deg, or stand in another arm configuration; and what ``diff`` says first, with its lines.

    python -m tools.bench steady [--sizes 50 1000] [--cell cell] [--arm kuka_kr500_r2830]
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.comparison import diff
from postproc.files import write_files
from postproc.geometry import rotation_angle, rotation_from_abc
from postproc.jobs.convert import Conversion, ConvertRequest, convert
from postproc.units import DEG
from tools.bench.cells import KINDS, holes_file, write_cells
from tools.bench.workload import WORKLOADS

FEED, DEPTH = 600.0, 5.0
"""Of every hole [mm/min, mm]."""
_SAME_DEG = 0.001
_NUMBERS = r"-?\d[^,\]]*"

Holes = dict[str, FloatArray]
"""Id to x, y, z, i, j, k, feed."""


def moved(holes: Holes, cell: str, at: int) -> tuple[Holes, str]:
    """Move one hole by 1.118 mm across its axis."""
    name = list(holes)[at]
    return {**holes, name: holes[name] + [0, 1, 0.5, 0, 0, 0, 0]}, cell


def added(holes: Holes, cell: str, at: int) -> tuple[Holes, str]:
    """Add a hole between two."""
    names = list(holes)
    new = (holes[names[at]] + holes[names[at + 1]]) / 2.0
    new[3:6] /= np.linalg.norm(new[3:6])
    rows = list(holes.items())
    return dict([*rows[: at + 1], ("NEW", new), *rows[at + 1 :]]), cell


def removed(holes: Holes, cell: str, at: int) -> tuple[Holes, str]:
    """Leave one hole out."""
    return {name: row for name, row in holes.items() if name != list(holes)[at]}, cell


def feed(holes: Holes, cell: str, at: int) -> tuple[Holes, str]:
    """Feed slower at one hole."""
    name = list(holes)[at]
    return {**holes, name: holes[name] - [0, 0, 0, 0, 0, 0, 150.0]}, cell


def base(holes: Holes, cell: str, _at: int) -> tuple[Holes, str]:
    """Move the base, as after measuring it anew."""
    return holes, _shifted(cell, "[workpiece]", (5.0, -3.0, 2.0))


def tool(holes: Holes, cell: str, _at: int) -> tuple[Holes, str]:
    """Take a tool 10 mm longer."""
    turned = re.search(rf"\[tool\].*?abc_deg = \[({_NUMBERS}(?:, *{_NUMBERS})*)\]", cell, re.DOTALL)
    if turned is None:
        raise SystemExit("the cell has no tool frame")
    R = rotation_from_abc(DEG * np.array([float(v) for v in turned[1].split(",")]))
    return holes, _shifted(cell, "[tool]", tuple((10.0 * R[:, 2]).tolist()))


Edit = Callable[[Holes, str, int], tuple[Holes, str]]
OF_A_HOLE: tuple[Edit, ...] = (moved, added, removed, feed)
OF_ALL: tuple[Edit, ...] = (base, tool)
PLACES = (1 / 3, 0.05, 0.9)
"""Where in the panel a hole is edited; the first of these also for what concerns all."""


def _shifted(cell: str, table: str, by: tuple[float, ...]) -> str:
    """Return the cell with the frame of a table shifted [mm]."""

    def shift(found: re.Match[str]) -> str:
        values = [float(v) + d for v, d in zip(found[2].split(","), by, strict=True)]
        return f"{found[1]}{', '.join(f'{v:.9g}' for v in values)}]"

    pattern = re.compile(rf"({re.escape(table)}.*?xyz_mm = \[)([^\]]*)\]", re.DOTALL)
    return pattern.sub(shift, cell, count=1)


class Panel:
    """A panel in a folder: its holes, its cell, and the program before the edit."""

    def __init__(self, size: int, kind: str, arm: str, folder: Path, workloads: Path) -> None:
        self.folder = folder
        write_cells(folder, workloads)
        rows = np.loadtxt(holes_file(size, folder, workloads), delimiter=",", skiprows=1)
        self.holes = {f"H{k + 1}": np.append(row, FEED) for k, row in enumerate(rows)}
        self.cell = (folder / f"{kind}.toml").read_text(encoding="utf-8")
        self.cell = re.sub(r'"kuka_\w+"', f'"{arm}"', self.cell)
        self.before = self.made("before", self.holes, self.cell)

    def made(self, name: str, holes: Holes, cell: str, keep: str | None = None) -> Conversion:
        """Convert holes in a cell to the program of a folder."""
        source, where = self.folder / "panel.csv", self.folder / "here.toml"
        lines = (f"{n}," + ",".join(f"{v:.9g}" for v in row) for n, row in holes.items())
        text = "id,x,y,z,i,j,k,feed,depth\n" + "".join(f"{line},{DEPTH}\n" for line in lines)
        source.write_text(text, encoding="utf-8")
        where.write_text(cell, encoding="utf-8")
        done = convert(ConvertRequest(str(source), str(where), keep=keep))
        if not done.good:
            raise SystemExit(f"{name}: {[f.message for f in done.findings if f.is_error][:3]}")
        write_files({self.folder / name / file: data for file, data in done.files.items()})
        return done

    def rows(self) -> Iterator[str]:
        """Yield a line for each edit and way to plan."""
        every = [(edit, place) for edit in OF_A_HOLE for place in PLACES]
        for edit, place in [*every, *((edit, PLACES[0]) for edit in OF_ALL)]:
            holes, cell = edit(self.holes, self.cell, int(place * len(self.holes)))
            for keep in (None, str(self.folder / "before")):
                after = self.made("after", holes, cell, keep)
                said = diff(self.folder / "before", self.folder / "after").summary().splitlines()
                share = 100.0 * self.changed(after, _edited(self.holes, holes))
                how = f"{len(self.holes):>5} {edit.__name__:>8} {place:4.2f} "
                how += "keep" if keep else "free"
                yield f"{how} {share:6.2f} % {len(said):>3}  {said[0]}"

    def changed(self, after: Conversion, edited: set[str]) -> float:
        """Return the share of poses not edited that changed."""
        old, new = _poses(self.before), _poses(after)
        same = [name for name in old if name in new and name not in edited]
        turn = rotation_angle(*(np.array([of[n][0] for n in same]) for of in (old, new)))
        other = np.array([old[n][1] != new[n][1] for n in same])
        return float(((turn > _SAME_DEG * DEG) | other).mean())


def _edited(old: Holes, new: Holes) -> set[str]:
    """Return the ids of what was added, removed or changed."""
    both = old.keys() & new.keys()
    return (old.keys() ^ new.keys()) | {n for n in both if not np.array_equal(old[n], new[n])}


def _poses(made: Conversion) -> dict[str, tuple[FloatArray, int]]:
    """Return the orientation (3, 3) in the base and the branch of each tag by its id."""
    plan, names = made.plan, made.plan.toolpath.tag_name
    last = {tag: row for row, tag in enumerate(plan.tag.tolist()) if tag >= 0}
    at = plan.T_base_tcp[:, :3, :3]
    return {names(tag): (np.asarray(at[row]), int(plan.branch[row])) for tag, row in last.items()}


def main() -> None:
    """Read the arguments, measure, print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workloads", type=Path, default=WORKLOADS)
    parser.add_argument("--sizes", type=int, nargs="*", default=[50, 1000])
    parser.add_argument("--cell", choices=KINDS, default="cell")
    parser.add_argument("--arm", default="kuka_kr500_r2830")
    arguments = parser.parse_args()
    print("holes     edit   at  how changed  lines and the first of diff")
    for size in arguments.sizes:
        with tempfile.TemporaryDirectory() as name:
            where = Path(name), arguments.workloads
            for line in Panel(size, arguments.cell, arguments.arm, *where).rows():
                print(line, flush=True)


if __name__ == "__main__":
    main()
