"""Measure planning: time, memory and cost against known optima; strategies side by side.

    python -m tools.bench planning search  [--workloads DIR] [--sizes 1000 10000]
                                           [--kinds base turns hard] [--panel-triangles 20000]
                                           [--peer PYTHON]
    python -m tools.bench planning scale   [--workloads DIR] [--strokes]
    python -m tools.bench planning compare [--nx FILE]

``search`` runs the workloads with their scene (spin 36 x 10 deg, all branches, collision) twice:
with the poses at the holes checked, of which the optima are published, and with whole strokes of
50 mm swept, which is what ``postproc convert`` does. Printed are wall and CPU time of all of
planning (scene, search, refinement, detours, times), that of the search and of the route, peak
memory, how many states were checked, the cost of the best sequence on the grid, how far it is from
the optimum of poses alone [%], and the cost after refinement. With swept strokes the hard scene's
optimum is out of reach: more states collide. ``--panel-triangles`` subdivides the panel, same
shape, until it has at least so many. ``--peer`` names an interpreter that has
``tesseract-robotics``: its ladder planner runs on the same files beside (``tesseract.py``).
``scale`` repeats the largest workload, up to 100,000 tags.
``compare`` plans milling lines with each strategy.

Every case runs in a process of its own, so that its peak memory is its own.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from postproc.cell import Cell, parse_cell
from postproc.model import MotionKind, ToolPath
from postproc.planning import plan
from postproc.readers import ReadOptions, read
from postproc.units import DEG, MM, N_PER_MM
from tests.cells import STIFFNESS, cell_text
from tools.bench.harness import alone, peak_mb, spent
from tools.bench.paths import bare_path
from tools.bench.workload import WORKLOADS, holes, workload_cell

OPTIMA = {
    ("base", 200): 7.5865,
    ("base", 1000): 9.2567,
    ("base", 10000): 25.6536,
    ("turns", 200): 4.3059,
    ("turns", 1000): 5.2435,
    ("turns", 10000): 11.7092,
    ("hard", 200): 35.6826,
    ("hard", 1000): 60.4997,
    ("hard", 10000): 271.0207,
}
"""Sum of squared joint steps [rad^2] of the exact optimum, from the workloads' own page.

Solids may come as near as they like there; plans keep 0.3 mm, which costs 0.001 %."""
PEER_MOST = 1000
"""Holes that the peer is asked for at most: it takes about 7 MB for each."""


def repeated(size: int, repeat: int, folder: Path) -> ToolPath:
    """Return a workload's holes, forth and back so many times."""
    points, normals = holes(size, folder)
    order = np.arange(len(points))
    rows = np.concatenate([order if k % 2 == 0 else order[::-1] for k in range(repeat)])
    axes = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    name = f"workload_{size}"
    return bare_path(name, points[rows], axes[rows], feed=0.01, kind=MotionKind.HOLE)


def subdivided(source: Path, triangles: int, folder: Path) -> Path:
    """Return a mesh file of the same shape with at least so many triangles."""
    import trimesh

    mesh = trimesh.load_mesh(source)
    while len(mesh.faces) < triangles:
        mesh = mesh.subdivide()
    target = folder / source.name
    mesh.export(target)
    return target


def run_search(arguments: argparse.Namespace) -> None:
    """Plan one workload and print one JSON line."""
    with tempfile.TemporaryDirectory() as folder:
        panel = arguments.workloads / "scene" / "panel.stl"
        if arguments.panel_triangles:
            panel = subdivided(panel, arguments.panel_triangles, Path(folder))
        _search_in(arguments, panel)


def _search_in(arguments: argparse.Namespace, panel: Path) -> None:
    folder, kind = arguments.workloads, arguments.kind
    approach_mm = 50.0 if arguments.strokes else 0.0
    cell = workload_cell(
        kind == "hard", panel, turns=kind == "turns", approach_mm=approach_mm, folder=folder
    )
    toolpath = repeated(arguments.size, arguments.repeat, folder)
    with spent() as used:
        result = plan(toolpath, cell)
    record = dict(result.settings)
    print(
        json.dumps(
            {
                "wall_s": used.wall,
                "cpu_s": used.cpu,
                "stages": record["timing"],
                "mb": peak_mb(),
                "tags": len(toolpath),
                "errors": len(result.errors),
                "rounds": record["rounds"],
                "checked": record["checked"],
                "grid_rad2": record.get("travel_rad2_grid"),
                "refined_rad2": record["travel_rad2"],
            }
        )
    )


