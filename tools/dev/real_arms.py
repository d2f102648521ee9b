"""How far a diagnosis carries on real arms: fitted on some postures, judged on others.

``python -m tools.dev.real_arms --data DIR`` reads ``DIR/ur5`` (tracker, one grid) and ``DIR/ur10``
(two series) and runs the public commands ``diagnose`` and ``predict``; a missing set is skipped.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

UR5_ROWS = (30, 63, 125, 250, 1000)
UR10_ROWS = 1500
UR10_CELL = """schema = "postproc.cell/1"
name = "ur10"
[robot]
urdf = "ur10.urdf"
tip = "flange"
[tool]
number = 1
name = "reflector"
frame = { xyz_mm = [0, 0, 50], abc_deg = [0, 0, 0] }
axis = "+z"
"""


def main(arguments: list[str] | None = None) -> int:
    """Print a line for each set of rows; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.dev.real_arms", description=__doc__)
    parser.add_argument("--data", required=True, type=Path, metavar="DIR")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", type=int, nargs="*", default=list(UR5_ROWS))
    options = parser.parse_args(arguments)
    for name, run in (("ur5", _ur5), ("ur10", _ur10)):
        if (options.data / name).is_dir():
            run(options.data / name, options.rows, options.seed)
        else:
            print(f"{name}: no data, skipped")
    return 0


def _ur5(data: Path, counts: list[int], seed: int) -> None:
    """Fit some rows of a grid, judge on the others; all rows are judged by halves."""
    head, *lines = (data / "grid.csv").read_text(encoding="utf-8").splitlines()
    order = np.random.default_rng(seed).permutation(len(lines))
    for count in counts:
        count = min(count, len(lines) - 100)
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            for name in ("ur5.urdf", "cell.toml"):
                shutil.copy(data / name, folder)
            for name, rows in (("fit", order[:count]), ("judge", order[count:])):
                text = "\n".join([head, *(lines[k] for k in rows)]) + "\n"
                (folder / f"{name}.csv").write_text(text, encoding="utf-8")
            _judge(f"ur5, {count} rows", folder)


def _ur10(data: Path, counts: list[int], seed: int) -> None:
    """Fit some rows of one series, judge on the other."""
    del counts
    series = ("series_A_grid", "series_C_random")
    for fitted, judged in (series, series[::-1]):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            shutil.copy(data / "ur10.urdf", folder)
            (folder / "cell.toml").write_text(UR10_CELL, encoding="utf-8")
            for name, source in (("fit", fitted), ("judge", judged)):
                head, *lines = (data / f"{source}.csv").read_text(encoding="utf-8").splitlines()
                rows = np.sort(np.random.default_rng(seed).permutation(len(lines))[:UR10_ROWS])
                text = "\n".join([head, *(lines[k] for k in rows)]) + "\n"
                (folder / f"{name}.csv").write_text(text, encoding="utf-8")
            _judge(f"ur10, {fitted} -> {judged}", folder)


def _judge(title: str, folder: Path) -> None:
    cell = ["--cell", str(folder / "cell.toml"), "--register"]
    start = time.process_time_ns(), _children()
    call = ["diagnose", str(folder / "fit.csv"), *cell, "--json", "-o", str(folder / "out")]
    told = json.loads(_run(call))
    seconds = _children() - start[1]
    left = []
    for model in ([], ["--model", str(folder / "out" / "model.toml")]):
        call = ["predict", str(folder / "judge.csv"), *cell, *model, "--json"]
        left.append(json.loads(_run([*call, "-o", str(folder / "p.csv")]))["rms_mm"])
    print(
        f"{title}: {left[0]:.3f} -> {left[1]:.4f} mm, {told['verdict']},"
        f" {', '.join(told['adopted'])}, promised {told['shrinkage']['value']:.2f}"
        f" got {1.0 - left[1] / left[0]:.2f}, {seconds:.1f} CPU s",
        flush=True,
    )


def _children() -> float:
    import resource

    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _run(arguments: list[str]) -> str:
    command = [sys.executable, "-m", "postproc", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    sys.exit(main())
