"""Plan with one special case of the planner off at a time: what does each still earn?

    python -m tools.bench ablation [--only NAME ...] [--cases NAME ...] [--repeats 2] [--golden]

Cases are the golden programs (``--golden``: these alone) and small hard ones: holes behind beams, a
dome beside posts, tilts round corners, crowded cells with and without a rail, a solid that parts
the reach, contours that end in a pocket, contours anywhere around the arm, paths that nothing
serves. A line says of one special case: in how many cases the plan is another without it, in how
many it fails more or less, by how much all cycle times and the mean stiffness are then off [%], and
what processor time all cases take against that with it. What changes no plan and saves less than
3 % is not worth its lines.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from postproc.cell import Cell, load_cell, parse_cell
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.model import MotionKind, Plan, ToolPath
from postproc.planning import plan
from postproc.planning.repairs import REPAIRS
from postproc.readers import read
from tests.cells import STIFFNESS, cell_text
from tests.jobs.test_retracts import LEAVE, around, cell_of
from tests.places import FIXTURES
from tests.planning.test_failing import CORNERS, TILTED
from tests.planning.test_main_spin import DOME_CELL, dome
from tests.planning.test_solve import HOLES, PARTED
from tests.planning.test_tilt import leaning_slot
from tools.bench.axes import rim, ring, slow_rail, walled
from tools.bench.cells import holes_file, write_cells
from tools.bench.contours import SOLIDS, contour, milling_cell, random_case
from tools.bench.crowded import random_job
from tools.bench.paths import bare_path
from tools.bench.workload import WORKLOADS

Switch = tuple[str, str, Any]
"""Module or module.Class, attribute, what stands there instead."""
Made = tuple[ToolPath, Cell]
T = TypeVar("T")
Found = Any
"""What a process that ended says."""
SEARCH, ROUTE = "postproc.planning.search.", "postproc.planning.route."
AXES = "postproc.planning.external."


def _nothing(*_: object, **__: object) -> list[Any]:
    return []


def _none(*_: object, **__: object) -> None:
    return None


def _no(*_: object, **__: object) -> bool:
    return False


def _no_ways(*_: object, **__: object) -> dict[int, Any]:
    return {}


def _first(value: T, *_: object, **__: object) -> T:
    return value


def _second(_: object, value: T, *__: object, **___: object) -> T:
    return value


OFF: dict[str, tuple[Switch, ...]] = {
    "out of reach": (("postproc.planning.repairs", "_is_out_of_reach", _no),),
    "without roll": (("postproc.planning.attempt", "without_roll", _nothing),),
    "spins of strokes": ((SEARCH + "roll", "_price", lambda *a: np.zeros(len(a[4]))),),
    "also failing": ((SEARCH + "pose_search", "also_failing", _nothing),),
    "alike": ((SEARCH + "failing", "_alike", lambda s, rung, a, b: np.zeros((0, 2), int)),),
    "infeasible": (
        (SEARCH + "between", "infeasible", lambda problem, way: np.zeros(len(problem), int)),
    ),
    "beside": ((SEARCH + "failing", "_around", lambda search, at: (at[:0], at[:0])),),
    "far along": ((SEARCH + "failing", "ALONG", 1),),
    "taken out": (
        (
            SEARCH + "failing.FailingCuts",
            "taken_out",
            lambda self, spans, judged: ~judged.good(len(spans)),
        ),
    ),
    "empties": ((SEARCH + "refinement.Refinement", "_around_empties", _none),),
    "gaps": ((SEARCH + "refinement.Refinement", "_around_gaps", _none),),
    "stuck": ((SEARCH + "rungs", "_stuck", lambda *a: np.zeros(0, int)),),
    "round spins": (("postproc.planning.attempt", "on_round_spins", _second),),
    "home price": ((SEARCH + "rungs", "_price_home", _none),),
    "tilt steps": ((SEARCH + "tilt_steps.TiltSteps", "barred", _none),),
    "bridges": ((SEARCH + "rungs", "BRIDGED", 0.0),),
    "steady turn": ((SEARCH + "rungs", "STEADY_TURN", 100.0),),
    "folded": ((ROUTE + "connect", "_by_folding", _no_ways),),
    "trees": ((ROUTE + "connect", "rrt_connect", _none),),
    "offered": ((ROUTE + "connect", "_offered", lambda c, e, rows, *a: rows),),
    "drawn in": ((ROUTE + "connect", "_drawn_in", lambda c, s, g, e, ways: ways),),
    "seem free": ((ROUTE + "connect", "seem_free", lambda c, s, *a: np.ones(len(s), bool)),),
    "listed": (("postproc.ladder.graph.Graph", "_list", _none),),
    "finer positions": (
        (AXES + "rating", "_with_finer", lambda p, values, k, cost: (values, cost)),
    ),
    "free positions": ((AXES + "rating.Rating", "avoid_collisions", _none),),
    "too fast": ((AXES + "positions", "_too_fast", _no),),
    "put off": (("postproc.ladder.ladder", "NEAR", 10**9),),
}
OFF |= {
    one.name: (("postproc.planning.repairs", "REPAIRS", tuple(r for r in REPAIRS if r != one)),)
    for one in REPAIRS
}
"""Special cases by name, and what is planned with instead of each."""


class Outcome(NamedTuple):
    """A plan in short: its bytes' digest, tags that fail, cycle time [s], mean index, CPU [s]."""

    digest: str
    errors: int
    cycle: float
    index: float
    cpu: float


