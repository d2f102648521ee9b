"""Runs random files through ``convert``, and what was written through ``verify`` by itself."""

from __future__ import annotations

import random
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from postproc.cell import call_keys, load_cell
from postproc.errors import PostprocError
from postproc.jobs.convert import ConvertRequest, convert
from postproc.jobs.verify import verify
from tools.fuzz.files import Writer

OWN_FAULTS = ("CNV002", "EMT", "KRL")
"""How the codes of findings begin that blame postproc, not the input."""
_VERIFY_EVERY = 7
_CELL = """\
schema = "postproc.cell/1"
name = "fuzz"
[robot]
model = "kuka_kr500_r2830"
{tools}
[workpiece]
frame = {{ xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }}
{external}
[optimize]
step_deg = 45
refine = false
{optimize}
[motion]
{motion}
[process]
{process}
[krl]
{krl}
{hooks}
"""
_HEAD = """\
[tool]
frame = { xyz_mm = [150, 0, 300], abc_deg = [0, 0, 0] }
axis = "+x"
"""
_TWO = """\
[[tools]]
number = 3
name = "cutter"
cam = ["1", "T1"]
frame = { xyz_mm = [150, 0, 300], abc_deg = [0, 0, 0] }
axis = "+x"
mass_kg = 80.0
[[tools]]
number = 7
name = "drill"
cam = ["2", "T2"]
frame = { xyz_mm = [190, 0, 310], abc_deg = [0, 0, 0] }
axis = "+x"
mass_kg = 82.0
"""
_RAIL = """\
[[external_axes]]
name = "E1"
kind = "rail"
axis = "+y"
range_mm = [-1500, 1500]
speed_mm_s = 1000
"""
_TABLE = """\
[[external_axes]]
name = "E1"
kind = "positioner"
axis = "+z"
xyz_mm = [1700, 0, 500]
range_deg = [-180, 180]
speed_deg_s = 30
"""
_TAPS = '[krl.hooks]\ntap_reverse = "TAP_BACK"\n'
_VARIANTS: tuple[dict[str, str], ...] = (
    {},
    {"hooks": _TAPS},
    {"krl": "hooks_example = true\nmax_points_per_file = 5", "hooks": _TAPS},
    {"krl": 'motion = "spline"', "hooks": _TAPS},
    {"krl": 'motion = "spline_block"\npoints = "dat"'},
    {"krl": 'motion = "forms"', "motion": "feed_mm_min = 600"},
    {"tools": f'{_HEAD}spindle = "ccw"', "hooks": _TAPS},
    {"tools": _TWO, "hooks": _TAPS},
    {"tools": _TWO, "motion": "home_deg = [0, -90, 90, 0, 30, 0]", "krl": "setup = true"},
    {"external": _RAIL, "hooks": _TAPS},
    {"external": _TABLE},
    {"process": 'feed_by = "unit"'},
    {"process": 'hole = ["clamp", "drill", "unclamp"]', "krl": "hooks_example = true"},
    {"motion": 'arcs = "lin"\nhome_deg = [0, -90, 90, 0, 30, 0]\napproximation_mm = 5'},
    {"optimize": "lead_deg = [-10, 10]\ntilt_step_deg = 10"},
    {"optimize": "free_order = true", "krl": 'split = "operations"', "hooks": _TAPS},
)


@dataclass
class Outcome:
    """What became of many files: counts by what stopped them, and the faults of our own."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[tuple[int, str]] = field(default_factory=list)
    slowest: float = 0.0

    @property
    def good(self) -> int:
        """Files that became programs."""
        return self.counts["good"]


def run(count: int, seed: int, folder: Path, keep: Path | None = None) -> Outcome:
    """Run ``count`` files.

    Args:
        count: of files.
        seed: of the first one; the next has the next number.
        folder: for cells, files and programs.
        keep: takes the files that end in a fault of our own; None: none is kept.
    """
    cells = _cells(folder)
    outcome = Outcome()
    for number in range(seed, seed + count):
        rng = random.Random(number)
        writer = Writer(rng)
        source = folder / "part.apt"
        source.write_text(writer.text())
        dialect = writer.seat if rng.random() < 0.7 else None
        began = time.process_time()
        fault = one(source, rng.choice(cells), dialect, number, outcome)
        outcome.slowest = max(outcome.slowest, time.process_time() - began)
        if fault:
            outcome.faults.append((number, fault))
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{number}_{writer.seat}.apt").write_text(source.read_text())
    return outcome


def one(source: Path, cell: Path, dialect: str | None, number: int, outcome: Outcome) -> str:
    """Run one file and return what is our own fault in it, empty if nothing is."""
    words = "CYCLE/DEEP,CYCLE/DRILL" if number % 3 else ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            request = ConvertRequest(
                str(source), str(cell), keys=call_keys({"dialect": dialect, "accept_words": words})
            )
            made = convert(request)
            errors = [finding for finding in made.findings if finding.is_error]
            outcome.counts[errors[0].code if errors else "good"] += 1
            own = [str(finding) for finding in errors if finding.code.startswith(OWN_FAULTS)]
            if own or errors or number % _VERIFY_EVERY:
                return "; ".join(own)
            for name, content in made.files.items():
                (source.parent / name).write_bytes(content)
            report = verify(source.parent / f"{made.name}.src", load_cell(cell))
            return "; ".join(f"verify alone: {finding}" for finding in report.violations)
    except PostprocError as error:
        outcome.counts[error.code] += 1
        return f"own fault: {error}" if error.code.startswith(OWN_FAULTS) else ""
    except Exception:  # noqa: BLE001 - that is what is looked for
        outcome.counts["traceback"] += 1
        return traceback.format_exc()


def _cells(folder: Path) -> list[Path]:
    empty = dict.fromkeys(("external", "optimize", "motion", "process", "krl", "hooks"), "")
    empty["tools"] = _HEAD
    paths = []
    for number, variant in enumerate(_VARIANTS):
        path = folder / f"cell_{number}.toml"
        path.write_text(_CELL.format(**{**empty, **variant}))
        paths.append(path)
    return paths
