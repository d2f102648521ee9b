"""Cuts that are left in the middle and entered again further on: how is what is told.

The tool goes up from one point of a cut, some of the points behind it are left out, and it comes
back to a later one by a joint motion, in rapid, or as it should: from above, with the feed.
"""

import random
import re
from pathlib import Path

from postproc.api import load_cell, read
from postproc.krl import parse_files
from postproc.verification import verify

TRIM = Path(__file__).parents[2] / "fixtures" / "trim_5axis"
POINT = re.compile(r"\{X (\S+),Y (\S+),Z (\S+),(A \S+,B \S+,C \S+)\}")
UP, FEED = 60.0, "$VEL.CP=0.020000"


def entered(lines, rng, how):
    """Return the program with some points of its cut left out, entered behind them in some way."""
    cuts = [k for k, line in enumerate(lines) if line.startswith("LIN") and ",Z -5." in line][2:-1]
    backs = [k for k in cuts[1:] if how != "above" or "B 90." in lines[k]]  # upright: straight down
    back = rng.choice(backs)
    leave = rng.choice([k for k in cuts if k < back and "B 90." in lines[k]])
    (x, y, _, turn), (u, v, w, other) = (POINT.search(lines[k]).groups() for k in (leave, back))
    height = {"low": rng.uniform(-4.9, 0.0), "above": UP}.get(how, float(w))
    way = [
        lines[leave].replace(" C_DIS", ""),
        "$VEL.CP=1.000000",
        f"LIN {{X {x},Y {y},Z {UP},{turn}}}",
        f"LIN {{X {u},Y {v},Z {UP},{other}}}",
    ]
    word = "LIN" if how == "rapid" else "PTP"
    way.append(f"{word} {{X {u},Y {v},Z {height:.4f},{other}}}")
    if how in ("low", "above"):
        way += [FEED, f"LIN {{X {u},Y {v},Z {w},{other}}}"]
    return [*lines[:leave], *way, FEED, *lines[back + 1 :]]


def test_how_a_cut_is_entered_again():
    rng, found = random.Random(8), {}
    cell = load_cell(TRIM / "cell.toml")
    asked = read(TRIM / "trim.cls", cell)
    files = {path.name: path.read_bytes() for path in sorted((TRIM / "expected").iterdir())}
    lines = files["trim.src"].decode("ascii").split("\r\n")
    ways = [(how, asked) for how in ("joint", "rapid", "low", "above")]
    for how, against in (*ways, ("joint", None), ("above", None)):
        told = set()
        for _ in range(5):
            text = "\r\n".join(entered(lines, rng, how)).encode("ascii")
            modules = parse_files({**files, "trim.src": text})
            report = verify(modules, "trim", cell, against, collisions=False)
            told.add(bool({"entry", "path"} & {item.code for item in report.violations}))
        found[how, against is not None] = told
    assert found == {
        ("joint", True): {True},
        ("joint", False): {True},
        ("rapid", True): {True},
        ("low", True): {True},
        ("above", True): {False},
        ("above", False): {False},
    }
