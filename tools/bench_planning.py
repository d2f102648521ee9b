"""Measure planning: time, memory and cost against known optima; strategies side by side.

    python tools/bench_planning.py search  --workloads DIR [--sizes 1000 10000]
                                           [--kinds base turns hard] [--panel-triangles 20000]
                                           [--peer PYTHON]
    python tools/bench_planning.py scale   --workloads DIR [--strokes]
    python tools/bench_planning.py compare [--nx FILE]

``search`` runs the workloads with their scene (spin 36 x 10 deg, all branches, collision) twice:
with the poses at the holes checked, of which the optima are published, and with whole strokes of
50 mm swept, which is what ``postproc convert`` does. Printed are wall and CPU time of all of
planning (scene, search, refinement, detours, times), that of the search and of the route, peak
memory, how many states were checked, the cost of the best sequence on the grid, how far it is from
the optimum of poses alone [%], and the cost after refinement. With swept strokes the hard scene's
optimum is out of reach: more states collide. ``--panel-triangles`` subdivides the panel, same
shape, until it has at least so many. ``--peer`` names an interpreter that has
``tesseract-robotics``: its ladder planner runs on the same files beside (``bench_tesseract.py``).
``scale`` repeats the largest workload, up to 100,000 tags.
``compare`` plans milling lines with each strategy.

Every case runs in a process of its own, so that its peak memory is its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.cell.cell import (
    Cell,
    Limits,
    MeshPlacement,
    OpwGeometry,
    Process,
    Robot,
    Tool,
    Workpiece,
)
from postproc.cell.choices import Strategy
from postproc.cell.options import krl_of, motion_of, optimize_of
from postproc.cell.robotfile import load_robot
from postproc.cell.schema import KrlTable, MotionTable, OptimizeTable
from postproc.geometry.frames import rotation_x, transform
from postproc.model.toolpath import MotionKind, ToolPath
from postproc.planning.planner import plan
from postproc.units import DEG, MM, N_PER_MM

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
"""Sum of squared joint steps [rad^2] of the exact optimum, from the workloads' own page."""
PEER_MOST = 1000
"""Holes that the peer is asked for at most: it takes about 7 MB for each."""
STIFFNESS = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
"""[N*m/rad], Jiao et al. 2022, no grid."""


def scene_cell(folder: Path, kind: str, *, strokes: bool, panel: Path | None = None) -> Cell:
    """Return the workload's cell; ``kind``: base, turns or hard; ``panel``: another mesh of it."""
    scene = folder / "scene"
    data = json.loads((scene / "scene.json").read_text())
    size = data["robot"]
    limits = np.array(size["limits_deg"]) * DEG
    geometry = OpwGeometry(
        size["a1"], -size["a3"], 0.0, size["d1"], size["a2"], size["d4"], size["d6"],
        np.array(size["axis_signs"]), np.array([0.0, -90.0, 0, 0, 0, 0]) * DEG,
    )  # fmt: skip
    forearm = transform(np.eye(3), [size["d4"], 0.0, 0.0])

    def solids(names: list[str], T: np.ndarray) -> list[MeshPlacement]:
        return [MeshPlacement(n[:-4], T, file=scene / n, scale=1.0) for n in names]

    links = tuple(
        (i, solid)
        for i in range(7)
        for solid in solids(data["files"][f"link{i}"], forearm if i == 4 else np.eye(4))
    )
    robot = Robot(
        "workload", geometry, limits[:, 0], limits[:, 1],
        np.array([69.0, 69, 69, 77, 76, 120]) * DEG, np.array([1.4, 1.2, 1.2, 3.0, 3.0, 4.0]),
        np.eye(4), link_meshes=links,
    )  # fmt: skip
    T_flange_tcp = np.array(data["flange_to_tcp"])
    T_flange_link6 = T_flange_tcp @ np.linalg.inv(np.array(data["link6_to_tcp"]))
    tool = Tool(
        1, "spindle", T_flange_tcp, np.array([0.0, 0, 1.0]),
        meshes=tuple(solids(data["files"]["tool"], T_flange_link6)),
    )  # fmt: skip
    table = MotionTable(feed_mm_min=600.0)
    more = data["hard_extra_obstacles"] if kind == "hard" else []
    return Cell(
        name="workload",
        path="workload",
        robot=robot,
        tool=tool,
        workpiece=Workpiece(
            1,
            np.eye(4),
            (MeshPlacement("panel", np.eye(4), file=panel or scene / "panel.stl", scale=1.0),),
        ),
        obstacles=tuple(solids([*data["files"]["obst"], *more], np.eye(4))),
        limits=Limits(0.0, 0.0, 0.0, np.inf),
        optimize=optimize_of(OptimizeTable(objective={"travel": 1.0}, turns=kind == "turns")),
        process=Process(np.zeros(6)),
        motion=motion_of(table if strokes else table.model_copy(update={"approach_mm": 0.0})),
        krl=krl_of(KrlTable()),
    )