def table_search(arguments: argparse.Namespace) -> None:
    """Print the table of workloads."""
    head = ("checked", "scene", "tags", "wall s", "cpu s", "search", "route", "MB", "states")
    more = ("failed", "grid", "off %", "refined")
    print(("{:>9}" + "{:>7}" * 8).format(*head) + ("{:>7}" + "{:>10}{:>7}{:>10}").format(*more))
    for strokes in (False, True):
        for kind in arguments.kinds:
            for size in arguments.sizes:
                flags = ["--kind", kind, "--size", str(size)] + ["--strokes"] * strokes
                flags += ["--panel-triangles", str(arguments.panel_triangles)]
                r = alone("planning", "one", "--workloads", str(arguments.workloads), *flags)
                off = 100.0 * (r["grid_rad2"] / OPTIMA.get((kind, size), float("nan")) - 1.0)
                print(
                    f"{'strokes' if strokes else 'poses':>9}{kind:>7}{size:>7}"
                    f"{r['wall_s']:>7.2f}{r['cpu_s']:>7.2f}{r['stages']['search']:>7.2f}"
                    f"{r['stages']['route']:>7.2f}{r['mb']:>7.0f}{r['checked']:>7.0f}"
                    f"{r['errors']:>7.0f}{r['grid_rad2']:>10.4f}{off:>7.3f}"
                    f"{r['refined_rad2']:>10.4f}",
                    flush=True,
                )
    if arguments.peer:
        _peer_rows(arguments)


def _peer_rows(arguments: argparse.Namespace) -> None:
    script = str(Path(__file__).with_name("tesseract.py"))
    for size in arguments.sizes:
        if size > PEER_MOST:
            print(
                f"tesseract-robotics base {size}: left out, it would need {7 * size / 1000:.0f} GB"
            )
            continue
        r = alone(script, str(arguments.workloads), str(size), python=arguments.peer)
        print(
            f"tesseract-robotics base {size}: {r['wall_s']:.2f} s wall, {r['cpu_s']:.2f} s cpu, "
            f"{r['mb']:.0f} MB, {r['rad2']:.4f} rad^2",
            flush=True,
        )


def table_scale(arguments: argparse.Namespace) -> None:
    """Print time and memory over the number of tags."""
    for size, repeat in ((1000, 1), (10000, 1), (10000, 3), (10000, 10)):
        flags = ["--kind", "base", "--size", str(size), "--repeat", str(repeat)]
        flags += ["--strokes"] * arguments.strokes
        r = alone("planning", "one", "--workloads", str(arguments.workloads), *flags)
        per = 1e3 * r["cpu_s"] / r["tags"]
        print(
            f"{r['tags']:>7} tags {r['wall_s']:>8.2f} s wall {r['cpu_s']:>8.2f} s cpu "
            f"{per:.3f} ms a tag {r['mb']:.0f} MB",
            flush=True,
        )


def paper_line(x: float, y: float, z: float) -> ToolPath:
    """Return a cut parallel to y at nine tags, the paper's kind of line; tool looks along +x."""
    n = 9
    points = np.stack([np.full(n, x), np.linspace(-y, y, n), np.full(n, z)], axis=1) * MM
    return bare_path("line", points, (-1.0, 0.0, 0.0), feed=0.02)


def line_cell(
    head: tuple[float, float],
    objective: str,
    index: str,
    origin: tuple[float, float, float] = (0, 0, 0),
) -> Callable[[str], Cell]:
    """Return what makes the cell of the paper's arm from further keys of ``[optimize]``.

    Args:
        head: its TCP below and ahead of the flange [mm], the flange down at spin 0.
        objective: of the spin about the tool axis.
        index: of the stiffness.
        origin: CAM coordinates in the robot root [mm].
    """
    below, ahead = head
    wishes = f'[optimize]\nobjective = "{objective}"\nindex = "{index}"\nrange_deg = [-90, 90]\n'

    def cell(keys: str) -> Cell:
        text = cell_text(
            STIFFNESS, wishes + keys, tcp=(ahead, 0, below), tcp_abc=(0, 0, 180), origin=origin
        )
        return parse_cell(text.encode(), "line.toml")

    return cell