def _golden(case: str) -> Callable[[Path], Made]:
    def make(_: Path) -> Made:
        folder = FIXTURES / case
        line = (folder / "commands.txt").read_text(encoding="utf-8").split("postproc ", 1)[1]
        words = shlex.split(line.splitlines()[0])
        source, file = folder / words[1], folder / words[words.index("--cell") + 1]
        cell = load_cell(str(file))
        return read_toolpath(ConvertRequest(str(source), str(file)), cell), cell

    return make


def _holes(size: int, kind: str) -> Callable[[Path], Made]:
    def make(folder: Path) -> Made:
        write_cells(folder, WORKLOADS)
        cell = load_cell(str(folder / f"{kind}.toml"))
        return read(str(holes_file(size, folder, WORKLOADS))), cell

    return make


def _dome(_: Path) -> Made:
    posts = "".join(
        f'[[obstacles]]\nname = "post_{k}"\nbox = {{ size_mm = [60, 60, 900] }}\n'
        f"xyz_mm = [{2200 + x}, {300 + y}, 1000]\n"
        for k, (x, y) in enumerate(((-330, 260), (340, -240), (-60, 420)))
    )
    return dome(400, 4, 14000.0), parse_cell((DOME_CELL + posts).encode(), "cell.toml")


def _crowded(seed: int, *, with_rail: bool) -> Callable[[Path], Made]:
    def make(folder: Path) -> Made:
        job = random_job(np.random.default_rng(seed), 20, with_rail=with_rail, along=with_rail)
        (folder / "cell.toml").write_text(job.cell, encoding="utf-8")
        keep = np.ones(len(job.blocks), dtype=np.bool_)
        keep[1:12] = not with_rail
        (folder / "job.apt").write_text(job.cam(keep), encoding="utf-8")
        cell = load_cell(str(folder / "cell.toml"))
        return read(str(folder / "job.apt")), cell

    return make


def _text(cell: str, name: str, text: str) -> Callable[[Path], Made]:
    def make(folder: Path) -> Made:
        (folder / name).write_text(text, encoding="utf-8")
        (folder / "cell.toml").write_text(cell, encoding="utf-8")
        return read(str(folder / name)), load_cell(str(folder / "cell.toml"))

    return make


def _contour(
    shape: str, count: int, spacing: float, **cell: bool | tuple[float, float, float]
) -> Callable[[Path], Made]:
    return lambda _: (contour(shape, count, spacing), milling_cell(**cell))  # type: ignore[arg-type]


