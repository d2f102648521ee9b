"""Steps that are looked at along with one that fails cannot be run."""

import numpy as np

from postproc.cell import parse_cell
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import judge
from postproc.planning.search.failing import also_failing
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states import settle
from postproc.readers import read
from tools.bench.contours import contour, milling_cell


def test_steps_are_looked_at_once_and_what_the_joints_refute_cannot_be_run():
    """A fan that comes back with the same steps, all known to fail, gets the search nowhere."""
    toolpath = contour("convex", 8, 60.0)
    cell, settings = settle(milling_cell(fixture=True, origin=(2150, 550, 750)))
    checker = checker_of(toolpath, cell, settings)
    search = PoseSearch.of(checker, np.arange(8))
    search.ladder.solve()
    rung = 4
    states = np.arange(*search.states.offsets[[rung - 1, rung]])
    now = np.arange(*search.states.offsets[[rung, rung + 1]])
    told: set[tuple[int, int]] = set()
    refuted: set[tuple[int, int]] = set()

    def failing_of(steps):
        assert told.isdisjoint(steps)
        told.update(steps)
        return []

    for n in range(12):
        known = also_failing(search, [(int(states[n]), int(now[n]))], failing_of)
        assert refuted.isdisjoint(known)
        assert told.isdisjoint(known)
        refuted |= set(known)
    ends = np.array(sorted(refuted))
    spans = search.spans(ends[:, 0], ends[:, 1])
    assert len(ends) > 100
    assert not judge(checker, Interpolation.of(checker.problem), spans).good(len(spans)).any()


def test_the_cheapest_steps_are_those_of_a_plain_search():
    toolpath = contour("convex", 6, 60.0)
    cell, settings = settle(milling_cell(fixture=True, origin=(2150, 550, 750)))
    search = PoseSearch.of(checker_of(toolpath, cell, settings), np.arange(6))
    ladder, rung = search.ladder, 3
    ladder.solve()
    ladder.forbid([tuple(ladder.cheapest(rung, 1)[0].tolist())])
    first, low, high = ladder.offsets[rung - 1 : rung + 2].tolist()
    before, now = np.arange(first, low), np.arange(low, high)
    gap = np.abs(ladder.position[now][:, None] - ladder.position[before][None])
    price = ladder.weight[rung] * (gap.astype(float) ** 2).sum(axis=2)
    price = price + ladder.value[before] + ladder.cost[now][:, None]
    found = ladder.cheapest(rung, 200)
    told = price[found[:, 1] - low, found[:, 0] - first]
    assert (np.diff(told) > -1e-9).all()
    may = ladder.steps(rung, ladder.value, before, now, ladder.joined(rung)) < np.inf
    may &= (gap <= np.pi).all(axis=2) & (ladder.cost[now] < np.inf)[:, None]
    assert may[found[:, 1] - low, found[:, 0] - first].all()
    want = np.sort(price[may])[:200]
    assert len(found) == 200
    assert np.allclose(told, want, rtol=1e-6, atol=1e-9)


TILTED = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = { xyz_mm = [31, 0, 289], abc_deg = [0, 0, 90] }
axis = "+y"
[workpiece]
frame = { xyz_mm = [1850, 350, 980], abc_deg = [68, 0, 0] }
[optimize]
side_tilt_deg = [-5, 5]
lead_deg = [-5, 5]
"""
CORNERS = """\
UNITS/MM
MULTAX/ON
FEDRAT/400,MMPM
RAPID
GOTO/-167.495,-167.495,31.405,0,0,1
GOTO/-167.495,-167.495,-2,0,0,1
GOTO/-125.621,-167.495,-2
GOTO/-125.621,-125.621,-2
CIRCLE/-83.747,-125.621,-2,0,0,-1,41.874
GOTO/-83.747,-83.747,-2
CIRCLE/-83.747,-41.874,-2,0,0,1,41.874
GOTO/-83.747,0.000,-2
GOTO/-125.621,0.000,-2
FINI
"""


def test_tilted_cuts_round_sharp_corners_take_a_few_rounds(tmp_path):
    """At a corner the lead of one side is the side tilt of the next: most steps lean too far."""
    source = tmp_path / "corners.apt"
    source.write_text(CORNERS)
    found = plan(read(str(source)), parse_cell(TILTED.encode(), "cell.toml"))
    assert not found.errors
    assert found.settings["rounds"] <= 20
