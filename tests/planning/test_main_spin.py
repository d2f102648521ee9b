"""A roll of the tool inside a cut has to pay: against a half turn for nothing, and by force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import parse_cell
from postproc.geometry import twist_about
from postproc.model import MotionKind
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.search.constants import ROLL_PRICE, STEADY_BAND
from postproc.planning.search.keytags import dense_key_tags
from postproc.planning.search.pose_search import PoseSearch, with_options
from postproc.planning.search.roll import main_spins
from postproc.planning.search.rungs import SearchOptions, shares
from postproc.planning.states import settle
from postproc.units import DEG, MM
from tools.bench.contours import contour, random_case
from tools.bench.paths import bare_path

DOME_CELL = """\
schema = "postproc.cell/1"
name = "dome"
[robot]
model = "kuka_kr240_r3330"
[tool]
number = 1
name = "spindle"
frame = { xyz_mm = [250, 0, 330], abc_deg = [0, 0, 0] }
axis = "+x"
mass_kg = 90
[workpiece]
number = 5
frame = { xyz_mm = [2200, 300, 925], abc_deg = [30, 0, 0] }
[stiffness]
joint_Nmm_per_rad = [1.0e10, 5e9, 4e9, 3e8, 2e8, 2.5e8]
[motion]
home_deg = [0, -90, 90, 0, 45, 0]
feed_mm_min = 300
"""


def dome(count=1500, passes=5, length=50000.0):
    """Return passes of a wavy spiral on a shallow dome, the tool lifted off between them."""
    radius, pitch = 120.0, 0.5 / np.pi
    way = np.linspace(0.0, length, count)
    angle = (np.sqrt(radius**2 + 2.0 * pitch * way) - radius) / pitch
    r = radius + pitch * angle
    x, y, height = r * np.cos(angle), r * np.sin(angle), np.sqrt(900.0**2 - r**2)
    points = np.column_stack([x, y, height - 900.0 + 3.0 * np.sin(3.0 * angle)])
    axes = np.column_stack([x + 60.0 * np.sin(2.0 * angle), y, height + 3.0 * np.sin(3.0 * angle)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    parts, kinds = [], []
    for rows in np.array_split(np.arange(count), passes):
        parts += [rows[:1], rows, rows[-1:]]
        kinds += [[MotionKind.RAPID], np.full(len(rows), MotionKind.LINEAR), [MotionKind.RAPID]]
    rows, kind = np.concatenate(parts), np.concatenate(kinds)
    points = points[rows] + np.outer(kind == MotionKind.RAPID, [0.0, 0.0, 40.0])
    return bare_path("dome", points * MM, axes[rows], feed=0.025, kind=kind)


@pytest.mark.slow
def test_no_pass_turns_the_tool_over_for_what_rounding_of_the_grid_gives():
    cell, toolpath = parse_cell(DOME_CELL.encode(), "cell.toml"), dome()
    made = plan(toolpath, cell)
    assert not made.errors
    R, axis = made.T_base_tcp[made.kind > 0][:, :3, :3], np.asarray(cell.tool.axis)
    roll = np.unwrap(twist_about(R[0].T @ R, axis))
    assert np.ptp(roll) < 90.0 * DEG
    # none lost in a roll; a rapid above the first or last cut may turn towards the home
    cut = made.stiffness[toolpath.kind != MotionKind.RAPID]
    assert cut.min() > 0.95 * cut.mean()


def searched(seed):
    """Return a long contour's search, before its rolls have to pay."""
    path = contour(("convex", "wavy", "s")[seed % 3], 2500, 2.0, 5.0 + seed % 7 * 5.0)
    cell, settings = settle(random_case(seed)[1])
    checker = checker_of(path, replace(cell, obstacles=()), settings)
    search = PoseSearch.of(checker, np.flatnonzero(dense_key_tags(checker.problem)))
    return search


def rolled(search, path, main):
    """Return which key tags (n,) stand off their main spin."""
    off = np.mod(search.states.spin_of(path) - main[search.tags] + np.pi, 2.0 * np.pi) - np.pi
    return np.abs(off) > STEADY_BAND + 1e-9


@pytest.mark.parametrize("seed", [751003, 751011])
def test_what_rolls_off_the_main_spin_gains_its_price(seed):
    """Against the cheapest way that does not roll at all, on the same grid of spins."""
    search = searched(seed)
    main = main_spins(search)
    assert main is not None
    search = with_options(search, SearchOptions(main=main))
    assert main_spins(search) is None
    steady = PoseSearch.of(search.checker, search.tags)
    every = np.arange(len(steady.states.q))
    off = np.mod(
        steady.states.spin_of(every) - main[search.tags][steady.states.tag_of(every)], 2 * np.pi
    )
    steady.ladder.cost[np.minimum(off, 2 * np.pi - off) > STEADY_BAND + 1e-9] = np.inf
    known = steady.found
    assert not steady.ladder.broken[1:].any()
    share = shares(search.between, search.tags)
    concerned = float(share[rolled(search, search.found.path, main)].sum())
    own = search.ladder.total(search.found.path) - ROLL_PRICE * concerned
    assert steady.ladder.total(known.path) - own >= ROLL_PRICE * concerned - 1e-6


def test_where_every_tag_is_to_stand_at_its_best_it_may_roll():
    search = searched(751003)
    search = replace(search, options=SearchOptions(each=True))
    assert main_spins(search) is None
