"""Measure the batch: rate on one core and two, a re-run, kills and resumes, a million holes.

    python -m tools.bench batch rate   [--inputs 1000]
    python -m tools.bench batch kills  [--kills 20] [--inputs 60]
    python -m tools.bench batch cloud  [--holes 1000000] [--jobs 2]

All inputs are made here: holes of a flat panel in front of a KR 500 with an angle head, which
collides with nothing but itself: no solids of tool, part or fixture. Memory is the largest sum of
the memory of the batch and its workers (shared pages in parts), read from /proc twice a second. On
a machine that others use too, compare CPU times rather than wall times.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.cells import FEED, cell_text
from tools.bench.harness import spent

CELL = cell_text(FEED)
HEADER = "x,y,z,i,j,k,depth\n"
REGION_MM = 60
PITCH_MM = 1.2


def main() -> None:
    """Run one measurement."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(required=True)
    rate = commands.add_parser("rate", help="small inputs on one core and on two; re-runs")
    rate.add_argument("--inputs", type=int, default=1000)
    rate.set_defaults(run=measure_rate)
    kills = commands.add_parser("kills", help="kill at random moments, then resume")
    kills.add_argument("--inputs", type=int, default=60)
    kills.add_argument("--kills", type=int, default=20)
    kills.set_defaults(run=measure_kills)
    cloud = commands.add_parser("cloud", help="one large CSV, then one hole more")
    cloud.add_argument("--holes", type=int, default=1_000_000)
    cloud.add_argument("--jobs", type=int, default=2)
    cloud.set_defaults(run=measure_cloud)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cell.toml").write_text(CELL, encoding="ascii")
        arguments.run(folder, arguments)


def row(x: float, y: float) -> str:
    """Return a line of the CSV."""
    return f"{x:.3f},{y:.3f},0,0,0,1,5\n"


def small_inputs(folder: Path, count: int) -> None:
    """Write inputs of four holes each."""
    parts = folder / "parts"
    parts.mkdir()
    for number in range(count):
        rows = "".join(row(20.0 * i, 0.3 * number) for i in range(4))
        (parts / f"p{number:04d}.csv").write_text(HEADER + rows, encoding="ascii")


def command(source: str, output: str, *more: str) -> list[str]:
    """Return the call of a batch."""
    call = [sys.executable, "-m", "postproc", "batch", source, "-o", output, "--json", "-q"]
    return [*call, "--cell", "cell.toml", *more]


def timed(folder: Path, *call: str) -> dict[str, float]:
    """Run a batch; return seconds of wall and CPU (with its workers), and what it did."""
    with spent() as used:
        done = subprocess.run(
            command(*call), cwd=folder, stdout=subprocess.PIPE, text=True, check=True
        )
    document = json.loads(done.stdout)
    return {"wall": used.wall, "cpu": used.cpu, "done": document["done"], "kept": document["kept"]}


def measure_rate(folder: Path, arguments: argparse.Namespace) -> None:
    """One core against two, then re-runs."""
    small_inputs(folder, arguments.inputs)
    runs = {jobs: timed(folder, "parts", f"out{jobs}", "--jobs", str(jobs)) for jobs in (1, 2)}
    for jobs, run in runs.items():
        busy = run["cpu"] / run["wall"]
        print(
            f"{jobs} workers: {run['wall']:.1f} s wall, {run['cpu']:.1f} s CPU, {busy:.2f} cores "
            f"busy, {arguments.inputs / run['wall']:.1f} inputs per s"
        )
    print(f"rate ratio by wall time: {runs[1]['wall'] / runs[2]['wall']:.2f}")
    print(f"CPU per input, two workers against one: {runs[2]['cpu'] / runs[1]['cpu']:.3f}")
    print("same bytes:", contents(folder / "out1") == contents(folder / "out2"))
    again = timed(folder, "parts", "out2", "--jobs", "2")
    print(f"nothing changed: {again['wall']:.2f} s wall, {again['cpu']:.2f} s CPU, {again}")
    changed = folder / "parts" / f"p{arguments.inputs // 2:04d}.csv"
    changed.write_text(HEADER + row(7.0, 7.0), encoding="ascii")
    again = timed(folder, "parts", "out2", "--jobs", "2")
    print(f"one changed: {again['wall']:.2f} s wall, {again}")


