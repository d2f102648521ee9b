"""The closed loop along a path: program, recording, diagnosis, better program, on a hidden robot.

A contour with corners and reversals is converted, driven by the dynamic robot under hidden causes
and recorded; the program is made again with the model that was found and driven by the same robot.
What counts is how far the tool is off the contour of the CAM file, over its length.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from tools.blind.chain import Array
from tools.blind.program import Command, read_krl
from tools.blind.robots import KR210, KR500, RobotClass, cell_text
from tools.blind.traces.cases import Recorder, recorded, write_log
from tools.blind.traces.effects import EFFECTS, Motion
from tools.blind.traces.robot import Path as Way
from tools.blind.traces.robot import fk, follow, jacobian

DEG = np.pi / 180.0
BASE = np.array([1.3, 0.0, 0.5])
"""Corner of the part in the robot root [m], axes of the root."""
CAUSES = (
    ("servo_lag",),
    ("reversal_error",),
    ("servo_lag", "reversal_error"),
    ("servo_lag", "reversal_error"),
    ("controller_delay", "reversal_error"),
    ("controller_delay",),
)
STEP, NEAR = 5e-4, 0.015
"""Places of the contour are this far apart [m]; the tool passes each within so much of its way."""
RUNS = 2


@dataclass(frozen=True)
class Job:
    """A hidden robot and its contour: (t, 3) in the part [m]; text of the CAM file."""

    robot: RobotClass
    causes: tuple[str, ...]
    points: Array
    text: str
    feed: float
    acceleration: float
    form: str
    state: int


def draw(seed: int) -> Job:
    """Return a case."""
    rng = np.random.default_rng([seed, 31])
    robot = (KR500, KR210)[rng.integers(2)]
    feed = round(rng.uniform(0.03, 0.12), 4)
    corners = [np.zeros(2)]
    heading = rng.uniform(0, 2 * np.pi)
    for _ in range(rng.integers(5, 9)):
        heading += rng.choice([-1, 1]) * rng.uniform(0.6, 2.0)
        step = rng.uniform(0.04, 0.12)
        while np.linalg.norm(corners[-1] + step * _way(heading)) > 0.22:
            heading += 0.7
        corners.append(corners[-1] + step * _way(heading))
    # a wavy way with no corner, on which joints turn round gently
    along, size = np.linspace(0.0, 1.0, 160)[1:, None], rng.uniform(0.008, 0.02)
    ahead, side = _way(heading + 1.5), _way(heading + 1.5 + np.pi / 2)
    wave = size * np.sin(2 * np.pi * rng.integers(1, 4) * along) * np.sin(np.pi * along)
    at = np.concatenate([corners, corners[-1] + 0.15 * along * ahead + wave * side])
    at = np.round(1e3 * (at + 0.1), 4)
    words = [f"GOTO/{x:.4f},{y:.4f},0" for x, y in at]
    text = [
        *("PARTNO/CONTOUR", "UNITS/MM", "LOADTL/1", "RAPID"),
        f"GOTO/{at[0][0]:.4f},{at[0][1]:.4f},50,0,0,1",
        f"FEDRAT/{6e4 * feed:.1f},MMPM",
        *(*words, "RAPID", f"GOTO/{at[-1][0]:.4f},{at[-1][1]:.4f},50", "FINI"),
    ]
    points = 1e-3 * np.column_stack([at, np.zeros(len(at))])
    return Job(
        robot, CAUSES[rng.integers(len(CAUSES))], points, "\n".join(text) + "\n", feed,
        rng.uniform(1.5, 3.0), str(rng.choice(["parabola", "arc"])), int(rng.integers(1 << 31)),
    )  # fmt: skip


def _way(heading: float) -> Array:
    return np.array([np.cos(heading), np.sin(heading)])


def run(seed: int, folder: Path) -> dict[str, Any]:
    """Run the loop of a case in a folder; return what was promised and what came of it."""
    job = draw(seed)
    folder.mkdir(parents=True, exist_ok=True)
    cell, source = folder / "cell.toml", folder / "contour.apt"
    cell.write_text(_cell(job), encoding="utf-8")
    source.write_text(job.text, encoding="utf-8")
    plain, _ = _program(folder / "plain", source, cell)
    first = driven(job, plain)
    rng = np.random.default_rng([seed, 32])
    recorder = Recorder(0.004, 10.0 ** rng.uniform(-4.3, -3.5), 1e-4, 0.0, 0.0, 2e-5)
    rows = [recorded(first, job.robot, recorder, rng, k + 1, False) for k in range(RUNS)]
    write_log(folder / "log.csv", np.concatenate(rows), False)
    told = asked(
        "diagnose", "--trace", folder / "log.csv", "--cell", cell, "--program", plain,
        "-o", folder / "gap",
    )  # fmt: skip
    better, answer = _program(folder / "better", source, cell, folder / "gap" / "model.toml")
    second = driven(job, better)
    off = [_off(job, motion) for motion in (first, second)]
    still = [_off(job, motion, True) for motion in (first, second)]
    levels = [float(np.sqrt(np.mean(e**2))) for e in off]
    return {
        "seed": seed,
        "hidden": first.truth,
        "named": told["adopted"],
        "promised": (answer.get("compensation") or {}).get("along_path"),
        "rms_mm": [1e3 * v for v in levels],
        "max_mm": [1e3 * float(e.max()) for e in off],
        "commanded_rms_mm": [1e3 * float(np.sqrt(np.mean(e**2))) for e in still],
        "left": levels[1] / levels[0],
        "seconds": [float(m.time[-1]) for m in (first, second)],
    }


def driven(job: Job, path: Path) -> Motion:
    """Return how the hidden robot drives the longest chain of path motions of a program."""
    commands = _commands(job, path)
    chain = max(_chains(commands), key=lambda c: c[1] - c[0])
    moves = commands[chain[0] : chain[1]]
    start = commands[chain[0] - 1].joints
    if start is None or any(c.pose is None or c.way is not None for c in moves):
        raise ValueError(f"{path.name}: not straight motions behind a joint motion")
    poses = [c.pose for c in moves if c.pose is not None]
    first, R = fk(job.robot.arm, job.robot.tool, start[None])
    turned = np.stack([R[0], *(p[:3, :3] for p in poses)])
    corners = np.vstack([first[0], *(p[:3, 3] + BASE for p in poses)])
    leg = np.r_[True, np.linalg.norm(np.diff(corners, axis=0), axis=1) > 1e-7]
    blend, speed = (np.array([0.0, *(getattr(c, n) for c in moves)]) for n in ("blend", "speed"))
    way = Way(corners[leg], blend[leg], job.form, speed[leg], job.acceleration)
    time, points = way.timed()
    turn = Slerp(np.arange(leg.sum()), Rotation.from_matrix(turned[leg]))(way.place).as_matrix()
    command = follow(job.robot.arm, job.robot.tool, start, turn, points)
    J = jacobian(job.robot.arm, job.robot.tool, command)
    motion = Motion(time, command, command.copy(), np.zeros((len(time), 3)), points, J)
    for name in job.causes:
        EFFECTS[name](motion, np.random.default_rng([job.state, list(EFFECTS).index(name)]))
    return motion


def _commands(job: Job, path: Path) -> tuple[Command, ...]:
    """Return the motions of a program and its sub-programs, which begin where the last one ends."""
    parts = sorted(p for p in path.parent.glob("*.src") if p.stem.startswith(f"{path.stem}_"))
    found: list[Command] = []
    for command in [c for p in [path, *parts] for c in read_krl(p)]:
        last = found[-1].pose if found else None
        if command.joints is not None and last is not None:
            at = fk(job.robot.arm, job.robot.tool, command.joints[None])[0][0]
            if np.linalg.norm(at - last[:3, 3] - BASE) < 1e-4:
                continue
        found.append(command)
    return tuple(found)


def _chains(commands: tuple[Command, ...]) -> list[tuple[int, int]]:
    found, begun = [], 0
    for k, command in enumerate(commands):
        if command.joints is not None:
            found.append((begun, k))
            begun = k + 1
    return [*found, (begun, len(commands))]


def _off(job: Job, motion: Motion, commanded: bool = False) -> Array:
    """Return how far (k,) [m] the tool passes places at equal steps of the contour."""
    arm, tool = job.robot.arm, job.robot.tool
    path = motion.point if commanded else fk(arm, tool, motion.actual)[0] + motion.shift
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(job.points, axis=0), axis=1))]
    even = np.arange(0.0, length[-1], STEP)
    wanted = np.stack([np.interp(even, length, p) for p in job.points.T], axis=1) + BASE
    # which rows are about which place, by the way of the command
    count = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(motion.point, axis=0), axis=1))]
    ends = [int(np.argmin(np.sum((motion.point - w) ** 2, axis=1))) for w in wanted[[0, -1]]]
    scale = (count[ends[1]] - count[ends[0]]) / even[-1]
    found = np.empty(len(even))
    for k, place in enumerate(even):
        low, high = np.searchsorted(count, count[ends[0]] + scale * place + np.array([-NEAR, NEAR]))
        a = path[low : high + 1]
        span = np.diff(a, axis=0)
        square = np.maximum(np.sum(span**2, axis=1), 1e-18)
        share = np.clip(np.sum((wanted[k] - a[:-1]) * span, axis=1) / square, 0.0, 1.0)
        near = a[:-1] + share[:, None] * span
        found[k] = np.sqrt(np.min(np.sum((wanted[k] - near) ** 2, axis=1)))
    return found


def _cell(job: Job) -> str:
    text = cell_text(job.robot, None)
    place = str([round(1e3 * v, 6) for v in BASE.tolist()])
    text = text.replace("[1200, 0, 300]", place)
    return text + f"\n[motion]\nfeed_mm_min = {6e4 * job.feed:.1f}\n"


def _program(
    out: Path, source: Path, cell: Path, model: Path | None = None
) -> tuple[Path, dict[str, Any]]:
    more = [] if model is None else ["--model", model]
    answer = asked("convert", source, "--cell", cell, "-o", out, *more)
    return min(out.glob("*.src"), key=lambda path: len(path.name)), answer


def asked(*words: Any) -> dict[str, Any]:  # noqa: ANN401 - words and paths
    """Return the JSON answer of a command."""
    command = [sys.executable, "-m", "postproc", *map(str, words), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode > 1 or not done.stdout.strip():
        raise RuntimeError(f"{' '.join(command[3:])}: {done.stdout[-800:]} {done.stderr[-800:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def main() -> None:
    """Run cases and print each, then how much was left."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    left = []
    for seed in range(options.seed, options.seed + options.cases):
        with tempfile.TemporaryDirectory() as folder:
            case = run(seed, Path(folder))
        print(json.dumps(case), flush=True)
        left.append(case["left"])
    print(f"left: median {np.median(left):.2f}, most {max(left):.2f}")


if __name__ == "__main__":
    main()
