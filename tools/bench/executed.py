"""Judge ``convert`` and ``verify`` by brute force: random crowded cells, the text executed.

    python -m tools.bench executed [--cells 40] [--first 0] [--tags 500] [--programs 3] [--seed 1]
                                   [--log FILE]

Each cell has a big tool, a part, rods of 2 to 60 mm and blocks at random, two of three a rail with
more rods beside it, one of them also cuts along its rail while E1 moves; corners are blended by 0.5
to 300 mm. Holes and slots are converted as a user would, what fails being left out; the files are
verified as a user would, and the text is executed (``outside``). So are programs of random motions
that ``verify`` and the planner's checks have judged. A hit in what was let pass is a miss; what is
refused while nothing comes near is a false refusal.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell, load_cell
from postproc.geometry import inverse, rotation_about, transform
from postproc.jobs.convert import ConvertRequest, convert, land, read_toolpath
from postproc.jobs.verify import verify
from postproc.units import DEG, MM
from tools.bench.crowded import HOMES, Job, random_job
from tools.bench.outside import allowed, moves_of, ways_of
from tools.bench.programs import judge_programs
from tools.bench.score import Place, Score, corner_of, kind_of, table

FEED = 0.006
"""Path motions up to this speed [m/s] cut."""
VARIANTS = 6
RAIL_TAGS = 2
"""So many times fewer tags on a rail, where the arm travels between them."""
ALONG = 2
"""Of three cells the one that mills along its rail, which moves during the cut."""
SPARE = 4
"""So many times more tags are drawn than are asked for."""
POSTURES = 4
"""Blocks with a tag that fewer postures reach, of 96 at a place, are not asked for."""
ROUNDS = 4
"""So often blocks that fail are left out of a CAM file before the cell is given up."""


def placed(job: Job, folder: Path) -> Place:
    """Write the cell file with the home that is free at most places of the rail; return its place.

    A user takes one that is free.
    """
    place = _with_home(job, folder, HOMES[0])
    rails, touch = _rails(place.cell, 0.1), np.zeros(1, dtype=np.bool_)
    hits = []
    for home in HOMES:
        q = np.array([float(value) for value in home.strip("[]").split(",")]) * DEG
        rows = np.hstack([np.repeat(q[None], len(rails), axis=0), rails])
        hits.append(sum(bool(place.judge.met(row[None], touch)) for row in rows))
        if not hits[-1]:
            break
    return _with_home(job, folder, HOMES[int(np.argmin(hits))])


def _with_home(job: Job, folder: Path, home: str) -> Place:
    path = folder / "cell.toml"
    path.write_text(job.cell.replace(HOMES[0], home))
    return Place.of(load_cell(str(path)))


def _rails(cell: Cell, step: float) -> FloatArray:
    """Return where the rail stands, (m, k) every step [m]; once and nothing without one."""
    if not cell.external_axes:
        return np.zeros((1, 0))
    axis = cell.external_axes[0]
    return np.arange(axis.q_min, axis.q_max + 1e-9, step)[:, None]


def reachable(job: Job, place: Place, most: int) -> BoolArray:
    """Return blocks (b,) of so many tags at which the arm is free somehow.

    What convert would have to refuse anyway is not asked for.
    """
    found = np.zeros(len(job.blocks), dtype=np.bool_)
    tags = 0
    for number, block in enumerate(job.blocks):
        numbers = [line[5:].split(",") for line in block.split("\n") if line.startswith("GOTO/")]
        goals = np.array(numbers, dtype=np.float64)
        found[number] = all(_stands_free(place, tag[:3] * MM, tag[3:]) for tag in goals)
        tags += len(numbers) * int(found[number])
        if tags >= most:
            break
    return found


def _stands_free(place: Place, p_base: FloatArray, up: FloatArray) -> bool:
    """Return whether the arm is free in some postures at (3,) [m] and above it, away from up."""
    cell, machine = place.cell, place.machine
    R = pin.Quaternion.FromTwoVectors(np.asarray(cell.tool.axis), -up).toRotationMatrix()
    R = rotation_about(up, np.arange(0.0, 360.0, 30.0) * DEG) @ R
    above = p_base + np.multiply.outer([0.0, 0.03, 0.07], up / np.linalg.norm(up))
    T = transform(R[:, None], above[None])
    rails = _rails(cell, 0.75)
    flange = machine.T_robroot_base(rails)[:, None, None] @ T @ inverse(machine.tool)
    q, valid = machine.arm.ik(flange.reshape(-1, 4, 4))
    valid &= ((q > cell.robot.q_min) & (q < cell.robot.q_max)).all(axis=2)
    q = np.swapaxes(q.reshape(-1, len(above), 8, 6), 1, 2).reshape(-1, len(above), 6)
    valid = np.swapaxes(valid.reshape(-1, len(above), 8), 1, 2).reshape(-1, len(above))
    touch = np.ones(len(above), dtype=np.bool_)
    found = 0
    for row in np.flatnonzero(valid.all(axis=1)).tolist():
        rail = np.repeat(rails[row // (8 * len(R))][None], len(above), axis=0)
        found += not place.judge.met(np.hstack([q[row], rail]), touch)
        if found == POSTURES:
            return True
    return False


def converted(job: Job, place: Place, tags: int, folder: Path, score: Score) -> Path | None:
    """Return the program of as many blocks as can be; all files are written."""
    keep = reachable(job, place, tags)
    for _ in range(ROUNDS):
        if not keep.any():
            return None
        text = job.cam(keep)
        (folder / "part.apt").write_text(text)
        done = convert(ConvertRequest(str(folder / "part.apt"), str(folder / "cell.toml")))
        if done.good and done.files:
            land(done, folder)
            return folder / f"{done.name.lower()}.src"
        lines = [f.source.line for f in done.findings if f.is_error and f.source is not None]
        for finding in done.findings:
            if finding.is_error:
                score.counts[f"refused {finding.code}"] += finding.count
                if not finding.code.startswith(("PLN1", "PLN2")):
                    score.note("convert fails its own check", str(finding)[:200])
        starts = np.cumsum([4] + [block.count("\n") for block in job.cam_blocks(keep)])
        block = np.searchsorted(starts, np.array(lines, dtype=np.int64) - 1, side="right") - 1
        block = block[(block >= 0) & (block < int(keep.sum()))]
        if not len(block):
            return None
        keep[np.flatnonzero(keep)[block]] = False
    return None


def judge_conversion(
    job: Job, place: Place, tags: int, folder: Path, rng: np.random.Generator, score: Score
) -> None:
    """Convert, verify, execute."""
    program = converted(job, place, tags, folder, score)
    if program is None:
        score.counts["cells without a program"] += 1
        return
    cell, machine = place.cell, place.machine
    request = ConvertRequest(str(folder / "part.apt"), str(folder / "cell.toml"))
    report = verify(program, cell, read_toolpath(request, cell))
    for violation in report.violations[:3]:
        score.note("verify refuses what convert wrote", f"{folder.name}: {violation}")
    moves = moves_of(program.read_text(), len(cell.external_axes))
    score.counts["cells"] += 1
    score.counts["moves"] += len(moves)
    kinds = [kind_of(moves, number) for number in range(len(moves))]
    classes = {("motion", number): kind for number, kind in enumerate(kinds)}
    for number, move in enumerate(moves):
        if move.cdis > 0.0:
            classes["corner", number] = corner_of(kinds, number)
    score.counts.update(f"{name}: converted" for name in classes.values())
    if report.run is not None and len(report.run.paths) != len(moves):
        score.note("another number of motions", f"{len(report.run.paths)} and {len(moves)}")
    ways = ways_of(machine, moves, rng, FEED, VARIANTS)
    allowed(ways, np.asarray(cell.tool.axis))
    for way in ways:
        at = f"{folder.name} line {moves[way.move].line}"
        if way.what == "lost":
            score.note("lost", at)
            continue
        score.counts["configurations"] += len(way.q)
        hit = place.judge.met(way.q, way.touch)
        if hit:
            name = classes[way.what, way.move]
            score.counts[f"{name}: hit, let pass"] += 1
            score.note("MISSED", f"{at} {name}: {hit}")


def judged(number: int, tags: int, seed: int, programs: int) -> Score:
    """Return the score of a random cell."""
    score = Score()
    rng = np.random.default_rng([seed, number])
    with_rail = number % 3 > 0
    tags = tags // RAIL_TAGS if with_rail else tags
    job = random_job(rng, SPARE * tags, with_rail=with_rail, along=number % 3 == ALONG)
    with tempfile.TemporaryDirectory(prefix=f"cell{number}_") as name:
        folder = Path(name)
        place = placed(job, folder)
        if programs:
            judge_programs(place, folder, rng, programs, score)
        if tags:
            judge_conversion(job, place, tags, folder, rng, score)
    return score


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description="Converted programs against brute force.")
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tags", type=int, default=500)
    parser.add_argument("--programs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--log", type=Path, help="a line for each cell; those there are counted")
    options = parser.parse_args()
    total = Score()
    done: dict[int, dict[str, Any]] = {}
    if options.log and options.log.exists():
        lines = options.log.read_text().splitlines()
        done = {line["cell"]: line for line in map(json.loads, lines)}
    for number in range(options.first, options.first + options.cells):
        if number not in done:
            score = judged(number, options.tags, options.seed, options.programs)
            lists = {"wrong": score.wrong, "false": score.false}
            done[number] = {"cell": number, "counts": score.counts, **lists}
            if options.log:
                with options.log.open("a") as log:
                    log.write(json.dumps(done[number]) + "\n")
        total.counts.update(done[number]["counts"])
        total.wrong += done[number]["wrong"]
        total.false += done[number]["false"]
    print("\n".join(table(total.counts)))
    for line in (*total.wrong[:40], *total.false[:40]):
        print(f"  {line}")


if __name__ == "__main__":
    main()