def table_compare(arguments: argparse.Namespace) -> None:
    """Print the strategies side by side."""
    jobs = [
        ("214,116 1680", paper_line(1680, 555, 508), line_cell((214, 116), "normal", "compliance")),
        ("362,107 1889", paper_line(1889, 156, 133), line_cell((362, 107), "normal", "compliance")),
        ("214,116 kv", paper_line(1680, 555, 508), line_cell((214, 116), "normal", "ellipsoid")),
        ("362,107 kv", paper_line(1889, 156, 133), line_cell((362, 107), "normal", "ellipsoid")),
    ]
    if arguments.nx and not Path(arguments.nx).exists():
        print(f"{arguments.nx}: not there, left out")
    elif arguments.nx:
        toolpath = read(arguments.nx, options=ReadOptions(tool_axis=(1.0, 0.0, 0.0)))
        middle = 0.5 * (toolpath.points.min(axis=0) + toolpath.points.max(axis=0))
        x, y, z = ((np.array([1.9, 0.0, 0.9]) - middle) / MM).tolist()
        cell = line_cell((362, 107), "axial", "compliance", (x, y, z))
        jobs.append((Path(arguments.nx).stem, toolpath, cell))
    plan(jobs[0][1], jobs[0][2](""))  # imports and tables made once are no planning time
    print(
        "k: stiffness of the objective [N/mm]; loss [%] against each tag's own optimum on the grid"
    )
    print("of turns, below 0 where a turn between the grid is better; travel: all joints summed")
    head = f"{'job':>14}{'strategy':>14}{'mean k':>8}{'min k':>7}{'loss':>7}{'worst':>7}"
    head += f"{'travel deg':>11}{'rad^2':>8}{'step deg':>9}{'cycle s':>8}{'plan s':>7}{'errors':>7}"
    print(head)
    for name, toolpath, cell in jobs:
        _compare(name, toolpath, cell)


STRATEGIES = (
    ("each", 'strategy = "each"\n'),
    (
        "paper smooth",
        'strategy = "smooth"\nrefine = false\nloss_bound_percent = 100\nkey_every_mm = 1e5\n',
    ),
    ("smooth", 'strategy = "smooth"\n'),
    ("global", 'strategy = "global"\n'),
)
"""Name and keys; paper smooth: as Jiao et al. 2022, fixed interpolation between key tags of which
each takes its own optimum, none added."""


def _compare(name: str, toolpath: ToolPath, cell: Callable[[str], Cell]) -> None:
    """Print one line per strategy, and the loss of every tag where they are few."""
    rows, best = [], np.zeros(0)
    for label, keys in STRATEGIES:
        with spent() as used:
            result = plan(toolpath, cell(keys))
        if "smooth" in keys:
            # the record's own losses are against the optimum of every tag by itself
            lost = 1.0 - np.array(result.settings["loss"])
            best = result.stiffness / lost
        rows.append((label, result, used.cpu))
    for label, result, took in rows:
        loss, k = 100.0 * (1.0 - result.stiffness / best), result.stiffness / N_PER_MM
        turned = np.abs(np.diff(result.q, axis=0)) / DEG
        path = result.kind[1:] > 0
        print(
            f"{name:>14}{label:>14}{np.nanmean(k):>8.0f}{np.nanmin(k):>7.0f}"
            f"{np.nanmean(loss):>7.2f}{np.nanmax(loss):>7.1f}{turned.sum():>11.1f}"
            f"{np.square(turned * DEG).sum():>8.3f}{turned[path].max():>9.2f}"
            f"{result.duration.sum():>8.1f}{took:>7.2f}{len(result.errors):>7}",
            flush=True,
        )
    if len(toolpath) <= 20:
        for label, result, _ in rows:
            losses = " ".join(f"{v:6.1f}" for v in 100.0 * (1.0 - result.stiffness / best))
            print(f"{'':>14}{label:>14}  loss by tag {losses}")


def main() -> None:
    """Run the part that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parts = parser.add_subparsers(dest="part", required=True)
    for name in ("search", "scale", "one"):
        part = parts.add_parser(name)
        part.add_argument("--workloads", type=Path, default=WORKLOADS)
    kinds = ["base", "turns", "hard"]
    parts.choices["search"].add_argument("--sizes", type=int, nargs="+", default=[200, 1000, 10000])
    parts.choices["search"].add_argument("--kinds", nargs="+", choices=kinds, default=kinds)
    parts.choices["search"].add_argument("--peer", metavar="PYTHON")
    one = parts.choices["one"]
    for part in (parts.choices["search"], one):
        part.add_argument("--panel-triangles", type=int, default=0, metavar="N")
    one.add_argument("--kind", default="base")
    one.add_argument("--size", type=int, default=200)
    one.add_argument("--repeat", type=int, default=1)
    for part in (parts.choices["scale"], one):
        part.add_argument("--strokes", action="store_true")
    parts.add_parser("compare").add_argument("--nx")
    arguments = parser.parse_args()
    {
        "search": table_search,
        "scale": table_scale,
        "one": run_search,
        "compare": table_compare,
    }[arguments.part](arguments)