def _at_the_end_of_reach(_: Path) -> Made:
    """Return a cut from the end of which few poses can back off along the tool axis."""
    places = [2.5114, 0.3934, 2.1098] + np.arange(4)[:, None] * [-0.0031, 0.0198, 0.0]
    axes = np.tile([0.848109, -0.501178, 0.171844], (4, 1))
    kind = np.array([MotionKind.RAPID, *[MotionKind.LINEAR] * 3])
    home = "[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\n"
    cell = parse_cell(cell_text(STIFFNESS, home, origin=(0, 0, 0)).encode(), "cell.toml")
    return bare_path("cut", places, axes, feed=0.02, kind=kind), cell


def _turned_over(_: Path) -> Made:
    """Return a path one motion of which turns the tool over, far from its other end."""
    path = contour("s", 150, 6.0)
    axes = np.array(path.axes)
    axes[100:] = -axes[100:]
    return replace(path, axes=axes), milling_cell(fixture=True)


_PARTED_HOLES = "\n".join(
    ["id,x,y,z,i,j,k,depth,feed"]
    + [f"H{n},{x},{y},0,0,0,1,12.33,300" for n, (x, y) in enumerate(HOLES)]
    + [""]
)


def _pocket(deep: float, points: int) -> Callable[[Path], Made]:
    """Return a spiral between four walls that ends at their foot, ``deep`` [mm] below their top."""
    turn = np.arange(points) * 0.4
    radius = 200.0 - 160.0 * np.arange(points) / points
    rows = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(points)])
    lines = [f"GOTO/{x:.3f},{y:.3f},{z:.3f}" for x, y, z in rows]
    head = "UNITS/MM\nMULTAX/ON\nFEDRAT/600,MMPM\nRAPID\nGOTO/200,0,50,0,0,1\n"
    walls = "".join(
        f'[[obstacles]]\nname = "wall_{k}"\nbox = {{ size_mm = [{sx}, {sy}, {deep}] }}\n'
        f"xyz_mm = [{1900 + x}, {y}, {800 + deep / 2}]\n"
        for k, (x, y, sx, sy) in enumerate(
            ((260, 0, 40, 560), (-260, 0, 40, 560), (0, 260, 560, 40), (0, -260, 560, 40))
        )
    )
    cell = cell_text(walls, STIFFNESS, tool=SOLIDS, origin=(1900, 0, 800))
    return _text(cell, "pocket.apt", head + "\n".join(lines) + "\nFINI\n")


def _strokes(holes: int, deep: float) -> Callable[[Path], Made]:
    """Return holes drilled by motions of their own, in along a leaning axis and out again."""
    rng, lines = np.random.default_rng(3), ["UNITS/MM", "MULTAX/ON"]
    for _ in range(holes):
        x, y = rng.uniform(-400.0, 400.0, 2)
        axis = np.append(rng.normal(0.0, 0.25, 2), 1.0)
        axis /= np.linalg.norm(axis)
        foot, top = (
            "GOTO/" + ",".join(f"{v:.5f}" for v in (*([x, y, 0.0] + axis * high), *axis))
            for high in (0.0, deep)
        )
        lines += ["RAPID", top, "FEDRAT/600,MMPM", foot, "RAPID", top]
    home = "[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\n"
    cell = cell_text(STIFFNESS, home, tool=SOLIDS, origin=(1900, 0, 700))
    return _text(cell, "strokes.apt", "\n".join([*lines, "FINI", ""]))


def _tilted(points: int) -> Callable[[Path], Made]:
    """Return a contour along which the tool may tilt, as of ``tools.bench contours``."""
    wishes = "[optimize]\nlead_deg = [-10, 30]\nside_tilt_deg = [-10, 10]\n"
    cell = cell_text(STIFFNESS, wishes, origin=(1900, 0, 700))
    return lambda _: (contour("s", points, 8.0), parse_cell(cell.encode(), "cell.toml"))