def holes(path: Path, repeat: int = 1) -> ToolPath:
    """Return a workload's holes; repeated forth and back to make a longer one."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows = np.concatenate([rows if k % 2 == 0 else rows[::-1] for k in range(repeat)])
    n = len(rows)
    axes = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    none = np.full(n, -1)
    return ToolPath(
        path.name, path.stem, "csv", "csv", "mm", rows[:, :3] * MM, axes,
        np.full(n, MotionKind.HOLE), np.full(n, 0.01), np.arange(n) + 2, none, none, none, none,
    )  # fmt: skip


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
    cell = scene_cell(arguments.workloads, arguments.kind, strokes=arguments.strokes, panel=panel)
    toolpath = holes(arguments.workloads / f"workload_{arguments.size}.csv", arguments.repeat)
    cpu, wall = time.process_time(), time.perf_counter()
    result = plan(toolpath, cell)
    record = dict(result.settings)
    print(
        json.dumps(
            {
                "wall_s": time.perf_counter() - wall,
                "cpu_s": time.process_time() - cpu,
                "stages": record["timing"],
                "mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
                "tags": len(toolpath),
                "errors": len(result.errors),
                "rounds": record["rounds"],
                "checked": record["checked"],
                "grid_rad2": record["travel_rad2_grid"],
                "refined_rad2": record["travel_rad2"],
            }
        )
    )


def case(*arguments: str) -> dict[str, float]:
    """Run one case in a process of its own and return what it printed."""
    command = [sys.executable, __file__, "one", *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return result


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
                r = case("--workloads", str(arguments.workloads), *flags)
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
    script = Path(__file__).with_name("bench_tesseract.py")
    for size in arguments.sizes:
        if size > PEER_MOST:
            print(
                f"tesseract-robotics base {size}: left out, it would need {7 * size / 1000:.0f} GB"
            )
            continue
        command = [arguments.peer, str(script), str(arguments.workloads), str(size)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        r = json.loads(done.stdout.splitlines()[-1])
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
        r = case("--workloads", str(arguments.workloads), *flags)
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
    none = np.full(n, -1)
    kind = np.full(n, MotionKind.LINEAR)
    return ToolPath(
        "line", "line", "apt", "apt", "mm", points, np.tile([-1.0, 0, 0], (n, 1)), kind,
        np.full(n, 0.02), np.arange(n) + 1, none, none, none, none,
    )  # fmt: skip


def line_cell(head: tuple[float, float], objective: str, index: str) -> Cell:
    """Return the arm of the paper with its TCP below and ahead of the flange (mm)."""
    below, ahead = head
    robot = replace(load_robot("kuka_kr500_r2830"), joint_stiffness=STIFFNESS)
    T = transform(rotation_x(np.pi), np.array([ahead, 0.0, below]) * MM)  # flange down at spin 0
    return Cell(
        "line", "line", robot, Tool(1, "spindle", T, np.array([1.0, 0, 0])),
        Workpiece(1, np.eye(4)), (), Limits(2.0 * DEG, 5.0 * DEG, 0.0, np.inf),
        optimize_of(OptimizeTable(objective=objective, index=index, range_deg=[-90.0, 90.0])),
        Process(np.zeros(6)), motion_of(MotionTable(feed_mm_min=1200.0)), krl_of(KrlTable()),
    )  # fmt: skip


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
        from postproc.readers.base import ReadOptions, read

        toolpath = read(arguments.nx, options=ReadOptions(tool_axis=(1.0, 0.0, 0.0)))
        cell = line_cell((362, 107), "axial", "compliance")
        middle = 0.5 * (toolpath.points.min(axis=0) + toolpath.points.max(axis=0))
        base = Workpiece(1, transform(np.eye(3), np.array([1.9, 0.0, 0.9]) - middle))
        jobs.append((Path(arguments.nx).stem, toolpath, replace(cell, workpiece=base)))
    plan(jobs[0][1], jobs[0][2])  # imports and tables made once are no planning time
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
    ("each", {"strategy": Strategy.EACH}),
    (
        "paper smooth",
        {"strategy": Strategy.SMOOTH, "refine": False, "loss_bound": 1.0, "key_every": 100.0},
    ),
    ("smooth", {"strategy": Strategy.SMOOTH}),
    ("global", {"strategy": Strategy.GLOBAL}),
)
"""Name and options; paper smooth: as Jiao et al. 2022, fixed interpolation between key tags
of which each takes its own optimum, none added."""


def _compare(name: str, toolpath: ToolPath, cell: Cell) -> None:
    """Print one line per strategy, and the loss of every tag where they are few."""
    rows, best = [], np.zeros(0)
    for label, options in STRATEGIES:
        wishes = replace(cell.optimize, **options)
        began = time.process_time()
        result = plan(toolpath, replace(cell, optimize=wishes))
        took = time.process_time() - began
        if options["strategy"] is Strategy.SMOOTH:
            # the record's own losses are against the optimum of every tag by itself
            lost = 1.0 - np.array(result.settings["loss"])
            best = result.stiffness / lost
        rows.append((label, result, took))
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
        part.add_argument("--workloads", type=Path, required=True)
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


if __name__ == "__main__":
    main()
