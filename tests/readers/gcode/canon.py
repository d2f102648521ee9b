"""What LinuxCNC's stand-alone interpreter ``rs274`` makes of a program, as strokes of the tool tip.

``python -m tests.readers.gcode.canon FILE...`` writes its answer beside each file (``FILE.canon``);
the recorded ones are of LinuxCNC 2.9.0. Neither shares a line with the reader.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

RS274 = shutil.which("rs274")
_CALL = re.compile(r"(?:N(\d+|\.+)\s+)?(\w+)\(([^()]*)\)")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?")


def run(path):
    """Return what rs274 prints."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "tool.tbl"
        table.write_text("".join(f"T{n} P{n} Z0 D6\n" for n in range(1, 30)))
        call = [RS274, "-g", "-t", str(table), "-v", str(Path(folder) / "rs274.var"), str(path)]
        done = subprocess.run(call, capture_output=True, text=True, timeout=60, input="")
    return done.stdout


def strokes(text):
    """Return the strokes of a canon listing: (block, kind, end [mm], feed [mm/min], arc).

    ``block``: its number N, that of the last one before where it has none; ``arc``: centre [mm],
    turns (below 0 clockwise) and the axes of its plane.
    """
    found, block, feed, plane, factor, at = [], "", float("nan"), "XY", 1.0, np.full(3, np.nan)
    for number, name, inside in _CALL.findall(text):
        block = number if number.isdigit() else block
        numbers = [float(x) for x in _NUMBER.findall(inside)]
        if name == "USE_LENGTH_UNITS":
            factor = 25.4 if "INCHES" in inside else 1.0
        elif name == "SELECT_PLANE":
            plane = inside[-2:]
        elif name == "SET_FEED_RATE":
            feed = numbers[0] * factor
        elif name in ("STRAIGHT_TRAVERSE", "STRAIGHT_FEED"):
            at = np.array(numbers[:3]) * factor
            rapid = name == "STRAIGHT_TRAVERSE"
            found.append((block, "rapid" if rapid else "line", at, np.nan if rapid else feed, None))
        elif name == "ARC_FEED":
            order = {"XY": [0, 1, 2], "YZ": [1, 2, 0], "XZ": [2, 0, 1]}[plane]
            end, centre = np.zeros(3), np.zeros(3)
            end[order] = np.array([*numbers[:2], numbers[5]]) * factor
            centre[order] = np.array([*numbers[2:4], at[order[2]] / factor]) * factor
            found.append((block, "arc", end, feed, (centre, int(numbers[4]), order)))
            at = end
    return found


if __name__ == "__main__":
    for name in sys.argv[1:]:
        Path(name + ".canon").write_text(run(name))
