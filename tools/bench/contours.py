"""Measure milling: dense 5-axis contours through the whole of ``convert``, and false refusals.

    python -m tools.bench contours sizes  [--points 1000 20000] [--spacing 1]
    python -m tools.bench contours random [--count 50] [--seed 1]
    python -m tools.bench contours exact  [--count 200] [--seed 1]
    python -m tools.bench contours eager  [--count 50] [--seed 1]

``sizes`` converts closed (convex, wavy) and S-shaped contours with and without a fixture, defaults
on, and prints processor time and memory of the process, stiffness, what key tags lose of their own
optimum, and the largest joint step. ``random`` places contours anywhere around the arm and compares
the verdict with a brute force that knows no key tags: every spin of a 5 degree grid in every branch
at every point, collisions of all of them, joined where the joints follow each other. ``exact``
compares the cost of the best way on small cuts with plain dynamic programming over all their steps,
each judged along its whole inside; ``eager`` with a search that knows all collisions beforehand.

Every case of ``sizes`` runs in a process of its own, so that its peak memory is its own.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from postproc.cell import Cell, parse_cell
from postproc.geometry import orthonormalised
from postproc.jobs.convert import ConvertRequest, convert, document
from postproc.model import MotionKind, ToolPath
from postproc.planning.checks import Checker
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import Spans, judge
from postproc.planning.search.keytags import dense_key_tags
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states import sample, settle, spin_values
from postproc.units import DEG, MM
from tests.cells import STIFFNESS, cell_text
from tools.bench.harness import alone, peak_mb
from tools.bench.paths import bare_path

Array = npt.NDArray[np.float64]
SHAPES = ("convex", "wavy", "s")
LAP = 1500.0
"""Longest lap or strip of a contour [mm]."""
FOLLOWS = 40.0 * DEG
"""States whose joints differ by less follow each other in the brute force [rad]."""
SOLIDS = """\
[[tool.meshes]]
name = "head"
cylinder = { radius_mm = 60, length_mm = 140 }
xyz_mm = [-50, 0, 362]
abc_deg = [0, 90, 0]
[[tool.meshes]]
name = "cutter"
cylinder = { radius_mm = 5, length_mm = 86 }
xyz_mm = [64, 0, 362]
abc_deg = [0, 90, 0]
cutting = true
"""
FIXTURE = """\
[[obstacles]]
name = "table"
box = { size_mm = [500, 800, 500] }
xyz_mm = [1900, 0, 380]
[[obstacles]]
name = "clamp"
box = { size_mm = [80, 80, 400] }
xyz_mm = [2350, 650, 800]
"""


def contour(shape: str, count: int, spacing: float, lean: float = 20.0) -> ToolPath:
    """Return a contour of ``count`` points so far apart [mm], its tool leaning outward [deg]."""
    length = count * spacing
    laps = max(1, int(np.ceil(length / LAP)))
    t = np.arange(count) / count * laps
    if shape == "s":
        along = np.abs(np.mod(t, 2.0) - 1.0) - 0.5
        wide = length / laps / 1.35
        points = np.stack([0.18 * wide * np.sin(2 * np.pi * along), along * wide, 0 * t], axis=1)
        angle = np.radians(lean) * np.cos(2 * np.pi * along * 2.0)
    else:
        radius = length / laps / (2.0 * np.pi)
        r = radius / 1.15 * (1.0 + 0.25 * np.cos(6 * np.pi * t)) if shape == "wavy" else radius
        points = np.stack([r * np.cos(2 * np.pi * t), r * np.sin(2 * np.pi * t), 0 * t], axis=1)
        angle = np.full(count, np.radians(lean))
    tangent = np.gradient(points, axis=0)
    if shape == "s":  # there and back on the same way, leaning to the same side of it
        back = np.mod(t, 2.0) >= 1.0
        tangent[back] *= -1.0
        tangent[1:][back[1:] != back[:-1]] = tangent[:-1][back[1:] != back[:-1]]
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-12
    out = np.cross(tangent, [0.0, 0.0, 1.0])
    axes = np.cos(angle)[:, None] * [0.0, 0.0, 1.0] + np.sin(angle)[:, None] * out
    kind = np.full(count, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    return bare_path(shape, points * MM, axes, feed=0.02, kind=kind)


def milling_cell(*, fixture: bool, origin: tuple[float, float, float] = (1900, 0, 700)) -> Cell:
    """Return a KR 500 with an angle head, with a table and a clamp in its way or without solids."""
    more = (FIXTURE,) if fixture else ()
    home = "[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\n"
    text = cell_text(*more, STIFFNESS, home, tool=SOLIDS if fixture else "", origin=origin)
    return parse_cell(text.encode(), "contour.toml")


def random_case(seed: int) -> tuple[ToolPath, Cell]:
    """Return a contour placed and turned anywhere in reach, and its cell."""
    rng = np.random.default_rng(seed)
    shape, spacing = SHAPES[seed % 3], float(rng.choice([0.3, 1.0, 3.0]))
    path = contour(shape, int(rng.integers(60, 200)), spacing, float(rng.uniform(0.0, 40.0)))
    turn = orthonormalised(rng.normal(size=(3, 3)))
    turn[:, 2] *= np.sign(np.linalg.det(turn))
    if turn[2, 2] < -0.3:  # from below nothing is milled
        turn = np.diag([1.0, -1.0, -1.0]) @ turn
    path = replace(path, points=path.points @ turn.T, axes=path.axes @ turn.T)
    angle, radius = rng.uniform(-1.2, 1.2), rng.uniform(1200.0, 2400.0)
    origin = (radius * np.cos(angle), radius * np.sin(angle), rng.uniform(200.0, 1600.0))
    where = tuple(round(float(value), 3) for value in origin)
    return path, milling_cell(fixture=seed % 2 == 0, origin=where)  # type: ignore[arg-type]


def brute_breaks(toolpath: ToolPath, cell: Cell, step: float = 5.0) -> list[int]:
    """Return the tags that no sequence of states of a dense grid of spins [deg] reaches."""
    cell, settings = settle(cell)
    checker = checker_of(toolpath, cell, settings)
    n, spins = len(toolpath), spin_values(step * DEG, -np.pi, np.pi)
    states = sample(checker.problem, np.arange(n), spins)
    tag = states.tag_of(np.arange(len(states.q)))
    first = np.flatnonzero(np.diff(states.config, prepend=-1))
    q, branch = states.q[first].astype(np.float64), states.branch[first].astype(np.int64)
    free = checker.states(tag[first], q, states.attitude_of(first), branch).good[states.config]
    breaks: list[int] = []
    alive = np.zeros(0, dtype=np.int64)
    for i in range(n):
        low, high = states.offsets[i], states.offsets[i + 1]
        now = np.arange(low, high)[free[low:high]]
        reached = now if i == 0 or not len(alive) else now[_follow(states, now, alive, len(spins))]
        if i and not len(reached):
            breaks.append(i)
            reached = now
        rest = np.setdiff1d(now, reached)
        while len(rest) and len(more := rest[_follow(states, rest, reached, len(spins))]):
            reached, rest = np.concatenate([reached, more]), np.setdiff1d(rest, more)
        alive = np.sort(reached)
    return breaks


def _follow(states, now, before, width: int) -> npt.NDArray[np.bool_]:  # type: ignore[no-untyped-def]  # noqa: ANN001
    """Return which states (m,) follow one of those before: spin, branch, joints."""
    gap = np.abs(np.subtract.outer(states.column[now], states.column[before]).astype(np.int64))
    near = np.minimum(gap, width - gap) <= 1
    near &= states.branch[now][:, None] == states.branch[before][None]
    for j in range(6):
        near &= np.abs(np.subtract.outer(states.q[now, j], states.q[before, j])) <= FOLLOWS
    return np.asarray(near.any(axis=1))


def run_one(arguments: argparse.Namespace) -> None:
    """Convert one contour and print one JSON line."""
    toolpath = contour(arguments.shape, arguments.points, arguments.spacing)
    cell = milling_cell(fixture=arguments.fixture)
    made = convert(ConvertRequest(toolpath.path, cell.path), toolpath=toolpath, cell=cell)
    told = document(made)
    cut = made.plan.kind[1:] > 0
    step = np.abs(np.diff(made.plan.q, axis=0)).max(axis=1)[cut].max(initial=0.0) / DEG
    print(
        json.dumps(
            {
                "cpu_s": time.process_time(),
                "mb": peak_mb(),
                "failed": len(told["failures"]),
                "step_deg": float(step),
                **(told["stiffness"] or {}),
            }
        )
    )


def table_sizes(arguments: argparse.Namespace) -> None:
    """Print the table of generated contours."""
    head = ("shape", "points", "fixture", "cpu s", "MB", "failed", "mean k", "min k", "lost %")
    print(("{:>8}" * 11).format(*head, "most %", "step"))
    for points in arguments.points:
        for shape in SHAPES:
            for fixture in (False, True):
                flags = [
                    "--shape",
                    shape,
                    "--size",
                    str(points),
                    "--spacing",
                    str(arguments.spacing),
                ]
                r = alone("contours", "one", *flags, *["--fixture"] * fixture)
                print(
                    f"{shape:>8}{points:>8}{'yes' if fixture else 'no':>8}{r['cpu_s']:>8.2f}"
                    f"{r['mb']:>8.0f}{r['failed']:>8}{r['mean_N_per_mm']:>8.0f}"
                    f"{r['min_N_per_mm']:>8.0f}{r['lost_mean_percent']:>8.2f}"
                    f"{r['lost_max_percent']:>8.2f}{r['step_deg']:>8.3f}",
                    flush=True,
                )


def compare_random(seeds: range) -> dict[str, list[int]]:
    """Return the seeds by verdict: both run, both refuse, refused falsely, run where none goes."""
    verdicts: dict[str, list[int]] = {"run": [], "refused": [], "false": [], "only_here": []}
    for seed in seeds:
        toolpath, cell = random_case(seed)
        ours = not any(
            error.code != "PLN104" or "way" not in error.message
            for error in plan(toolpath, cell).errors
        )
        theirs = not brute_breaks(toolpath, cell)
        key = {(True, True): "run", (False, False): "refused", (False, True): "false"}
        verdicts[key.get((ours, theirs), "only_here")].append(seed)
    return verdicts


def exact_case(seed: int) -> Checker:
    """Return the checks of a cut of four tags, few enough to judge every step."""
    rng = np.random.default_rng(seed)
    toolpath = contour(SHAPES[seed % 3], 90, 3.0, float(rng.uniform(0.0, 35.0)))
    toolpath = toolpath.rows(np.arange(4) * int(rng.integers(4, 7)))
    cell = milling_cell(fixture=seed % 2 == 0)
    wishes = replace(cell.optimize, step=20.0 * DEG, range=(-60.0 * DEG, 60.0 * DEG))
    cell, settings = settle(replace(cell, optimize=wishes))
    return checker_of(toolpath, cell, settings)


def brute_cost(checker: Checker) -> float:
    """Return the least cost over all states and all steps, infinite without a way."""
    n = len(checker.problem)
    search = PoseSearch.of(checker, np.arange(n))
    states, ladder = search.states, search.ladder
    good = search.check_states(np.arange(len(states.q)))
    value = np.where(good, ladder.cost, np.inf)[: states.offsets[1]]
    for i in range(1, n):
        before = np.arange(states.offsets[i - 1], states.offsets[i])
        now = np.arange(states.offsets[i], states.offsets[i + 1])
        a, b = (pair.ravel() for pair in np.meshgrid(before, now))
        may = (states.branch[a] == states.branch[b]) & good[a] & good[b]
        at, to = a[may], b[may]
        spans = Spans(
            np.full(len(at), i - 1),
            np.full(len(at), i),
            states.attitude_of(at),
            states.attitude_of(to),
            states.q[at].astype(float),
            states.q[to].astype(float),
            states.branch[to].astype(np.int64),
        )
        may[may] = judge(checker, Interpolation.of(checker.problem), spans).good(len(at))
        step = ladder.weight[i] * ((states.q[b].astype(float) - states.q[a]) ** 2).sum(axis=1)
        total = value[a - before[0]] + np.where(may, step, np.inf)
        value = total.reshape(len(now), len(before)).min(axis=1, initial=np.inf) + ladder.cost[now]
    return float(value.min(initial=np.inf))


def searched_cost(search: PoseSearch) -> float:
    """Return the cost of the way that a search finds, infinite without one."""
    found = search.found
    if search.ladder.broken[1:].any() or (found.path < 0).any():
        return float("inf")
    return search.ladder.total(found.path)


def compare_exact(seeds: range) -> dict[str, list[int]]:
    """Return the seeds at which search and brute force agree, and the others."""
    verdicts: dict[str, list[int]] = {"same": [], "no way": [], "other": []}
    for seed in seeds:
        checker = exact_case(seed)
        ours = searched_cost(PoseSearch.of(checker, np.arange(len(checker.problem))))
        verdicts[_agreed(ours, brute_cost(checker))].append(seed)
    return verdicts


def compare_eager(seeds: range) -> dict[str, list[int]]:
    """Return the seeds at which it makes no difference to know all collisions beforehand."""
    verdicts: dict[str, list[int]] = {"same": [], "no way": [], "other": []}
    for seed in seeds:
        toolpath, cell = random_case(seed)
        cell, settings = settle(cell)
        checker = checker_of(toolpath, cell, settings)
        tags = np.flatnonzero(dense_key_tags(checker.problem))
        eager = PoseSearch.of(checker, tags)
        every = np.arange(len(eager.states.q))
        failing = every[~eager.check_states(every)]
        eager.ladder.cost[failing] = np.inf
        ours = searched_cost(PoseSearch.of(checker, tags))
        verdicts[_agreed(ours, searched_cost(eager))].append(seed)
    return verdicts


COMPARED = {"random": compare_random, "exact": compare_exact, "eager": compare_eager}


def _agreed(ours: float, theirs: float) -> str:
    if not np.isfinite(ours) and not np.isfinite(theirs):
        return "no way"
    return "same" if abs(ours - theirs) <= 1e-6 * max(1.0, abs(theirs)) else "other"


def main() -> None:
    """Read the arguments and measure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("sizes", "one", *COMPARED))
    parser.add_argument("--points", type=int, nargs="+", default=[1000, 20000])
    parser.add_argument("--size", type=int, default=1000)
    parser.add_argument("--spacing", type=float, default=1.0)
    parser.add_argument("--shape", choices=SHAPES, default="convex")
    parser.add_argument("--fixture", action="store_true")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.what == "sizes":
        table_sizes(arguments)
    elif arguments.what == "one":
        arguments.points = arguments.size
        run_one(arguments)
    else:
        seeds = range(arguments.seed, arguments.seed + arguments.count)
        for verdict, found in COMPARED[arguments.what](seeds).items():
            named = found if verdict in ("false", "only_here", "other") else ""
            print(f"{verdict}: {len(found)} {named}")
