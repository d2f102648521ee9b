"""Hulls of configurations: nothing that samples of them find is missed, in rows or one by one."""

import numpy as np
import pytest

from postproc.collision.scene import Scene
from postproc.kinematics import Bound, Pieces, build
from tests.collision.conftest import at, box_at, cell_of

COUNT = 200


@pytest.fixture(scope="module")
def scene():
    cell = cell_of(
        tool=[box_at("head", [0.3, 0.2, 0.3], at(0.1, 0.05, 0.15))],
        workpiece=[box_at("block", [0.4, 0.4, 0.4], at(1.5, 0.2, 0.3))],
    )
    return Scene.build(cell, build(cell.robot))


def bound_of_row(seed):
    """Triangles of configurations beside each other on a way past the block, and far from it."""
    rng = np.random.default_rng(seed)
    low, high = np.deg2rad([[-35, -85, 85, -20, 20, -30], [45, -40, 125, 20, 70, 30]])
    ends = rng.uniform(low, high, (3, 6))
    share = np.linspace(0.0, 1.0, COUNT // 2)[:, None]
    way = np.concatenate(
        [ends[0] + share * (ends[1] - ends[0]), ends[1] + share * (ends[2] - ends[1])]
    )
    q = way[:, None, None] + rng.normal(0.0, 0.003, (COUNT, 3, 3, 6))
    slack = np.full((COUNT, 6), 1e-4)
    return Bound((Pieces(q, slack, np.arange(COUNT)),), np.zeros(COUNT, np.bool_), np.ones(COUNT))


@pytest.mark.parametrize("seed", [1, 5, 6, 7])
def test_a_row_is_judged_as_its_hulls_one_by_one_and_misses_nothing(scene, seed):
    bound = bound_of_row(seed)
    together = scene.check_corners(bound)
    pieces, one = bound.pieces[0], np.zeros(1, np.int64)
    alone = [
        scene.check_corners(
            Bound(
                (Pieces(pieces.q[[k]], pieces.slack[[k]], one),), bound.lost[[k]], bound.wrist[[k]]
            )
        ).hit[0]
        for k in range(COUNT)
    ]
    assert together.hit.tolist() == alone
    rng = np.random.default_rng(seed)
    for _ in range(20):
        a, b = rng.dirichlet(np.full(3, 0.5), (2, COUNT))
        q = np.einsum("tabd,ta,tb->td", pieces.q, a, b)
        q += rng.uniform(-1.0, 1.0, q.shape) * pieces.slack
        assert together.hit[scene.check(q).hit].all()


def test_some_rows_meet_the_block_and_most_do_not(scene):
    hits = np.concatenate([scene.check_corners(bound_of_row(seed)).hit for seed in (1, 5, 6, 7)])
    assert 0.01 < hits.mean() < 0.6
