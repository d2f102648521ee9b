"""Write the benchmark page of the documentation: our numbers beside the peer's and the paper's.

    python -m tools.bench page [-o docs/benchmark.md] [--only planning holes commands ...]
                               [--peer PYTHON] [--other CHECKOUT] [--cases 100] [--cells 40]
                               [--points 1000 20000 200000] [--contours 1000]

``--only`` measures some sections and keeps the others of the page. ``--peer`` names an interpreter
that has ``tesseract-robotics``. Times are processor time, so that other work on the machine
matters little; the machine is named by its number of cores only. All sections: about 20 minutes,
a minute for each of the crowded ``--cells``, three seconds for each of the random ``--contours``.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from postproc.version import __version__
from tools.bench.harness import alone, spent
from tools.bench.holes import BOXES, measured
from tools.bench.planning import OPTIMA, PEER_MOST
from tools.bench.workload import WORKLOADS

ROOT = Path(__file__).resolve().parents[2]
SIZES = (200, 1000, 10000)
KINDS = {
    "base": "open cell",
    "turns": "open cell, joints may turn a whole turn more",
    "hard": "four beams between robot and panel: a third of the poses collide",
}
SEED = 20261122
"""Of the withheld campaigns; nothing was tuned on it."""
MOTION_SEED = 2026112301
LOOP_SEED = 840217
"""Of the crowded cells."""
HEAD = """\
# Benchmark

On a machine with {cores} cores; each case ran on one of them, in a process of its own. Times are
processor time. Each section says which version it was measured with. The page is written by one
command, `python -m tools.bench page`; it needs the workloads that lie beside the repository, and
takes about 20 minutes.
"""


def planning(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on planning: search over the free angle with collisions."""
    yield "## Planning\n"
    yield (
        "Holes in a panel, 36 spins of 10 degrees and all arm configurations each, 23 solids, a "
        "KR 500. *Poses* checks the postures at the holes, of which the exact optimum is known; "
        "*strokes* sweeps the 50 mm above each hole as well, which is what `convert` does. *Cost* "
        "is the sum of squared joint steps of the sequence that was found; *above* is how far that "
        "is above the exact optimum of the grid. *Refined* leaves the grid.\n"
    )
    head = "| cell | holes | checked | time [s] | memory [MB] | cost [rad²] | above | refined |"
    yield f"{head}\n| --- | --: | --- | --: | --: | --: | --: | --: |"
    for kind, words in KINDS.items():
        for size in SIZES:
            for strokes in (False, True):
                flags = ["--kind", kind, "--size", str(size)] + ["--strokes"] * strokes
                r = alone("planning", "one", "--workloads", str(WORKLOADS), *flags)
                above = 100.0 * (r["grid_rad2"] / OPTIMA[kind, size] - 1.0)
                yield (
                    f"| {words} | {size} | {'strokes' if strokes else 'poses'} | {r['cpu_s']:.2f} "
                    f"| {r['mb']:.0f} | {r['grid_rad2']:.2f} "
                    f"| {'' if strokes else f'{above:z.3f} %'} | {r['refined_rad2']:.2f} |"
                )
    yield from _peer(arguments.peer)


def _peer(python: str | None) -> Iterator[str]:
    yield "\n### Beside tesseract\n"
    if not python:
        yield "Not measured: `--peer PYTHON` names an interpreter that has `tesseract-robotics`."
        return
    yield (
        "The ladder planner of `tesseract-robotics` 0.5.1 on the same files: open cell, poses, no "
        "whole turns. It has no refinement. It needs about 7 MB for each hole, so larger ones are "
        "left out.\n"
    )
    names = (f"ours [{unit}] | tesseract [{unit}]" for unit in ("s", "MB", "rad²"))
    yield f"| holes | {' | '.join(names)} |\n|{' --: |' * 7}"
    script = str(Path(__file__).with_name("tesseract.py"))
    for size in (size for size in SIZES if size <= PEER_MOST):
        words = ["--workloads", str(WORKLOADS), "--kind", "base", "--size", str(size)]
        r = alone("planning", "one", *words)
        other = alone(script, str(WORKLOADS), str(size), python=python)
        yield (
            f"| {size} | {r['cpu_s']:.2f} | {other['cpu_s']:.2f} | {r['mb']:.0f} "
            f"| {other['mb']:.0f} | {r['grid_rad2']:.4f} | {other['rad2']:.4f} |"
        )


USERS = {
    "cell": "open, the arm's default solids",
    "hard": "four beams",
    "fine": "panel of 262,144 triangles",
    "clamps": "ten clamps of 20,000 triangles",
    BOXES: "open, an arm of boxes that no user has",
}


