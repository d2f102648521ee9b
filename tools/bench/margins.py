"""What the wish for margins does to the examples: a line of a table for each of ``fixtures``.

    python -m tools.bench margins [CASE ...]

Tags with a good margin, with a weight of margins as low as that of ``stiffest`` and with its own;
what stiffness and time change by; and the tags for which there is a good pose at all, whatever it
costs. Of those the search knows nothing: every 5 degrees of spin, arm configuration, turn, tilt and
place of the external axes is tried in a cell whose limits are larger by what a good margin is,
until one is free of collision with its whole stroke. No cut leads through such poses of necessity.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from postproc import convert, load_cell
from postproc.cell import Cell, Preset
from postproc.model import Plan, ToolPath
from postproc.planning import grade_counts
from postproc.planning.checks.working import NEAR, NEAR_BY
from postproc.planning.external.rating import position_grid
from postproc.planning.job import checker_of
from postproc.planning.states import sample, settle
from postproc.planning.states.costs import MARGIN_OF
from postproc.process import assign
from postproc.units import DEG
from tests.places import FIXTURES

SPINS = np.arange(0.0, 360.0, 5.0) * DEG


def commands() -> dict[str, list[str]]:
    """Return the words of the command that makes each example."""
    found = {}
    for path in sorted(FIXTURES.glob("*/commands.txt")):
        for line in path.read_text(encoding="utf-8").splitlines():
            words = shlex.split(line, comments=True)
            if words[:2] == ["postproc", "convert"]:
                found[path.parent.name] = words[2:]
    return found


def planned(case: str, cell: Cell) -> Plan:
    """Return the plan of an example."""
    words, folder = commands()[case], FIXTURES / case
    options = dict(zip(words[1::2], words[2::2], strict=True))
    model = folder / options["--model"] if "--model" in options else None
    return convert(folder / words[0], cell, model=model).plan


def possible(toolpath: ToolPath, cell: Cell) -> int:
    """Return how many tags have a pose with a good margin, each by itself."""
    kept = cell.limits
    limits = replace(
        kept,
        joint_margin=kept.joint_margin + NEAR,
        singularity=kept.singularity + NEAR,
        clearance=kept.clearance + NEAR_BY,
    )
    strict, settings = settle(replace(cell, limits=limits))
    assigned, count = assign(toolpath, strict), 0
    for stretch in assigned.stretches():
        part = assigned.toolpath.rows(np.arange(stretch.low, stretch.high))
        here = strict.with_tool(stretch.tool, stretch.base)
        left = np.arange(len(part))
        for external in position_grid(here) if here.external_axes else [None]:
            rows = None if external is None else np.tile(external, (len(part), 1))
            checker = checker_of(part, here, settings, rows)
            for spin in SPINS:
                left = left[~_has_pose(checker, left, spin)]
        count += len(part) - len(left)
    return count


def _has_pose(checker, tags: np.ndarray, spin: float) -> np.ndarray:  # noqa: ANN001
    """Return which tags (n,) have a pose that runs at a spin [rad]."""
    found, problem = np.zeros(len(tags), dtype=bool), checker.problem
    if not len(tags):
        return found
    states = sample(problem, tags, np.array([spin]), tilts=problem.tilts)
    every = np.arange(len(states.q))
    of, attitude = states.tag_of(every), states.attitude_of(every)
    q = states.q.astype(np.float64)
    good = checker.states(tags[of], q, attitude, states.branch.astype(np.int64)).good
    found[of[good]] = True
    return found


def line(case: str) -> str:
    """Return the line of an example."""
    cell = load_cell(FIXTURES / case / "cell.toml")
    with patch.dict(MARGIN_OF, dict.fromkeys(Preset, MARGIN_OF[Preset.STIFFEST])):
        low = planned(case, cell)
    own = planned(case, cell)
    before, after = (grade_counts(plan, cell)["good"] for plan in (low, own))
    stiff, time = _change(low, own)
    return (
        f"| `{case}` | {before} to {after} of {len(own.toolpath)} | "
        f"{possible(own.toolpath, cell)} | {stiff} | {time} |"
    )


def _change(low: Plan, own: Plan) -> Iterator[str]:
    """Yield by how much mean stiffness and time differ [%]."""
    means = [float(np.nanmean(plan.stiffness)) if _known(plan) else np.nan for plan in (low, own)]
    for before, after in (means, (low.cycle_time, own.cycle_time)):
        yield "-" if np.isnan(before) else f"{100.0 * (after / before - 1.0):+.1f} %"


def _known(plan: Plan) -> bool:
    return bool(np.isfinite(plan.stiffness).any())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", nargs="*", help="folders of fixtures; default: all")
    print("| example | tags with a good margin | can have one | stiffness | time |")
    print("| --- | --- | --: | --: | --: |")
    for case in parser.parse_args().case or commands():
        print(line(case), flush=True)


if __name__ == "__main__":
    main()
