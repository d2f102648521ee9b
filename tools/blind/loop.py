"""The closed loop on a hidden robot: CAM, program, readings, diagnosis, better program, readings.

A part is drilled or milled by the program of the product, driven by the hidden robot under the
process force, and measured at its points. These rows, with a campaign of loaded poses, are
diagnosed; the program is made again with the model that was found, driven by the same robot and
measured again. What came of it is asked of the product (``diagnose --before``), and worked out here
along the whole path, from the text of the programs alone.

In a drive a gear crosses its gap while the joint turns back by it: the side of each joint is
between -1 and 1, as far as it has crossed. Readings tell the side it was last moved to.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.blind.beyond import make
from tools.blind.campaign import Plan, Rows, drive
from tools.blind.chain import Array
from tools.blind.program import HOME, Drive, drive_program, read_krl
from tools.blind.robots import KR210, KR500, RobotClass, cell_text
from tools.blind.world import Hidden, simulate

TITLE = "Closed loop"
HELP = "CAM to program to readings to a better program"
KINDS = ("drilling", "milling")
BASE = np.array([1.3, 0.0, 0.5])
"""Corner of the part in the robot root [m], axes of the root."""
FEED = 0.025
STRETCH = 0.02
"""Length [m] of the stretches of a path that are compared."""
SIGMA = 1.5e-5
_LIMIT_S = 600.0
_SMALLEST = 1e-6
_MOVED = 2e-5
"""A joint that has moved by this much [rad] is logged to have moved."""


@dataclass(frozen=True)
class Job:
    """A hidden robot and its part.

    Args:
        number, kind: of the case; robot: nominal; hidden: its effects; force: (3,) on the tool in
            its axes [N]; source: name and text of the CAM file; points: (t, 3) in the part [m];
            lines: (t,) of the file.
    """

    number: int
    kind: str
    robot: RobotClass
    hidden: tuple[Hidden, ...]
    force: Array
    source: tuple[str, str]
    points: Array
    lines: tuple[int, ...]


@dataclass(frozen=True)
class Driven:
    """A program on the hidden robot: the drive, the side of each joint, and what is real (k, 3).

    ``real`` in the part; ``rows``: what acted in each pose; ``cutting`` (k,); ``at`` (t,): the
    pose of each point of the part.
    """

    drive: Drive
    rows: Rows
    real: Array
    cutting: Array
    at: Array


def draw(number: int, seed: int) -> Job:
    """Return a case; even numbers mill."""
    rng = np.random.default_rng([seed, 17, number])
    kind = KINDS[1 - number % 2]
    robot = (KR500, KR210)[rng.integers(2)]
    rows = poses(robot, rng)
    names = ["joint_compliance", "backlash", *rng.choice(["joint_offset", "windup", ""], 1)]
    sizes = {"joint_compliance": 3e-4, "backlash": 1.2e-4, "joint_offset": 2e-4, "windup": 4e-5}
    hidden = []
    for name in filter(None, names):
        effect = make(str(name), rng, robot, rows)
        size = sizes[str(name)] * float(np.exp(rng.normal(0.0, 0.25)))
        for _ in range(3):
            moved = simulate(robot, rows, [effect]).point - simulate(robot, rows, []).point
            effect = effect.scaled(size / float(np.sqrt(np.mean(moved**2))))
        hidden.append(effect)
    share = rng.uniform(0.4, 0.8) * robot.force
    if kind == "drilling":
        points, text = holes(rng)
        source, force = ("holes.csv", text), np.array([0.05, 0.05, -1.0]) * share
        lines = tuple(range(2, 2 + len(points)))
    else:
        points, text = _contour(rng)
        source, force = ("contour.apt", text), np.array([0.5, 0.4, -0.3]) * share
        lines = tuple(range(7, 7 + len(points)))
    return Job(number, kind, robot, tuple(hidden), force, source, points, lines)


def poses(robot: RobotClass, rng: np.random.Generator) -> Rows:
    """Return loaded rows that the sizes of effects are set by."""
    return drive(robot, Plan("wide_loads", 60, "three", 0.6, False, 0, False, 0.0), rng)


def holes(rng: np.random.Generator, count: int = 40) -> tuple[Array, str]:
    """Return the bottoms of holes in rows there and back, and their CSV file [mm]."""
    pitch = rng.uniform(18.0, 30.0)
    at = np.stack([pitch * (np.arange(count) % 8), pitch * (np.arange(count) // 8)], axis=1)
    at[(np.arange(count) // 8) % 2 == 1, 0] = 7 * pitch - at[(np.arange(count) // 8) % 2 == 1, 0]
    lines = [f"{x:.4f},{y:.4f},0,0,0,1,8" for x, y in at]
    bottom = np.column_stack([at, np.full(count, -8.0)])
    return 1e-3 * bottom, "\n".join(["x,y,z,i,j,k,depth", *lines]) + "\n"


def _contour(rng: np.random.Generator, count: int = 220) -> tuple[Array, str]:
    """Return the points of a closed wavy contour and its APT file [mm]: joints turn back often."""
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    radius = rng.uniform(50.0, 90.0) * np.ones(count)
    for wave in (2, 3, 5):
        share = rng.uniform(0.04, 0.16) * 2.0 / wave
        radius *= 1.0 + share * np.cos(wave * angle + rng.uniform(0.0, 6.3))
    at = np.stack([100 + radius * np.cos(angle), 100 + radius * np.sin(angle), 0 * angle], axis=1)
    at = np.round(at, 4)
    words = [f"GOTO/{x:.4f},{y:.4f},{z:.4f}" for x, y, z in at]
    first, last = at[0], at[-1]
    text = [
        *("PARTNO/CONTOUR", "UNITS/MM", "LOADTL/1", "RAPID"),
        f"GOTO/{first[0]:.4f},{first[1]:.4f},50,0,0,1",
        f"FEDRAT/{6e4 * FEED:.0f},MMPM",
        *(*words, "RAPID", f"GOTO/{last[0]:.4f},{last[1]:.4f},50", "FINI"),
    ]
    return 1e-3 * at, "\n".join(text) + "\n"


def run(number: int, seed: int, folder: Path) -> dict[str, Any]:
    """Run the loop of a case in a folder; return what was promised and what came of it."""
    job = draw(number, seed)
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([job.number, 18])
    cell = folder / "cell.toml"
    cell.write_text(cell_of(job), encoding="utf-8")
    source = folder / job.source[0]
    source.write_text(job.source[1], encoding="utf-8")
    first = driven(job, program_of(folder / "plain", source, cell, None))
    campaign = drive(job.robot, Plan("wide_loads", 120, "three", 0.8, False, 16, True, 0.0), rng)
    before = folder / "before.csv"
    _write(before, job, [*_readings(first), ("c", campaign, campaign.direction)], rng)
    found = folder / "gap"
    told = asked(["diagnose", before, "--cell", cell, "-o", found])
    model = found / "model.toml"
    second = driven(job, program_of(folder / "compensated", source, cell, model))
    after = folder / "after.csv"
    _write(after, job, _readings(second), rng)
    answer = asked(["diagnose", after, "--before", before, "--cell", cell, "--model", model])
    return {
        "case": job.number,
        "kind": job.kind,
        "robot": job.robot.name,
        "hidden": [effect.name for effect in job.hidden],
        "verdict": told["verdict"],
        "named": told["adopted"],
        "product": answer["before"],
        **compared(job, first, second),
    }


def driven(job: Job, path: Path) -> Driven:
    """Return a program on the hidden robot.

    Raises:
        ValueError: if a point of the part is not in the program.
    """
    T_base, T_tool = np.eye(4), np.eye(4)
    T_base[:3, 3], T_tool[:3, 3] = BASE, job.robot.tool
    run = drive_program(read_krl(path), job.robot.arm, T_base, T_tool)
    cutting = run.speed <= 1.001 * FEED
    force = np.einsum("nij,j->ni", run.turn, job.force) * cutting[:, None]
    side = sides(np.vstack([HOME, run.q]), lost_motion(job.hidden))[1:]
    n = len(run.q)
    rows = Rows(
        run.q, force, np.arange(n) * 1.0, np.full(n, 20.0), side, np.zeros((n, 6)),
        np.full(n, 2.0), np.arange(n), 20.0,
    )  # fmt: skip
    real = simulate(job.robot, rows, job.hidden).point - BASE
    return Driven(run, rows, real, cutting, _served(job, run))


def sides(q: Array, lost: Array) -> Array:
    """Return how far (k, 6) each gear has crossed its gap ``lost`` (6,) [rad], from -1 to 1."""
    found = np.zeros_like(q)
    for k in range(1, len(q)):
        found[k] = np.clip(found[k - 1] + 2.0 * (q[k] - q[k - 1]) / lost, -1.0, 1.0)
    return found


def lost_motion(hidden: tuple[Hidden, ...]) -> Array:
    """Return what each gear loses [rad] when its joint turns back."""
    total = np.full(6, _SMALLEST)
    for effect in hidden:
        if effect.name == "backlash":
            total = total + 2.0 * effect.strength * effect.parameters["half"]
        if effect.name == "windup":
            total = total + 2.0 * effect.strength * effect.parameters["dry"]
    return total


def compared(job: Job, first: Driven, second: Driven) -> dict[str, Any]:
    """Return how far both programs miss the part: at its points, and along the path [mm]."""
    missed = [np.linalg.norm(d.real[d.at] - job.points, axis=1) for d in (first, second)]
    found: dict[str, Any] = {
        "points": len(job.points),
        "rms_before_mm": 1e3 * _rms(missed[0]),
        "rms_after_mm": 1e3 * _rms(missed[1]),
        "largest_shift_mm": 1e3 * float(np.max(np.linalg.norm(_shift(job, second), axis=1))),
        "largest_gap_mm": 1e3 * float(np.max(missed[0])),
    }
    if job.kind == "milling":
        rms = np.array([_stretches(job, d) for d in (first, second)])
        found |= {
            "stretches": rms.shape[1],
            "worse_stretches": int(np.sum(rms[1] > rms[0] + 2e-6)),
            "worst_stretch_mm": 1e3 * float(np.max(rms[1] - rms[0])),
            "largest_step": _steepest(job, second),
        }
    return found


def _shift(job: Job, run: Driven) -> Array:
    return np.asarray(run.drive.point[run.at] - job.points)


def _steepest(job: Job, run: Driven) -> float:
    """Return the largest change of the shift from point to point, per way between them."""
    way = np.linalg.norm(np.diff(job.points, axis=0), axis=1)
    step = np.linalg.norm(np.diff(_shift(job, run), axis=0), axis=1)
    return float(np.max(step / way))


def _stretches(job: Job, run: Driven) -> Array:
    """Return the rms [m] by which the real path is off its line, in stretches of the line."""
    between = np.arange(run.at[0], run.at[-1] + 1)
    path = run.real[between]
    starts, ways = job.points[:-1], np.diff(job.points, axis=0)
    length = np.linalg.norm(ways, axis=1)
    along = np.concatenate([[0.0], np.cumsum(length)])
    # the piece of line that a pose is on is known from the command it belongs to
    tag = np.searchsorted(run.at, between) - 1
    tag = np.clip(tag, 0, len(starts) - 1)
    share = np.sum((path - starts[tag]) * ways[tag], axis=1) / length[tag] ** 2
    off = path - starts[tag] - np.clip(share, 0.0, 1.0)[:, None] * ways[tag]
    place = along[tag] + np.clip(share, 0.0, 1.0) * length[tag]
    number = (place / STRETCH).astype(int)
    square = np.bincount(number, np.sum(off**2, axis=1))
    return np.asarray(np.sqrt(square / np.maximum(np.bincount(number), 1)))


def _served(job: Job, run: Drive) -> Array:
    """Return the pose (t,) that serves each point: the last of its line, of a hole the lowest."""
    found = []
    for line in job.lines:
        own = [k for k, command in enumerate(run.commands) if command.line == line]
        if not own:
            raise ValueError(f"line {line} of the part is not in the program")
        ends = run.ends[own]
        deepest = int(np.argmin(run.point[ends, 2])) if job.kind == "drilling" else -1
        found.append(int(ends[deepest]))
    return np.array(found)


Reading = tuple[str, Rows, Array]
"""First letter of the ids; what acts; the sides (n, 6) as they are logged."""


def _readings(run: Driven) -> list[Reading]:
    """Return the rows at the points; logged is the side that a joint was last moved to."""
    last = sides(np.vstack([HOME, run.drive.q]), np.full(6, _MOVED))[1:]
    return [("p", run.rows.take(run.at), np.sign(last[run.at]))]


def _write(path: Path, job: Job, parts: list[Reading], rng: np.random.Generator) -> None:
    """Write readings: points of the part by their number, poses of the campaign by theirs."""
    head = ["id", *(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm", "time_s"]
    head += [*(f"dir{k}" for k in range(1, 7)), "fx_N", "fy_N", "fz_N"]
    lines, start = [",".join(head)], 0.0
    for name, rows, logged in parts:
        point = simulate(job.robot, rows, job.hidden).point
        point = point + rng.normal(0.0, SIGMA, point.shape)
        for k in range(len(point)):
            values = [*np.rad2deg(rows.q[k]), *(1e3 * point[k]), start + 30.0 * k]
            cells = [f"{v:.7f}" for v in values]
            cells += [f"{v:.0f}" for v in logged[k]]
            cells += [f"{v:.3f}" for v in rows.force[k]]
            lines.append(",".join([f"{name}{k}", *cells]))
        start += 30.0 * len(point)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rms(length: Array) -> float:
    return float(np.sqrt(np.mean(length**2)))


def cell_of(job: Job) -> str:
    """Return the cell file of a case."""
    text = cell_text(job.robot, 1.0 / job.robot.arm.give)
    old, new = "[1200, 0, 300]", str([round(1e3 * v, 6) for v in BASE.tolist()])
    force = ", ".join(f"{v:.3f}" for v in job.force)
    return text.replace(old, new) + (
        f"\n[process]\nforce_N = [{force}]\n\n[motion]\nfeed_mm_min = {6e4 * FEED:.0f}\n"
    )


def table(cases: list[dict[str, Any]], title: str) -> str:
    """Return the cases as a table in markdown: promised against got."""
    names = {
        "rms_before_mm": "before [mm]", "rms_after_mm": "after [mm]",
        "worse_stretches": "worse stretches", "largest_step": "steepest",
    }  # fmt: skip
    head = ["case", "kind", "robot", "hidden", "named", "promised", "got", "kept", *names.values()]
    lines = [f"# {title}", "", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for case in cases:
        told = case["product"]
        cells = [str(case["case"]), case["kind"], case["robot"], *(
            ", ".join(case[key]) for key in ("hidden", "named")
        )]  # fmt: skip
        cells += [f"{100 * told[key]:.0f} %" for key in ("promised", "shrinkage")]
        cells.append("yes" if told["kept"] else "no")
        for key in names:
            value = case.get(key, "")
            cells.append(f"{value:.3f}" if isinstance(value, float) else str(value))
        lines.append("| " + " | ".join(cells) + " |")
    less = [c["product"]["promised"] - c["product"]["shrinkage"] for c in cases]
    lines += [
        "",
        f"kept: {sum(c['product']['kept'] for c in cases)} of {len(cases)}; promised less got: "
        f"median {100 * float(np.median(less)):.1f}, largest {100 * max(less):.1f} points",
        "",
    ]
    return "\n".join(lines)


def program_of(out: Path, source: Path, cell: Path, model: Path | None) -> Path:
    """Return the program that the product makes of a CAM file, with a model or without."""
    more = [] if model is None else ["--model", model]
    asked(["convert", source, "--cell", cell, "-o", out, *more])
    return min(out.glob("*.src"), key=lambda path: len(path.name))


def asked(words: list[Any]) -> dict[str, Any]:
    """Return the JSON answer of the product.

    Raises:
        RuntimeError: if it gives none.
    """
    command = [sys.executable, "-m", "postproc", *map(str, words), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_LIMIT_S, check=False)
    if done.returncode > 1 or not done.stdout.strip():
        raise RuntimeError(f"{' '.join(command[3:])}: {done.stderr[-800:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer
