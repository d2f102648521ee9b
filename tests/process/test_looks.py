"""What is seen in a cloud, at clouds that are made for it; brute force where there is one."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from postproc.model import Cycle, CycleKind, MotionKind, ToolPath
from postproc.process import from_below, looks
from tests.samples import cell_in

NAMES = {
    "PTS001": "double",
    "PTS002": "turned",
    "PTS003": "small",
    "PTS004": "flat",
    "PTS005": "short",
    "PTS006": "below",
}


def cloud(points, axes=None, kind=MotionKind.HOLE, depth=0.01, **more):
    points = np.asarray(points, dtype=float)
    n = len(points)
    axes = np.tile([0.0, 0.0, 1.0], (n, 1)) if axes is None else np.asarray(axes, dtype=float)
    whole = np.full(n, -1, dtype=np.int32)
    columns = {
        "kind": np.full(n, kind, dtype=np.int32), "feed": np.full(n, np.nan),
        "line": np.arange(2, n + 2, dtype=np.int32), "operation": whole, "tool": whole,
        "arc": whole, "cycle": np.zeros(n, dtype=np.int32) if kind == MotionKind.HOLE else whole,
    }  # fmt: skip
    cycles = (Cycle(CycleKind.DRILL, depth, 0.002, 0.01),)
    columns |= {"cycles": cycles, "format": "csv"} | more
    return ToolPath(
        path="c.csv", name="c", dialect="csv", units="mm", points=points, axes=axes, **columns
    )


def seen(toolpath, outward=None):
    return {NAMES[finding.code]: finding for finding in looks(toolpath, outward)}


def grid(n=40, seed=0):
    """Return (n, 3) points of a curved panel and its normals."""
    draw = np.random.default_rng(seed)
    u = np.column_stack([np.arange(n) % 8 * 0.03, np.arange(n) // 8 * 0.03])
    u += draw.uniform(-0.005, 0.005, (n, 2))
    points = np.column_stack([u, -(u**2).sum(axis=1)])
    normals = np.column_stack([2 * u, np.ones(n)])
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


def test_one_normal_of_a_path_is_seen_wherever_it_stands():
    missed = []
    for n in (3, 5, 20):
        points = np.column_stack([np.arange(n) * 0.02, np.zeros(n), np.zeros(n)])
        for turned in (0, n // 2, n - 1):
            axes = np.tile([0.0, 0.0, 1.0], (n, 1))
            axes[turned] *= -1.0
            feed = {"feed": np.full(n, 0.01)}
            found = seen(cloud(points, axes, MotionKind.LINEAR, **feed)).get("turned")
            missed += [(n, turned)] * (found is None or found.tag_index != turned)
    assert not missed


def test_a_good_cloud_shows_nothing():
    assert not seen(cloud(*grid()))
    assert not seen(cloud(*grid(1)))
    back, normals = grid(20)
    both = cloud(np.vstack([back, back - [0, 0, 0.005]]), np.vstack([normals, -normals]))
    assert not seen(both)


@pytest.mark.parametrize("off", [0.0, 1e-6, 5e-5])
def test_one_place_twice_names_both_rows(off):
    points, normals = grid()
    points[31] = points[4] + [off, 0, 0]
    found = seen(cloud(points, normals))
    assert "line 33 at the place of line 6" in found["double"].message
    tools = np.zeros(40, dtype=np.int32)
    tools[31] = 1
    assert "double" not in seen(cloud(points, normals, tool=tools))


@pytest.mark.parametrize("turned", [[0], [17], [3, 30], [8, 9]])
def test_normals_turned_round_are_named(turned):
    points, normals = grid()
    truth = normals.copy()
    normals[turned] *= -1
    for outward in (None, truth):
        message = seen(cloud(points, normals), outward)["turned"].message
        assert [bool(re.search(rf"line {row + 2}\b", message)) for row in range(40)] == [
            r in turned for r in range(40)
        ]
    inward = seen(cloud(points, -truth), truth)["turned"].message
    assert inward.startswith("40 normals point into the workpiece")


def test_holes_without_depth_and_clouds_without_size():
    points, normals = grid()
    flat = cloud(points, normals, depth=5e-5)
    assert "40 holes" in seen(flat)["flat"].message
    words = {"Fastener ID": 1, "X": 1}
    listed = cloud(points, normals, MotionKind.LINEAR, words=words)
    assert "no hole is drilled" in seen(listed)["flat"].message
    assert not seen(replace(listed, words={"id": 1}))
    assert set(seen(cloud(points * 1e-3 * 3, normals))) >= {"small"}


def test_short_steps_are_counted_by_their_lines():
    step = np.array([1e-6] * 5 + [1e-2, 1e-6, 1e-2])
    points = np.column_stack([np.cumsum(step), 0 * step, 0 * step])
    points = np.vstack([np.zeros(3), points])
    message = seen(cloud(points, kind=MotionKind.LINEAR, feed=np.full(9, 0.01)))["short"].message
    assert message.startswith("6 points")
    assert "lines 3 to 7, 9" in message


@pytest.mark.parametrize("same", [False, True])
def test_the_looks_grow_with_the_size_only(same):
    points, normals = np.zeros((100_000, 3)), np.tile([0.0, 0.0, 1.0], (100_000, 1))
    if not same:
        points = np.random.default_rng(1).uniform(0, 5, (100_000, 3))
    start = time.process_time()
    looks(cloud(points, normals))
    assert time.process_time() - start < 5.0


def test_a_cut_that_swings_to_the_other_side_is_seen():
    found = {}
    for form in ("apt", "csv"):
        for turned in (0, 3, 5):
            axes = np.tile([0.0, 0.0, 1.0], (6, 1))
            axes[turned] = [0.1, 0.0, -0.995]
            points = np.column_stack([np.arange(6) * 0.02, np.zeros(6), np.zeros(6)])
            part = cloud(points, axes, kind=MotionKind.LINEAR, format=form)
            found[form, turned] = set(seen(part))
    assert set(map(frozenset, found.values())) == {frozenset({"turned"})}


def test_a_list_that_is_worked_from_below_is_asked_about(tmp_path):
    points, normals = grid()
    cell, told = cell_in(tmp_path), {}
    for name, sign, form in (("up", 1.0, "csv"), ("down", -1.0, "csv"), ("stated", -1.0, "apt")):
        found = from_below(cloud(points, sign * normals, format=form), cell)
        told[name] = [finding.code for finding in found]
    assert told == {"up": [], "down": ["PTS006"], "stated": []}