GOLDEN = [
    case.parent.name
    for case in sorted(FIXTURES.glob("*/commands.txt"))
    if "\npostproc convert" in case.read_text(encoding="utf-8")
]
CASES: dict[str, Callable[[Path], Made]] = {name: _golden(name) for name in GOLDEN}
HARD: dict[str, Callable[[Path], Made]] = {
    "holes behind beams": _holes(120, "hard"),
    "holes": _holes(200, "cell"),
    "dome beside posts": _dome,
    "long dome": lambda _: (dome(), parse_cell(DOME_CELL.encode(), "cell.toml")),
    "tilts round corners": _text(TILTED, "corners.apt", CORNERS),
    "a stub parts the reach": _text(PARTED, "holes.csv", _PARTED_HOLES),
    "pocket": _pocket(60.0, 24),
    "deep pocket": _pocket(140.0, 16),
    "turned over": _turned_over,
    "strokes": _strokes(12, 120.0),
    "tilts along a contour": _tilted(150),
    "end of reach": _at_the_end_of_reach,
    "s with a clamp": _contour("s", 200, 2.0, fixture=True),
    "long steps": _contour("convex", 8, 150.0, fixture=True, origin=(2150, 550, 750)),
    "beside a clamp": _contour("convex", 1000, 1.0, fixture=True),
    "longer steps": _contour("convex", 12, 220.0, fixture=True, origin=(2150, 550, 750)),
    "long contour": _contour("wavy", 700, 2.0, fixture=False),
    "long contour beside a clamp": _contour("wavy", 2500, 2.0, fixture=True),
    "out of reach": _contour("convex", 300, 6.0, fixture=True, origin=(2600, 300, 900)),
    **{f"contour {seed}": lambda _, seed=seed: random_case(seed) for seed in (2, 5, 8, 23, 54)},
    **{f"crowded {seed}": _crowded(seed, with_rail=False) for seed in (1, 3)},
    "crowded rail": _crowded(4, with_rail=True),
    "slot that leans": lambda _: leaning_slot(),
    "round the base": lambda _: (around(), cell_of(LEAVE)),
    "rim on a table": lambda _: rim(),
    "ring within reach": lambda _: ring(),
    "wall beside a rail": lambda _: walled(),
    "slow rail": lambda _: slow_rail(),
}
CASES |= HARD


def digest(made: Plan) -> str:
    """Return a number of all that a plan says of the motions, and of its findings."""
    known = hashlib.sha256()
    columns = (made.kind, made.role, made.tag, made.T_base_tcp, made.aux, made.q, made.speed)
    for column in (*columns, made.blend, made.duration, made.external):
        known.update(np.ascontiguousarray(column).tobytes())
    known.update(repr([(f.code, f.tag_index, f.message) for f in made.findings]).encode())
    return known.hexdigest()


def planned(case: Made) -> Outcome:
    """Return what becomes of a case."""
    before = time.process_time()
    made = plan(*case)
    used = time.process_time() - before
    known = np.isfinite(made.stiffness)
    index = float(made.stiffness[known].mean()) if known.any() else 0.0
    return Outcome(digest(made), len(made.errors), float(made.cycle_time), index, used)


def _owner(where: str) -> object:
    path, _, last = where.rpartition(".")
    return getattr(import_module(path), last) if last[0].isupper() else import_module(where)


def without(name: str) -> None:
    """Switch a special case off in this process, for good."""
    for where, attribute, instead in OFF[name]:
        if not hasattr(_owner(where), attribute):
            raise SystemExit(f"{where} has no {attribute}")
        setattr(_owner(where), attribute, instead)


def watched(case: Made) -> tuple[list[str], float]:
    """Return the special cases that planning a case comes to, and the processor time."""
    met: set[str] = set()
    for name, switches in OFF.items():
        for where, attribute, instead in switches:
            own = getattr(_owner(where), attribute)
            if not callable(instead):
                met.add(name)
                continue
            setattr(_owner(where), attribute, _noting(own, name, met))
    used = planned(case).cpu
    return sorted(met), used


def _noting(own: Callable[..., Any], name: str, met: set[str]) -> Callable[..., Any]:
    def noted(*args: object, **options: object) -> object:
        met.add(name)
        return own(*args, **options)

    return noted


