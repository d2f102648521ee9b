"""Points that lines may pass, against closed forms and dense sampling by other means."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from postproc.planning.route.thin import LONGEST, ROLL, Course, keep
from postproc.units import DEG, MM


def course(points, turns=None, chord=0.01, axis=0.05, external=None, turning=(), tool_axis=None):
    """Return a course of points [mm] with rotation vectors [deg]."""
    n = len(points)
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, 3] = np.asarray(points) * MM
    if turns is not None:
        T[:, :3, :3] = Rotation.from_rotvec(np.asarray(turns), degrees=True).as_matrix()
    external = np.zeros((n, 0)) if external is None else np.asarray(external, dtype=float)
    turning = np.array(turning, dtype=bool)
    return Course(T, external, chord * MM, axis * DEG, turning, tool_axis)


def kept_of(course):
    return np.flatnonzero(keep(course, np.ones(len(course.T), dtype=bool)))


def free_form(seed, n=400):
    """Return a smooth path with corners here and there, the tool turning along it."""
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0.0, 0.02, (n, 3)), axis=0)
    heading += np.cumsum(rng.normal(0.0, 0.6, (n, 3)) * (rng.random((n, 1)) < 0.02), axis=0)
    way = np.cumsum(np.array([1.0, 0.0, 0.0]) + heading, axis=0) * rng.uniform(0.2, 2.0)
    turn = np.cumsum(np.cumsum(rng.normal(0.0, 0.004, (n, 3)), axis=0), axis=0)
    return course(way, turn)


def farthest(course, first, last, samples=4001):
    """Return by how much a line passes the points between, found by dense sampling.

    Distance [mm], turn of the tool [deg], and that of its axis [deg].
    """
    p, R = course.T[:, :3, 3] / MM, Rotation.from_matrix(course.T[:, :3, :3])
    share = np.linspace(0.0, 1.0, samples)
    line = p[first] + share[:, None] * (p[last] - p[first])
    led = Slerp([0.0, 1.0], R[[first, last]])(share)
    chord = turn = axis = 0.0
    own = np.array([1.0, 0.0, 0.0]) if course.tool_axis is None else course.tool_axis
    for row in range(first + 1, last):
        apart = np.linalg.norm(line - p[row], axis=1)
        near = int(apart.argmin())
        chord = max(chord, float(apart[near]))
        turn = max(turn, np.degrees((led[near].inv() * R[row]).magnitude()))
        apart = np.linalg.norm(led[near].apply(own) - R[row].apply(own))
        axis = max(axis, np.degrees(2.0 * np.arcsin(0.5 * apart)))
    return chord, turn, axis


@pytest.mark.parametrize("chord", [0.002, 0.01, 0.1])
def test_a_circle_keeps_as_few_points_as_its_sagitta_allows(chord):
    radius, step = 80.0, 0.25 * DEG
    angle = np.arange(2000) * step
    points = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    count = np.arange(1, 400)
    middle = (count % 2) / 2.0 * step  # of an odd number no point lies in the middle
    rise = radius * (np.cos(middle) - np.cos(count * step / 2.0))
    most = int(count[rise <= chord].max())
    spans = np.diff(kept_of(course(points, chord=chord)))
    inner = np.append(np.cumsum(spans)[:-1] % LONGEST != 0, False)  # those are cut short
    assert set(spans[inner]) == {most}
    assert spans.max() == most


@pytest.mark.parametrize("limit", [0.01, 0.05, 0.3])
def test_a_turn_that_quickens_keeps_what_its_parabola_asks_for(limit):
    """Turned by ``a s^2`` along a line: the parabola is a/4 of its length squared off its chord."""
    s = np.arange(480.0)
    a = 2e-4
    points = np.stack([s, 0 * s, 0 * s], axis=1)
    spans = np.diff(kept_of(course(points, np.stack([0 * s, a * s**2, 0 * s], axis=1), axis=limit)))
    count = np.arange(1, 480)
    most = int(count[a * (count // 2) * ((count + 1) // 2) <= limit].max())
    assert set(spans[:-1]) == {most}


@pytest.mark.parametrize("seed", range(2))
def test_every_point_left_out_is_passed_within_the_tolerances(seed):
    path = free_form(seed)
    kept = kept_of(path)
    assert len(kept) < 0.9 * len(path.T)
    worst = np.array([farthest(path, a, b) for a, b in pairwise(kept)])
    assert worst[:, 0].max() <= 0.01 + 5e-5
    assert worst[:, 1].max() <= 0.05 + 1e-3
    _, _, chord, axis = path.off(kept[:-1], kept[1:])
    assert chord.max() / MM == pytest.approx(worst[:, 0].max(), abs=5e-5)
    assert axis.max() / DEG == pytest.approx(worst[:, 1].max(), abs=1e-3)


@pytest.mark.parametrize(
    ("limit", "roll"), [(0.01, ROLL / DEG), (0.3, ROLL / DEG), (3.0, ROLL / DEG)]
)
def test_a_turn_about_the_tool_axis_alone_is_held_to_the_roll(limit, roll):
    """The parabola of the turn is about the tool's own axis, which it does not move."""
    s, a = np.arange(480.0), 2e-4
    points, turns = np.stack([s, 0 * s, 0 * s], axis=1), np.stack([0 * s, a * s**2, 0 * s], axis=1)
    count = np.arange(1, 480)
    middle = a * (count // 2) * ((count + 1) // 2)
    for axis, most in ((np.array([0.0, 1.0, 0.0]), roll), (np.array([0.0, 0.0, 1.0]), limit)):
        spans = np.diff(kept_of(course(points, turns, axis=limit, tool_axis=axis)))
        assert set(spans[:-1]) == {int(count[middle <= most].max())}


@pytest.mark.parametrize("seed", [1])
def test_the_tool_axis_is_within_the_tolerance_where_the_tool_may_roll(seed):
    path = replace(free_form(seed), axis=0.005 * DEG)
    free = replace(path, tool_axis=np.array([0.6, 0.0, 0.8]))
    kept = kept_of(free)
    assert len(kept) < len(kept_of(path))
    worst = np.array([farthest(free, a, b) for a, b in pairwise(kept)])
    assert worst[:, 0].max() <= 0.01 + 5e-5
    assert worst[:, 1].max() <= ROLL / DEG + 1e-3
    assert worst[:, 2].max() <= 0.005 + 1e-3
    told = free.off(kept[:-1], kept[1:])[3].max() / DEG
    assert told == pytest.approx(worst[:, 2].max(), abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_hardly_more_points_are_kept_than_must_be(seed):
    """The fewest points, by trying every pair: shortest way from the first point to the last."""
    path = free_form(seed, 120)
    n = len(path.T)
    fewest = np.zeros(n)
    for last in range(1, n):
        first = np.arange(last)
        fine = path.passed(first, np.full(last, last))
        fewest[last] = 1 + fewest[first[fine]].min()
    assert len(kept_of(path)) - 1 <= 1.15 * fewest[-1]


def test_points_that_must_stay_stay():
    path = course(np.stack([np.arange(50.0), np.zeros(50), np.zeros(50)], axis=1))
    may_go = np.ones(50, dtype=bool)
    may_go[[7, 8, 30]] = False
    assert np.flatnonzero(keep(path, may_go)).tolist() == [0, 7, 8, 30, 49]


def test_a_way_back_on_itself_keeps_its_turning_point():
    x = np.concatenate([np.arange(0.0, 21.0), np.arange(19.0, 9.0, -1.0), np.arange(11.0, 31.0)])
    kept = kept_of(course(np.stack([x, 0 * x, 0 * x], axis=1)))
    assert {0, 20, 30, 50} <= set(kept.tolist())


def test_a_turn_on_the_spot_is_never_passed():
    turns = np.stack([np.zeros(9), np.linspace(0.0, 20.0, 9), np.zeros(9)], axis=1)
    assert kept_of(course(np.zeros((9, 3)), turns)).tolist() == list(range(9))


@pytest.mark.parametrize(("turning", "bend", "fewer"), [
    (False, 0.02, True), (False, 4.0, False), (True, 0.1, True), (True, 20.0, False),
])  # fmt: skip
def test_external_axes_move_in_step_within_the_tolerances(turning, bend, fewer):
    s = np.linspace(0.0, 1.0, 41)
    unit = DEG if turning else MM
    external = (100.0 * s + bend * s * (1.0 - s))[:, None] * unit  # off by bend/4 in the middle
    points = np.stack([100.0 * s, 0 * s, 0 * s], axis=1)
    kept = kept_of(course(points, external=external, turning=[turning]))
    assert (kept.tolist() == [0, 40]) == fewer