def contents(folder: Path) -> dict[str, str]:
    """Return a hash of every file below a folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def measure_kills(folder: Path, arguments: argparse.Namespace) -> None:
    """Each time anew: kill at a random moment, resume, compare."""
    small_inputs(folder, arguments.inputs)
    whole = timed(folder, "parts", "whole", "--jobs", "2")["wall"]
    wanted = contents(folder / "whole")
    moments = random.Random(20)
    equal = killed = tries = 0
    while killed < arguments.kills:
        tries += 1
        output = f"cut{tries}"
        running = subprocess.Popen(
            command("parts", output, "--jobs", "2"),
            cwd=folder,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        moment = moments.uniform(0.1, whole)
        try:
            running.wait(timeout=moment)
        except subprocess.TimeoutExpired:
            os.killpg(running.pid, signal.SIGKILL)
            running.wait()
        else:
            whole = min(whole, moment)  # it was done already: that counts as no kill
            continue
        killed += 1
        run = timed(folder, "parts", output, "--jobs", "2")
        same = contents(folder / output) == wanted
        equal += same
        print(f"{moment:.2f} s: {run['kept']} kept, {run['done']} redone, same: {same}", flush=True)
    print(f"{equal} of {killed} equal")


def cloud_rows(holes: int) -> list[str]:
    """Return the rows of a square panel, back and forth."""
    side = round(holes**0.5)
    rows = []
    for line in range(side):
        columns = range(side) if line % 2 == 0 else range(side - 1, -1, -1)
        y = (line - side / 2) * PITCH_MM
        rows += [row((column - side / 2) * PITCH_MM, y) for column in columns]
    return rows


def measure_cloud(folder: Path, arguments: argparse.Namespace) -> None:
    """One large CSV by region; then one hole more in the middle."""
    rows = cloud_rows(arguments.holes)
    cloud = folder / "cloud.csv"
    cloud.write_text(HEADER + "".join(rows), encoding="ascii")
    split = ("--split", f"region:{REGION_MM}", "--jobs", str(arguments.jobs))
    first = watched(folder, command("cloud.csv", "out", *split))
    before = contents(folder / "out")
    size = sum(path.stat().st_size for path in (folder / "out").iterdir())
    print(f"{len(rows)} holes: {first}, {len(before)} files, {size / 1e6:.0f} MB")
    rows.insert(len(rows) // 2, row(0.5 * PITCH_MM, 0.5 * PITCH_MM))
    cloud.write_text(HEADER + "".join(rows), encoding="ascii")
    second = watched(folder, command("cloud.csv", "out", *split))
    after = contents(folder / "out")
    changed = sorted(n for n in before | after if before.get(n) != after.get(n))
    print(f"one hole more: {second}, changed: {', '.join(changed)}")


def watched(folder: Path, call: list[str]) -> str:
    """Run a batch and watch its memory; return time, CPU, memory and what it did."""
    largest = main_largest = 0
    with (folder / "stdout").open("wb") as stream, spent() as used:
        running = subprocess.Popen(call, cwd=folder, stdout=stream)
        while running.poll() is None:
            own = unique_memory(running.pid)
            largest = max(largest, own + sum(map(unique_memory, children(running.pid))))
            main_largest = max(main_largest, own)
            time.sleep(0.5)
    document = json.loads((folder / "stdout").read_bytes())
    failed = document["failed"][:3]
    return (
        f"exit {running.returncode}, {used.wall:.0f} s wall, {used.cpu:.0f} s CPU, "
        f"{largest / 2**30:.2f} GiB in all, {main_largest / 2**30:.2f} GiB without workers, "
        f"{document['done']} done, {document['kept']} kept, failed {failed}"
    )


def children(pid: int) -> list[int]:
    """Return all processes below one."""
    try:
        texts = [p.read_text() for p in Path(f"/proc/{pid}/task").glob("*/children")]
    except OSError:
        return []
    found = [int(word) for text in texts for word in text.split()]
    return [*found, *(below for child in found for below in children(child))]


def unique_memory(pid: int) -> int:
    """Return the proportional set size of a process in bytes, 0 when it has ended."""
    try:
        text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    except OSError:
        return 0
    return 1024 * sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