def holes(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on drilling as users run it."""
    yield "## Holes, the whole command\n"
    yield (
        "`postproc convert` of the same holes with the defaults of a cell: objective `axial`, "
        "preset `balanced`, clearance 2 mm, strokes swept, program written, linted, run and "
        f"compared (`python -m tools.bench holes`). *Before* is {_version(arguments.other)}, the "
        "checkout that `--other` names, measured right after; times carry what else the machine "
        "does, ratios less so.\n"
    )
    yield "| cell | holes | time [s] | memory [MB] | before [s] | before [MB] | ratio |"
    yield "| --- | --: | --: | --: | --: | --: | --: |"
    cases = [(1000, "cell"), (10000, "cell"), (1000, "hard"), (10000, "hard")]
    for size, kind in (*cases, (1000, "fine"), (1000, "clamps"), (1000, BOXES)):
        own, other = measured(size, kind, other=arguments.other)
        more = (
            "" if other is None else f"{other.cpu:.1f} | {other.mb:.0f} | {own.cpu / other.cpu:.2f}"
        )
        yield (
            f"| {USERS[kind]}{' (tags fail)' if own.files is None else ''} "
            f"| {size} | {own.cpu:.1f} | {own.mb:.0f} | {more or '| |'} |"
        )


def _version(checkout: Path | None) -> str:
    """Return name and version of the product in a checkout."""
    if checkout is None:
        return "nothing here"
    words = [sys.executable, "-m", "postproc", "--version"]
    done = subprocess.run(words, cwd=checkout, capture_output=True, text=True, check=True)
    return done.stdout.strip().replace(", version", "")


def commands(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on whole commands: the examples."""
    del arguments
    yield "## Whole commands\n"
    yield (
        "The first command of each [example](examples.md), start of Python included: read, plan, "
        "write, run the text, compare.\n"
    )
    yield "| example | command | time [s] |\n| --- | --- | --: |"
    for path in sorted((ROOT / "fixtures").glob("*/commands.txt")):
        line = re.search(r"^postproc (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
        if line is None:
            continue
        with tempfile.TemporaryDirectory() as folder, spent() as used:
            words = [folder if word == "expected" else word for word in line.group(1).split()]
            subprocess.run(
                [sys.executable, "-m", "postproc", *words, "--quiet"],
                cwd=path.parent,
                check=True,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdout=subprocess.DEVNULL,
            )
        name = path.parent.name
        yield f"| [{name}](examples.md#{name}) | `{line.group(1).split()[0]}` | {used.cpu:.2f} |"


def paper(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on the paper's experiments."""
    del arguments
    yield "## Beside Jiao et al. 2022\n"
    yield (
        "The paper's identification experiment, repeated on a synthetic KR 500 whose joint "
        "stiffness varies with the posture (`python -m tools.reproduce`): errors under 50 kg at "
        "128 random points, mean and largest [mm]. The robot is code that shares nothing with the "
        "product, which sees readings only. Tool and place of the box are not in the paper; they "
        "are chosen so that the uncompensated error fits.\n"
    )
    words = ["-m", "tools.reproduce", "--truths", "3", "--runs", "20", "--tables", "errors"]
    yield f"```text\n{_printed(words).strip()}\n```"


def diagnosis(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on the diagnosis: campaigns whose truth is withheld."""
    yield "## Diagnosis\n"
    yield (
        f"Campaigns that other code made (other kinematics, other formulas, full static "
        f"equilibrium), with effects withheld; seed {SEED}, {arguments.cases} cases. Designs: "
        "wide, in a grid or in one patch, with and without loads "
        "(`python -m tools.blind generate`, then `score`). Outside the library: an effect that the "
        "product does not know. The weak spot is the small campaign of similar poses, where causes "
        "look alike.\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        cases = ["--cases", str(arguments.cases), "--seed", str(SEED)]
        _printed(["-m", "tools.blind", "generate", "-o", folder, *cases])
        yield _tables(_printed(["-m", "tools.blind", "score", "-d", folder, "--processes", "1"]))


def loop(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on the closed loop: promised against got."""
    yield "## Closed loop\n"
    yield (
        "CAM file, program, readings of a hidden robot under the process force, diagnosis, "
        "compensated program, readings again (`python -m tools.blind loop`). *Promised* and *got* "
        "are of the product, for the points of the part and with the noise of the readings in "
        "both; *before* and *after* are what the real tool misses without noise. *Steepest* is "
        "the largest change of the shift per way of the cut.\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        words = ["--cases", str(arguments.loops), "--seed", str(LOOP_SEED)]
        yield _tables(_printed(["-m", "tools.blind", "loop", "-o", folder, *words]))


def _tables(text: str) -> str:
    """Return a score without its title, headings one level down."""
    lines = [line for line in text.strip().splitlines() if not line.startswith("# ")]
    return "\n".join(f"#{line}" if line.startswith("#") else line for line in lines)


def _printed(words: list[str]) -> str:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *words],
        cwd=ROOT,
        env=environment | {"PYTHONPATH": str(ROOT)},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    return done.stdout


def contours(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on milling: dense contours, and what is refused falsely."""
    yield "## Milling\n"
    yield (
        "`postproc convert` of dense 5-axis contours with the defaults of a cell, a point every "
        "millimetre, laps of 1.5 m, a KR 500 with an angle head, with a table and a clamp in its "
        "way or without solids (`python -m tools.bench contours`). *Lost* is stiffness below the "
        "best that each key tag has by itself, *step* the largest joint step between two points.\n"
    )
    points = [str(count) for count in arguments.points]
    sizes = _printed(["-m", "tools.bench", "contours", "sizes", "--points", *points])
    yield f"```text\n{sizes.strip()}\n```\n"
    yield (
        "Small cuts against dynamic programming over all their steps, each judged along its whole "
        "inside (*exact*); collisions known beforehand or looked at when asked for (*eager*); "
        "contours placed and turned anywhere in reach against every spin of a 5 degree grid in "
        "every branch at every point (*random*). *Other* and *false* are disagreements.\n"
    )
    for what, count in (("exact", 200), ("eager", 50), ("random", arguments.contours)):
        said = _printed(["-m", "tools.bench", "contours", what, "--count", str(count)])
        yield f"- {what}: {'; '.join(said.split(chr(10))).strip('; ')}"


def motions(arguments: argparse.Namespace) -> Iterator[str]:
    """Yield the section on motions: programs executed from outside in random crowded cells."""
    yield "## Motions\n"
    yield (
        "Random crowded cells: an arm with a big head, a part, rods of 2 to 60 mm, blocks, two "
        "of three a rail, corners blended by 0.5 to 300 mm, clearance 2 mm. Holes and slots are "
        "converted, the text is executed by code that shares no check with the product: path "
        "motions followed pose by pose at most 1 mm apart, corners along random polynomials within "
        "KUKA's rules, every pair of solids by coal (`python -m tools.bench executed`). *Random, "
        "free* are random motions that come no nearer than 2.5 mm to anything; what `verify` or "
        "the planner's checks refuse of them is refused falsely.\n"
    )
    words = ["-m", "tools.bench", "executed", "--cells", str(arguments.cells)]
    words += ["--seed", str(MOTION_SEED), "--tags", "240", "--programs", "1"]
    yield _printed(words).strip()


def mutants(_: argparse.Namespace) -> Iterator[str]:
    """Yield the section on mutants: programs broken in one place, and who notices it."""
    yield "## Mutants\n"
    yield (
        "Every example's program broken in one place, one mutant of each rule in each file, drawn "
        "at random: a component moved, a line lost, put in or swapped, a setting changed, a word "
        "replaced, in the `.src` and in the points of the `.dat` (`python -m tools.mutants "
        "fixtures --each 1`). What neither `verify`, `lint` nor the reader notices is executed "
        "beside the program: it does no harm, or it is *missed*.\n"
    )
    yield _printed(["-m", "tools.mutants", "fixtures", "--each", "1", "--seed", "101"]).strip()


SECTIONS = {
    "planning": planning,
    "holes": holes,
    "contours": contours,
    "commands": commands,
    "paper": paper,
    "diagnosis": diagnosis,
    "loop": loop,
    "motions": motions,
    "mutants": mutants,
}


def _kept(page: Path) -> dict[str, str]:
    """Return the sections of the page as it is."""
    if not page.exists():
        return {}
    parts = re.split(r"^<!-- (\w+) -->\n", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "benchmark.md")
    parser.add_argument("--only", nargs="+", choices=list(SECTIONS), default=list(SECTIONS))
    parser.add_argument("--peer", metavar="PYTHON", help="interpreter with tesseract-robotics")
    parser.add_argument("--other", type=Path, help="checkout to compare whole commands with")
    parser.add_argument("--cells", type=int, default=46, help="crowded cells of the motions")
    parser.add_argument("--points", type=int, nargs="+", default=[1000, 20000, 200000])
    parser.add_argument("--contours", type=int, default=1000, help="random contours")
    parser.add_argument("--cases", type=int, default=100, help="campaigns of the diagnosis")
    parser.add_argument("--loops", type=int, default=20, help="closed loops")
    arguments = parser.parse_args()
    sections = _kept(arguments.output)
    for name in arguments.only:
        heading, *lines = SECTIONS[name](arguments)
        sections[name] = "\n".join([heading, f"*Version {__version__}.*\n", *lines]).rstrip()
    text = HEAD.format(cores=os.cpu_count())
    for name in SECTIONS:
        if name in sections:
            text += f"\n<!-- {name} -->\n{sections[name].rstrip()}\n"
    arguments.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
