"""Poses chosen anew where no free way leads from tag to tag, as often as that helps."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.collision.scene import Scene
from postproc.kinematics import build
from postproc.model import MotionKind, MoveKind
from postproc.planning import attempt, job, repairs
from postproc.planning.checks import Reason, failure
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.route import Gap
from postproc.planning.search.pose_search import PoseSearch, with_options
from postproc.planning.search.rungs import Parted, SearchOptions, beside, with_gaps
from postproc.planning.states.settings import (
    settle,
)
from postproc.readers import read
from postproc.units import DEG
from tests.planning.stages import solve

PARTED = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr240_r3330"
base = { xyz_mm = [0, 0, 2000], abc_deg = [0, 90, 0] }
[tool]
number = 1
frame = { xyz_mm = [370, 0, 431.667], abc_deg = [0, 0, 0] }
axis = "+x"
mass_kg = 5
meshes = [
  { box = { size_mm = [197, 197, 518] }, xyz_mm = [0, 0, 265] },
  { box = { size_mm = [247, 148, 148] }, xyz_mm = [148, 0, 432] },
  { cylinder = { radius_mm = 4, length_mm = 99 }, cutting = true, xyz_mm = [321, 0, 432],\
    abc_deg = [0, 90, 0] },
]
[workpiece]
number = 1
frame = { xyz_mm = [1766.772, -347.12, 1438.404], abc_deg = [-101.115402, 0, 90] }
meshes = [{ box = { size_mm = [948, 691, 8] }, xyz_mm = [0, 0, -4.05] }]
[[obstacles]]
name = "lintel"
box = { size_mm = [1973, 123, 123] }
xyz_mm = [2329, -263, 662]
abc_deg = [-90, -11.115402, 0]
[[obstacles]]
name = "stub"
box = { size_mm = [111, 111, 1061] }
xyz_mm = [382, -293, 1166]
abc_deg = [0, 90, 0]
[[obstacles]]
name = "sill"
box = { size_mm = [148, 148, 2960] }
xyz_mm = [1480, -1156, 647]
abc_deg = [0, 90, 0]
[stiffness]
joint_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
[optimize]
loss_bound_percent = 20
"""
"""An arm on a wall; the stub stands in the way of its shoulder, the holes lie on both sides."""


HOLES = [
    (218.531, 184.964),
    (327.796, 184.964),
    (437.061, 184.964),
    (-218.531, 308.273),
    (-109.265, 308.273),
]


@pytest.fixture
def parted(tmp_path):
    """A toolpath and its cell: the stiffest poses of the holes lie on both sides of the stub."""
    (tmp_path / "cell.toml").write_text(PARTED)
    rows = [f"H{n},{x},{y},0,0,0,1,12.33,300" for n, (x, y) in enumerate(HOLES)]
    (tmp_path / "holes.csv").write_text("\n".join(["id,x,y,z,i,j,k,depth,feed", *rows, ""]))
    return read(tmp_path / "holes.csv"), load_cell(tmp_path / "cell.toml")


@pytest.mark.slow
def test_a_solid_that_parts_the_reach_is_no_reason_to_refuse(parted):
    toolpath, cell = parted
    result = plan(toolpath, cell)
    assert not result.errors
    at = result.q[[int(np.flatnonzero(result.tag == tag)[0]) for tag in range(len(toolpath))]]
    assert np.ptp(at[:, 0]) < 60.0 * DEG
    joint = np.flatnonzero(result.kind == MoveKind.PTP)
    joint = joint[joint > 0]
    share = np.linspace(0.0, 1.0, 200)[:, None, None]
    ways = result.q[joint - 1] + share * (result.q[joint] - result.q[joint - 1])
    scene = Scene.build(cell, build(cell.robot))
    assert not scene.check(ways.reshape(-1, 6)).hit.any()


def routed_as(monkeypatch, make_gaps):
    """Let every route have such gaps; return the poses that were routed."""
    own, seen = job.route, []

    def routed(checker, chosen, **options):
        seen.append(chosen.q.copy())
        result = own(checker, chosen, **options)
        for a, b in make_gaps(len(seen), chosen):
            finding = failure(checker.problem, b, Reason.COLLISION, "no free way")
            result.findings.append(finding)
            result.gaps.append(Gap(finding, a, b))
        return result

    monkeypatch.setattr(attempt, "route", routed)
    monkeypatch.setattr(job, "route", routed)
    return seen


@pytest.fixture
def checker(make_cell, make_path):
    """The checks of tags that an arm without any solids reaches in many ways."""
    points = np.column_stack([np.full(6, 1.9), np.linspace(-0.6, 0.6, 6), np.full(6, 0.9)])
    path = make_path(points, [-1.0, 0.0, 0.0], MotionKind.HOLE)
    cell, settings = settle(make_cell())
    return checker_of(path, cell, settings)


@pytest.mark.parametrize("partial", [False, True])
def test_what_no_poses_link_is_refused_after_a_few_tries(checker, monkeypatch, partial):
    missing = lambda turn, chosen: [(2, 3)] if chosen.good[3] else []  # noqa: E731
    seen = routed_as(monkeypatch, missing)
    solved = solve(checker, partial=partial)
    routed = solved.routed
    assert 2 <= len(seen) <= 5
    assert solved.tried["poses on one side of a gap"] == len(seen) - 1 - partial
    stuck = solved.dropped if partial else routed.findings
    assert [finding.tag_index for finding in stuck if finding.is_error] == [3]
    assert f"tried: {len(seen) - 1 - partial})" in stuck[-1].hint
    assert not (partial and routed.gaps)


