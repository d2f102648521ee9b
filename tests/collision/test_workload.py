"""The shared workload scene: rates of collision, coal's answers, dense tags."""

import numpy as np
import pytest

from postproc.collision.check import Tally
from postproc.collision.scene import Scene
from postproc.kinematics import build
from tests.collision.conftest import motions_along
from tools.bench import workload
from tools.bench.collision import CoalModel

pytestmark = [
    pytest.mark.corpus,
    pytest.mark.skipif(
        not (workload.WORKLOADS / "scene").is_dir(),
        reason="the shared workloads are not beside the checkout",
    ),
]


def scene_and_candidates(hard, holes=200):
    cell = workload.workload_cell(hard)
    arm = build(cell.robot)
    return Scene.build(cell, arm), arm, workload.candidates(arm, cell, *workload.holes(holes))


@pytest.mark.parametrize(("hard", "low", "high"), [(False, 0.001, 0.005), (True, 0.32, 0.36)])
def test_as_many_candidates_collide_as_published(hard, low, high):
    # published with the workloads: 0.2 % in the base scene, 34 % in the hard one
    scene, _, q = scene_and_candidates(hard)
    assert low < scene.check(q).hit.mean() < high


def test_coal_agrees_and_most_pairs_are_culled():
    scene, arm, q = scene_and_candidates(hard=True)
    rng = np.random.default_rng(0)
    q = np.vstack([q[rng.permutation(len(q))[:1500]], rng.uniform(-2.0, 2.0, (1500, 6))])
    tally = Tally()
    hits = scene.check(q, tally=tally).hit
    assert np.array_equal(hits, CoalModel(scene, arm).check(q))
    assert 0.1 < hits.mean() < 0.6
    assert tally.exact < 0.02 * tally.pairs


def test_dense_tags_in_front_of_the_panel_need_few_exact_tests():
    """Half a millimetre between tags, 20 mm in front of the panel."""
    cell = workload.workload_cell()
    arm = build(cell.robot)
    scene = Scene.build(cell, arm)
    points, normals = (column[:2] for column in workload.holes(10000))
    share = np.linspace(0.0, 1.0, 60)[:, None]
    line = [ends[0] + share * (ends[1] - ends[0]) for ends in (points, normals)]
    line[1] /= np.linalg.norm(line[1], axis=1, keepdims=True)
    T = workload.candidates(arm, cell, line[0][:1], line[1][:1])
    seed = T[~scene.check(T).hit][0]
    slot = int(arm.slot(seed[None])[0])
    path = [seed]
    for point, normal in zip(*line, strict=True):
        q = workload.candidates(arm, cell, point[None], normal[None])
        q = q[arm.slot(q) == slot]
        path.append(q[np.abs(q - path[-1]).max(axis=1).argmin()])
    answer = motions_along(scene, np.array(path))
    assert not answer.any
    calls = count_exact(scene, np.array(path))
    assert calls < 0.1 * len(path)


def count_exact(scene, path):
    """How often triangles are looked at instead of hulls."""
    search = scene._engine._distances._search()
    original, count = search._exact, 0

    def counted(piece):
        nonlocal count
        count += 1
        return original(piece)

    search._exact = counted
    motions_along(scene, path)
    search._exact = original
    return count
