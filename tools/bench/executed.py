"""Judge ``convert`` and ``verify`` by brute force: random crowded cells, the text executed.

    python -m tools.bench executed [--cells 40] [--tags 60] [--seed 1] [--programs 20]

Each cell has a big tool, a part, rods of 2 to 60 mm and blocks at random, every third one a rail;
corners are blended by 0.5 to 300 mm. Holes and slots are converted as a user would, what fails
being left out; the files are verified as a user would, and the text is executed (``outside``). So
are programs of random motions that only ``verify`` has judged. A hit in what was let pass is a
miss; what ``verify`` refuses while nothing comes nearer than the clearance is a false refusal.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from time import process_time

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, load_cell
from postproc.collision import Scene
from postproc.errors import Finding, RunKind
from postproc.geometry import abc_from_rotation, rotation_from_vector, transform
from postproc.jobs.convert import ConvertRequest, convert, output_paths, read_toolpath
from postproc.jobs.verify import verify
from postproc.kinematics import Kinematics, build
from postproc.units import DEG, MM
from tools.bench.crowded import Job, random_job
from tools.bench.outside import Judge, Machine, Move, Way, allowed, moves_of, ways_of

FEED = 0.006
"""Path motions up to this speed [m/s] cut."""
VARIANTS = 6
ROUNDS = 8
"""So often blocks that fail are left out of a CAM file before the cell is given up."""


@dataclass(slots=True)
class Score:
    """What came out, over all cells."""

    counts: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def note(self, what: str, where: str) -> None:
        """Count something that must not be, and remember where it was."""
        self.counts[what] += 1
        self.wrong.append(f"{what}: {where}")


def converted(job: Job, folder: Path, score: Score) -> Path | None:
    """Return the program of as many blocks as can be; all files are written."""
    (folder / "cell.toml").write_text(job.cell)
    keep = np.ones(len(job.blocks), dtype=np.bool_)
    for _ in range(ROUNDS):
        if not keep.any():
            return None
        text = job.cam(keep)
        (folder / "part.apt").write_text(text)
        done = convert(ConvertRequest(str(folder / "part.apt"), str(folder / "cell.toml")))
        if done.good and done.files:
            for path, content in output_paths(done, folder).items():
                path.write_bytes(content)
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


def judge_conversion(job: Job, folder: Path, rng: np.random.Generator, score: Score) -> None:
    """Convert, verify, execute."""
    program = converted(job, folder, score)
    if program is None:
        score.counts["cells without a program"] += 1
        return
    cell = load_cell(str(folder / "cell.toml"))
    request = ConvertRequest(str(folder / "part.apt"), str(folder / "cell.toml"))
    report = verify(program, cell, read_toolpath(request, cell))
    for violation in report.violations[:3]:
        score.note("verify refuses what convert wrote", f"{folder.name}: {violation}")
    arm = build(cell.robot)
    machine, judge = Machine(cell, arm), Judge(cell, arm, cell.limits.clearance)
    moves = moves_of(program.read_text(), len(cell.external_axes))
    score.counts["cells"] += 1
    score.counts["moves"] += len(moves)
    score.counts["blended"] += sum(move.cdis > 0.0 for move in moves)
    score.counts["rail moves"] += _travels(moves)
    if report.run is not None and len(report.run.paths) != len(moves):
        score.note("another number of motions", f"{len(report.run.paths)} and {len(moves)}")
    ways = list(ways_of(machine, moves, rng, FEED, VARIANTS))
    allowed(ways, np.asarray(cell.tool.axis))
    for way in ways:
        _judge_way(judge, way, moves, folder.name, score)


def _travels(moves: list[Move]) -> int:
    return sum(
        bool(np.abs(b.external - a.external).max(initial=0.0) > 0.0) for a, b in pairwise(moves)
    )


def _judge_way(judge: Judge, way: Way, moves: list[Move], where: str, score: Score) -> None:
    place = f"{where} line {moves[way.move].line} {way.what}"
    if way.what == "lost":
        score.note("lost", place)
        return
    score.counts["configurations"] += len(way.q)
    hit = judge.met(way.q, way.touch)
    if hit:
        score.note("MISSED", f"{place}: {hit}")


def random_program(rng: np.random.Generator, machine: Machine, free: FloatArray, count: int) -> str:
    """Return the text of random motions between free configurations (f, 6 + k)."""
    lines = ["DEF rnd( )", "BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,1)"]
    lines += ["$IPO_MODE=#BASE", "$ORI_TYPE=#VAR", "$CIRC_TYPE=#BASE", "$ADVANCE=3"]
    lines += ["$VEL.ORI1=200.0", "$VEL.ORI2=200.0", "$APO.CORI=5.0", "$APO.CPTP=100"]
    lines += ["BAS(#VEL_PTP,10)", "$VEL.CP=0.05"]
    q = free[rng.integers(len(free))]
    lines.append(_joints(q))
    for _ in range(count):
        other = free[rng.integers(len(free))]
        blend = " C_DIS" if rng.uniform() < 0.8 else ""
        most = machine.cell.motion.approximation / MM
        lines.append(f"$APO.CDIS={0.999 * np.exp(rng.uniform(np.log(0.5), np.log(most))):.4f}")
        if rng.uniform() < 0.4:
            q = q + rng.uniform(0.05, 0.4) * (other - q)
            lines.append(_joints(q) + blend)
        elif (step := _line(rng, machine, q, other)) is not None:
            q, text = step
            lines.append(text + blend)
    return "\r\n".join([*lines, "END", ""])


def _line(
    rng: np.random.Generator, machine: Machine, q: FloatArray, other: FloatArray
) -> tuple[FloatArray, str] | None:
    """Return where a random straight motion leads to and its text, None if the arm cannot."""
    way = rng.normal(size=3)
    size = np.exp(rng.uniform(np.log(2e-3), np.log(0.6)))
    turn = rng.uniform(-0.3, 0.3, 3) * min(1.0, size / 0.2)
    T = machine.tcp(q[None])[0]
    target = transform(
        T[:3, :3] @ rotation_from_vector(turn), T[:3, 3] + size * way / np.linalg.norm(way)
    )
    external = q[6:] + (other[6:] - q[6:]) * rng.uniform(0.0, 0.3) * (rng.uniform() < 0.3)
    flange = machine.T_robroot_base(external[None]) @ target @ np.linalg.inv(machine.tool)
    found, valid = machine.arm.ik_in(flange, np.array([int(machine.arm.slot(q[:6]))]))
    found = found[0] + 2.0 * np.pi * np.round((q[:6] - found[0]) / (2.0 * np.pi))
    if not valid[0] or np.abs(found - q[:6]).max() > 40.0 * DEG:
        return None
    return np.concatenate([found, external]), _pose(target, external)


def _joints(q: FloatArray) -> str:
    parts = [f"A{i + 1} {value / DEG:.5f}" for i, value in enumerate(q[:6])]
    return "PTP {" + ",".join([*parts, *_externals(q[6:])]) + "}"


def _pose(T: FloatArray, external: FloatArray) -> str:
    names, values = "XYZABC", [*(T[:3, 3] / MM), *(abc_from_rotation(T[:3, :3]) / DEG)]
    parts = [f"{name} {value:.5f}" for name, value in zip(names, values, strict=True)]
    return "LIN {" + ",".join([*parts, *_externals(external)]) + "}"


def _externals(external: FloatArray) -> list[str]:
    return [f"E{i + 1} {value / MM:.5f}" for i, value in enumerate(external)]


def judge_programs(
    cell: Cell, arm: Kinematics, folder: Path, rng: np.random.Generator, count: int, score: Score
) -> None:
    """Judge programs of random motions by ``verify``, then by execution."""
    machine, judges = Machine(cell, arm), Judges.of(cell, arm)
    scene = Scene.build(cell, arm)
    low, high = (
        np.array([-1.2, -2.2, 0.2, -2.5, -1.8, -3.0]),
        np.array([1.2, -0.4, 2.4, 2.5, 1.8, 3.0]),
    )
    q = rng.uniform(low, high, (4000, 6))
    q = np.hstack([q, rng.uniform(-1.5, 1.5, (len(q), len(cell.external_axes)))])
    q = q[np.abs(q[:, 4]) > 0.2]
    free = q[~scene.kept(3e-3).check(q).hit]
    if len(free) < 20:
        return
    for _ in range(count):
        text = random_program(rng, machine, free, 14)
        path = folder / "rnd.src"
        path.write_bytes(text.encode("ascii"))
        report = verify(path, cell)
        moves = moves_of(text, len(cell.external_axes))
        ways = list(ways_of(machine, moves, rng, 1.0, 2 * VARIANTS))
        for way in ways:
            way.touch = np.full(len(way.q), way.at_feed)
        _compare(report.violations, moves, ways, judges, folder.name, score)


@dataclass(frozen=True, slots=True)
class Judges:
    """All pairs at the clearance of the cell, and at half a millimetre more."""

    clearance: Judge
    wider: Judge

    @classmethod
    def of(cls, cell: Cell, arm: Kinematics) -> Judges:
        """Return the judges of a cell."""
        wide = cell.limits.clearance + 0.5 * MM
        return cls(Judge(cell, arm, cell.limits.clearance), Judge(cell, arm, wide))

    def compare(self, key: tuple[int, str], ways: list[Way], score: Score, *, refused: bool) -> str:
        """Count a verdict on a motion or corner; return what it hits although it was let pass."""
        what = key[1]
        hit = next((h for h in (self.clearance.met(w.q, w.touch) for w in ways) if h), "")
        score.counts[f"judged {what}s"] += 1
        score.counts[f"hit {what}s"] += bool(hit)
        score.counts[f"refused {what}s"] += refused
        if refused and not hit:
            near = any(self.wider.met(w.q, w.touch) for w in ways)
            score.counts[f"false {what}s"] += 1
            score.counts[f"false {what}s beyond 0.5 mm"] += not near
        return "" if refused else hit


def _compare(
    found: Sequence[Finding],
    moves: list[Move],
    ways: list[Way],
    judges: Judges,
    where: str,
    score: Score,
) -> None:
    """Compare the verdicts of ``verify`` motion by motion and corner by corner."""
    refused = {(line, what) for finding in found for line, what in _refused(finding)}
    unknown = min((line for line, what in refused if not what), default=10**9)
    keys: dict[tuple[int, str], list[Way]] = {}
    for way in ways:
        if way.what == "lost" or moves[way.move].line >= unknown:
            break
        keys.setdefault((moves[way.move].line, way.what), []).append(way)
    lines = [move.line for move in moves]
    wrong = {line for line, what in refused if what == "other"}
    for key, group in keys.items():
        behind = lines[min(lines.index(key[0]) + 1, len(lines) - 1)]
        if key[0] in wrong or (key[1] == "corner" and behind in wrong):
            score.counts["refused for other reasons"] += 1
            continue
        hit = judges.compare(key, group, score, refused=key in refused)
        if hit:
            score.note(f"MISSED in a random {key[1]}", f"{where} line {key[0]}: {hit}")


def _refused(finding: Finding) -> Iterator[tuple[int, str]]:
    """Yield line and part of the program that a finding refuses, no part: it cannot be run."""
    line = 0 if finding.source is None else finding.source.line
    at_corner = "corner" in finding.message
    if finding.code in (RunKind.UNREACHABLE, RunKind.TURN):
        yield line, ""
    elif finding.code == RunKind.CORNER or (finding.code == RunKind.COLLISION and at_corner):
        yield line, "corner"
    elif finding.code == RunKind.COLLISION:
        yield line, "motion"
    else:
        yield line, "other"


def judged(cells: range, tags: int, seed: int, programs: int) -> Score:
    """Return the score over random cells."""
    score = Score()
    for number in cells:
        rng = np.random.default_rng([seed, number])
        with_rail = number % 3 == 2
        job = random_job(rng, tags // 2 if with_rail else tags, with_rail=with_rail)
        with tempfile.TemporaryDirectory(prefix=f"cell{number}_") as name:
            folder = Path(name)
            (folder / "cell.toml").write_text(job.cell)
            if programs:
                cell = load_cell(str(folder / "cell.toml"))
                judge_programs(cell, build(cell.robot), folder, rng, programs, score)
            if tags:
                judge_conversion(job, folder, rng, score)
        print(
            number, f"{process_time():.0f} s", json.dumps(score.counts), file=sys.stderr, flush=True
        )
    return score


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description="Converted programs against brute force.")
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tags", type=int, default=60)
    parser.add_argument("--programs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    start = process_time()
    which = range(options.first, options.first + options.cells)
    score = judged(which, options.tags, options.seed, options.programs)
    for name, count in sorted(score.counts.items()):
        print(f"{name:<40} {count}")
    for line in score.wrong[:40]:
        print(f"  {line}")
    print(f"{process_time() - start:.0f} s of CPU time")


if __name__ == "__main__":
    main()