def test_the_poses_with_the_fewest_gaps_count(checker, monkeypatch):
    gaps = {1: [(0, 1), (2, 3)], 2: [(2, 3)], 3: [(0, 1), (2, 3), (4, 5)]}
    seen = routed_as(monkeypatch, lambda turn, chosen: gaps.get(turn, [(1, 2), (3, 4)]))
    solved = solve(checker)
    assert len(seen) > 2
    assert [finding.tag_index for finding in solved.routed.findings if finding.is_error] == [3]
    assert np.array_equal(solved.choice.chosen.q, seen[1])


def test_fewer_gaps_each_time_end_as_well(checker, monkeypatch):
    nowhere = Parted(np.full((1, 6), 99.0), np.full((1, 6), -99.0))
    monkeypatch.setattr(repairs, "with_gaps", lambda known, _: (*known, nowhere))
    few = lambda turn, chosen: [(0, 1)] * (30 - turn)  # noqa: E731
    seen = routed_as(monkeypatch, few)
    routed = solve(checker).routed
    assert len(seen) == repairs.MOST_PLANS
    assert len(routed.gaps) == 30 - len(seen)


def test_what_links_at_once_is_chosen_once(checker, monkeypatch):
    seen = routed_as(monkeypatch, lambda *_: [])
    solve(checker)
    assert len(seen) == 1


def test_no_step_leads_across_a_gap_where_another_can_be_run(checker):
    search = PoseSearch.of(checker, np.arange(6))
    q = search.states.q[search.found.path].astype(np.float64)
    gap = Parted.by(q[[2]], q[[3]])
    parted = with_gaps((), [gap])
    assert parted == (gap,)
    assert with_gaps(parted, [Parted(*gap[::-1])]) == parted
    search = with_options(search, SearchOptions(parted=parted))
    path = search.found.path
    again = search.states.q[path].astype(np.float64)
    sides = beside(gap, again)
    assert not (sides[:-1] & sides[1:, ::-1]).any()
    assert not search.ladder.tolls_on(path).any()


def test_gaps_of_both_kinds_are_known_in_any_order(checker):
    """One where the arm stands alike says nothing of A1 to A3."""
    at = np.radians([[0.0, -90.0, 90.0, 0.0, 45.0, 0.0]])
    alike = Parted.by(at, at + np.radians([0, 0, 0, 170, 0, 0]))
    apart = Parted.by(at, at + np.radians([60, 0, 0, 0, 0, 0]))
    parted = with_gaps((), [alike, apart])
    assert len(parted) == 2
    assert len(with_gaps(parted, [apart, alike])) == 2


def test_none_is_near_to_both_sides_of_a_gap():
    rng = np.random.default_rng(5)
    for far, axes in ((0.02, 6), (0.3, 6), (2.0, 3)):
        before, behind = rng.uniform(-2.0, 2.0, (2, 4, 6))
        behind[0] = before[0] + far * np.array([0.5, -1.0, 0.2, 0.9, -0.3, 0.1])
        gap = Parted.by(before, behind)
        assert [side.shape[1] for side in gap] == [axes, axes]
        share = rng.uniform(-0.5, 1.5, (500, 1))
        near = beside(gap, before[0] + share * (behind[0] - before[0]))
        assert not near.all(axis=1).any()
        assert near.any(axis=0).all()
        ends = np.stack([before[0], behind[0]])
        assert beside(gap, ends).tolist() == [[True, False], [False, True]]
        every = 1 if axes == 6 else 4
        assert beside(gap, before[:every])[:, 0].all()
        assert beside(gap, behind[:every])[:, 1].all()


@pytest.mark.parametrize(
    ("stuck", "named"),
    [
        ({0: 0}, [0, 1, 2, 3, 4, 5]),  # no way into the cut: all of it goes, and is named
        ({5: 3}, [5, 4, 3]),  # it cannot be left above its end: it ends sooner
        ({0: 0, 5: 5}, [0, 1, 2, 3, 4, 5]),
    ],
)
def test_what_goes_with_a_cut_is_named(make_cell, make_path, monkeypatch, stuck, named):
    """``stuck``: tags that are stuck as long as they, or a later one, are run."""
    points = np.column_stack([np.full(6, 1.9), np.linspace(-0.2, 0.2, 6), np.full(6, 0.9)])
    cell, settings = settle(make_cell())
    checker = checker_of(make_path(points, [-1.0, 0.0, 0.0], MotionKind.LINEAR), cell, settings)
    own = job.route

    def routed(checker, chosen, **options):
        result = own(checker, chosen, **options)
        for end, least in stuck.items():
            ran = [tag for tag in range(least, end + 1) if chosen.good[tag]]
            result.findings += [
                failure(checker.problem, tag, Reason.COLLISION, "no way") for tag in ran[-1:]
            ]
        return result

    monkeypatch.setattr(attempt, "route", routed)
    monkeypatch.setattr(job, "route", routed)
    solved = solve(checker, partial=True)
    told = [finding.tag_index for finding in solved.dropped]
    assert sorted(told) == sorted(named)
    assert np.flatnonzero(~solved.choice.chosen.good).tolist() == sorted(named)
    assert not any(one.is_error for one in solved.routed.findings)
    assert all(f"tag {tag}" in one.message for tag, one in zip(told, solved.dropped, strict=True))