def _met(case: Made) -> set[str]:
    """Return as ``watched``, in a process of its own; ends where one is not found any more."""
    found = forked(lambda: watched(case))
    if isinstance(found, str):
        raise SystemExit(found)
    return set(found[0])


def forked(work: Callable[[], object]) -> Found:
    """Return what some work gives in a process of its own; the error where it ends in one."""
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            found = work()
        except Exception as error:  # noqa: BLE001
            found = f"{type(error).__name__}: {error}"
        os.write(write_end, json.dumps(found).encode())
        os._exit(0)
    os.close(write_end)
    with os.fdopen(read_end, "rb") as stream:
        text = stream.read()
    os.waitpid(child, 0)
    return json.loads(text) if text else "died"


def best(case: Made, off: str | None, repeats: int) -> Outcome | str:
    """Return what becomes of a case, with the least processor time of some runs."""

    def work() -> Outcome:
        if off is not None:
            without(off)
        return planned(case)

    runs = [forked(work) for _ in range(repeats)]
    failed = [run for run in runs if isinstance(run, str)]
    return failed[0] if failed else min((Outcome(*run) for run in runs), key=lambda run: run.cpu)


def _line(name: str, pairs: dict[str, tuple[Outcome, Outcome | str]]) -> str:
    broken = {case: off for case, (_, off) in pairs.items() if isinstance(off, str)}
    both = {case: (on, off) for case, (on, off) in pairs.items() if isinstance(off, Outcome)}
    other = [case for case, (on, off) in both.items() if on.digest != off.digest]
    worse = sum(off.errors > on.errors for on, off in both.values())
    fewer = sum(off.errors < on.errors for on, off in both.values())
    sums = np.array([(*on[2:], *off[2:]) for on, off in both.values()]).reshape(-1, 6).sum(axis=0)
    cycle, index, cpu = (100.0 * (sums[k + 3] / max(sums[k], 1e-12) - 1.0) for k in range(3))
    slower = max(both, key=lambda c: both[c][1].cpu - both[c][0].cpu, default="")
    text = f"{name:<20}{len(other):>4}{worse:>4}{fewer:>4}{cycle:>8.2f}{index:>8.2f}{cpu:>8.1f}"
    if slower:
        on, off = both[slower]
        text += f"  {slower} {on.cpu:.2f} > {off.cpu:.2f} s;"
    return f"{text} {', '.join([*other, *(f'{c} {e}' for c, e in broken.items())])}"


def main() -> None:
    """Read the arguments, plan, print a line for each special case."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="*", default=list(OFF), metavar="NAME")
    parser.add_argument("--cases", nargs="*", default=None, metavar="NAME")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--golden", action="store_true")
    parser.add_argument("--log", type=Path, help="add a line of JSON for each plan")
    arguments = parser.parse_args()
    names = arguments.cases or (GOLDEN if arguments.golden else list(CASES))
    pairs: dict[str, dict[str, tuple[Outcome, Outcome | str]]] = {n: {} for n in arguments.only}
    with tempfile.TemporaryDirectory() as folder:
        for number, name in enumerate(names):
            place = Path(folder) / str(number)
            place.mkdir()
            case = CASES[name](place)
            on = best(case, None, arguments.repeats)
            if isinstance(on, str):
                raise SystemExit(f"{name}: {on}")
            met = _met(case) if arguments.only else set()
            print(f"{name:<24}{on.errors:>3} errors{on.cpu:>8.2f} s", flush=True)
            for off in met.intersection(arguments.only):
                pairs[off][name] = on, best(case, off, arguments.repeats)
                if arguments.log:
                    text = json.dumps([off, name, *pairs[off][name]])
                    with arguments.log.open("a", encoding="utf-8") as log:
                        log.write(text + "\n")
    print(f"{'off':<20}{'diff':>4}{'bad':>4}{'good':>5}{'cycle':>7}{'index':>8}{'cpu %':>8}")
    for name in arguments.only:
        print(_line(name, pairs[name]))


if __name__ == "__main__":
    sys.exit(main())
