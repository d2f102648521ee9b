"""Fuzz the readers: mutated files must give a toolpath or one PostprocError, and soon.

    python -m tools.dev.fuzz_readers [--count 100000] [--seed 1] [--keep DIR]

The files are those of the readers' tests. Every input that ends in another exception, in a toolpath
that breaks its own rules, or takes more than five seconds is kept in DIR, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import numpy as np

from postproc.errors import PostprocError
from postproc.model.toolpath import MotionKind, ToolPath
from postproc.readers import ReadOptions, read
from postproc.readers.apt.dialect import DIALECTS

FIXTURES = Path(__file__).resolve().parents[2] / "tests" / "readers" / "data"
SECONDS = 5
TOKENS = tuple(
    token.encode("latin-1")
    for token in (
        "GOTO/1,2,3\n", "CIRCLE/0,0,0,0,0,1,5\n", "RAPID\n", "FEDRAT/100,MMPM\n", "CYCLE/OFF\n",
        "CYCLE/DRILL,FEDTO,5,RAPTO,2,MMPM,100\n", "UNITS/INCH\n", "FINI\n", "END-OF-PATH\n",
        "NURBS/\nKNOT/1\nCNTRL/1,2,3\n", "TLAXIS/0,0,0\n", "MULTAX\n", "GODLTA/1\n", "TIMES,3",
        "MSYS/0,0,0,1,0,0,0,1,0\n", "$$*CATIA0\n", "$$ 1 0 0 0\n", "INDIRV/1,0,0\n", "$", "$$",
        "$\n", "\n", "\r\n", "\r", ",", ";", "\t", " ", "/", '"', "'", "<", ">", "&", "\0", "\xe9",
        "\xef\xbb\xbf", "nan", "inf", "-0", "1e308", "1e-400", "99999999999999999999", ".", "-",
        "+", "e", "x,y,z,i,j,k\n", "#", "<a/>", "<!DOCTYPE a>", "</Activity>", "&lol;",
    )
)  # fmt: skip
COLUMNS = (None, None, None, "x,y,z,i,j,k", "id,x,y,z,-,-,-", "x,y,z,a,b,c", "x,y,z,w,p,r,id")


def mutated(data: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """Return the data after one to four random changes."""
    for _ in range(rng.randint(1, 4)):
        change = rng.choice((_one_byte, _one_byte, _cut_out, _doubled, _with_token, _cut_off,
                             _lines_swapped, _spliced, _line_ends))  # fmt: skip
        data = change(data, others, rng)
    return data


def _one_byte(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    new = rng.randrange(256) if rng.random() < 0.5 else rng.choice(b"0123456789.-+eE, ")
    return data[:at] + bytes([new]) + data[at + 1 :]


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    at = rng.randrange(len(data) + 1)
    return at, min(len(data), at + rng.randint(1, rng.choice((2, 20, 400))))


def _cut_out(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    at, end = _span(data, rng)
    return data[:at] + data[end:]


def _doubled(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    at, end = _span(data, rng)
    return data[:end] + data[at:end] * rng.choice((1, 1, 3, 40)) + data[end:]


def _with_token(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(TOKENS) + data[at:]


def _cut_off(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _lines_swapped(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    if len(lines) > 1:
        i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def _spliced(data: bytes, others: list[bytes], rng: random.Random) -> bytes:
    other = rng.choice(others)
    at, cut = rng.randrange(len(data) + 1), rng.randrange(len(other) + 1)
    return data[:at] + other[cut : cut + rng.choice((30, 300, 5000))] + data[at:]


def _line_ends(data: bytes, _others: list[bytes], rng: random.Random) -> bytes:
    return data.swapcase() if rng.random() < 0.3 else data.replace(b"\n", b"\r\n")


def options_for(rng: random.Random) -> ReadOptions:
    """Return options at random, mostly the defaults."""
    if rng.random() < 0.5:
        return ReadOptions()
    return ReadOptions(
        units=rng.choice((None, None, "mm", "inch", "m")),
        dialect=rng.choice((None, None, *DIALECTS)),
        recover=rng.random() < 0.5,
        columns=rng.choice(COLUMNS),
        surface_normals=_up if rng.random() < 0.3 else None,
        task=rng.choice((None, None, "Cut", "Main")),
    )


def _up(points: np.ndarray) -> np.ndarray:
    return np.tile([0.0, 0.0, 1.0], (len(points), 1))


def broken_rule(toolpath: ToolPath) -> str:
    """Return which rule of a toolpath is broken, empty if none."""
    known = ~np.isnan(toolpath.points).any(axis=1)
    length = np.linalg.norm(toolpath.axes[known], axis=1)
    sweep = toolpath.arcs.sweep
    tables = (
        (toolpath.arc, toolpath.arcs),
        (toolpath.cycle, toolpath.cycles),
        (toolpath.tool, toolpath.tools),
        (toolpath.operation, toolpath.operations),
    )
    rules = {
        "a point is NaN": toolpath.format == "delmia" or known.all(),
        "a point is not finite": np.isfinite(toolpath.points[known]).all(),
        "an axis is not of length one": np.abs(length - 1.0).max(initial=0.0) < 1e-9,
        "a line below one": (toolpath.line >= 1).all(),
        "an arc without its record": (
            (toolpath.kind == MotionKind.ARC) == (toolpath.arc >= 0)).all(),
        "a hole without its cycle": (
            (toolpath.kind != MotionKind.HOLE) | (toolpath.cycle >= 0)).all(),
        "an arc without a sweep": (np.isfinite(sweep) & (sweep > 0.0)).all(),
        "an index beyond its table": all((c < len(table)).all() for c, table in tables),
    }  # fmt: skip
    return next((text for text, holds in rules.items() if not holds), "")


def _hang(_signal: int, _frame: object) -> None:
    raise TimeoutError


def main() -> int:
    """Run the fuzzer."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path("fuzz_failures"))
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    seeds = [(path.suffix, path.read_bytes()) for path in sorted(FIXTURES.iterdir())]
    texts = [data for _, data in seeds]
    codes: Counter[str] = Counter()
    failures = 0
    slowest = 0.0
    signal.signal(signal.SIGALRM, _hang)
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        for i in range(arguments.count):
            suffix, seed = seeds[i % len(seeds)]
            path = Path(folder) / f"input{suffix}"
            path.write_bytes(mutated(seed, texts, rng))
            options = options_for(rng)
            began = time.process_time()
            signal.alarm(SECONDS)
            try:
                problem = broken_rule(read(path, options=options))
                codes["read"] += 1
            except PostprocError as error:
                problem = "" if "\n" not in str(error) else "an error of two lines"
                codes[error.code] += 1
            except Exception:  # noqa: BLE001 - that is what is looked for
                problem = traceback.format_exc()
            finally:
                signal.alarm(0)
            slowest = max(slowest, time.process_time() - began)
            if problem:
                failures += 1
                arguments.keep.mkdir(parents=True, exist_ok=True)
                kept = arguments.keep / f"{arguments.seed}_{i}{suffix}"
                kept.write_bytes(path.read_bytes())
                print(f"{kept}: {options}\n{problem}", file=sys.stderr)
    spent = time.process_time() - start
    print(
        f"{arguments.count} inputs in {spent:.0f} s, slowest {slowest:.2f} s, {failures} failures"
    )
    print(", ".join(f"{code} {count}" for code, count in codes.most_common()))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
