"""The outer bound of approximated corners, against polynomials that keep to KUKA's rules.

A model of approximation, made independently of the bound: Bezier curves of random degree that leave
the path on it, no earlier than the distance before the corner, join it likewise behind it, tangent
at both ends, with all control points between path and corner.
"""

from math import comb

import numpy as np
import pytest

from postproc.geometry import inverse, rotation_from_vector, slerp, transform
from postproc.kinematics import Corners, build, joint_share, pieces_of
from tests.samples import cell_in

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def arm_and_tool(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    cell = cell_in(folder)
    return build(cell.robot), np.asarray(cell.tool.T_flange_tcp)


def polynomial(rng, a, corner, b, count=41):
    """A random curve from a to b whose control points lie on the legs, then between them."""
    before = [a + s * (corner - a) for s in np.sort(rng.uniform(0.0, 1.0, rng.integers(1, 3)))]
    behind = [b + s * (corner - b) for s in np.sort(rng.uniform(0.0, 1.0, rng.integers(1, 3)))]
    points = np.array([a, *before, *behind[::-1], b])
    degree = len(points) - 1
    s = np.linspace(0.0, 1.0, count)[:, None]
    return sum(
        comb(degree, i) * s**i * (1.0 - s) ** (degree - i) * point for i, point in enumerate(points)
    )


def off_pieces(q, pieces):
    """How far (n,) [rad] configurations lie from the nearest of triangles (t, 3, 6)."""
    a, b, c = np.moveaxis(pieces, 1, 0)
    best = np.full(len(q), np.inf)
    edges = np.stack([b - a, c - a], axis=2)
    for corner, edge in zip(a, edges, strict=True):
        weight = np.linalg.lstsq(edge, (q - corner).T, rcond=None)[0]
        weight = np.clip(weight, 0.0, 1.0)
        weight /= np.maximum(weight.sum(axis=0), 1.0)
        best = np.minimum(best, np.abs(q - corner - (edge @ weight).T).max(axis=1))
    return best


def test_joint_corners_are_the_triangle_of_the_joints(arm_and_tool):
    arm, tool = arm_and_tool
    rng = np.random.default_rng(1)
    for distance in (0.001, 0.05, 0.3):
        middle = np.array([0, -80, 100, 0, 40, 0]) * DEG
        far = middle + rng.uniform(-0.5, 0.5, (2, 6))
        share = [
            joint_share(arm, f[None], middle[None], tool, np.array([distance]))[0] for f in far
        ]
        ends = [middle + s * (f - middle) for s, f in zip(share, far, strict=True)]
        corner = (arm.fk(middle) @ tool)[:3, 3]
        for s, f in zip(share, far, strict=True):  # nowhere nearer than that the distance is kept
            inner = middle + np.linspace(0.0, s, 200)[:, None] * (f - middle)
            off = np.linalg.norm((arm.fk(inner) @ tool)[:, :3, 3] - corner, axis=1)
            assert s == 0.5 or off[-1] >= distance
        q = np.array([ends[0], middle, ends[1]])
        corners = Corners(
            q[None], arm.fk(q)[None] @ tool, np.zeros((1, 2), bool), tool, np.zeros((1, 3, 0))
        )
        pieces = pieces_of(arm, corners)
        assert not pieces.lost.any()
        for _ in range(10):
            way = polynomial(rng, *q)
            assert off_pieces(way, pieces.q).max() < 1e-9


@pytest.mark.parametrize("distance", [0.0005, 0.01, 0.06, 0.25])
def test_path_corners_hold_every_polynomial(arm_and_tool, distance):
    arm, tool = arm_and_tool
    rng = np.random.default_rng(int(distance * 1e4))
    q_corner = np.array([5, -85, 105, 10, 50, 20]) * DEG
    T_corner = arm.fk(q_corner) @ tool
    for _ in range(4):
        ways = rng.normal(size=(2, 3))
        ways *= distance / np.linalg.norm(ways, axis=1)[:, None]
        turns = rng.uniform(-0.15, 0.15, (2, 3)) * min(1.0, distance / 0.05)
        ends = [
            transform(T_corner[:3, :3] @ rotation_from_vector(turn), T_corner[:3, 3] + way)
            for way, turn in zip(ways, turns, strict=True)
        ]
        T = np.array([ends[0], T_corner, ends[1]])
        q, valid = arm.ik_in(T @ inverse(tool), np.full(3, int(arm.slot(q_corner))))
        assert valid.all()
        q += 2 * np.pi * np.round((q_corner - q) / (2 * np.pi))
        corners = Corners(q[None], T[None], np.ones((1, 2), bool), tool, np.zeros((1, 3, 0)))
        pieces = pieces_of(arm, corners)
        assert not pieces.lost.any()
        p = polynomial(rng, *T[:, :3, 3])
        # the orientation goes on in step, as far as each end has pulled it
        s = np.linspace(0.0, 1.0, len(p))
        R0 = slerp(
            np.broadcast_to(T[0, :3, :3], (len(p), 3, 3)),
            np.broadcast_to(T_corner[:3, :3], (len(p), 3, 3)),
            s,
        )
        R1 = slerp(
            np.broadcast_to(T_corner[:3, :3], (len(p), 3, 3)),
            np.broadcast_to(T[2, :3, :3], (len(p), 3, 3)),
            s,
        )
        R = slerp(R0, R1, s)
        way, valid = arm.ik_in(
            transform(R, p) @ inverse(tool), np.full(len(p), int(arm.slot(q_corner)))
        )
        assert valid.all()
        way += 2 * np.pi * np.round((q_corner - way) / (2 * np.pi))
        # joints are straight on pieces of 15 mm and 3 degrees: what is left is their bulge
        assert off_pieces(way, pieces.q).max() < pieces.slack.max() + 2e-3
        miss = np.linalg.norm(p - T_corner[:3, 3], axis=1).min()
        assert miss <= corners.miss()[0] + 1e-9


def test_corners_that_leave_the_posture_are_given_up(arm_and_tool):
    arm, tool = arm_and_tool
    q = np.array([0, -80, 100, 0, 40, 0]) * DEG
    T = np.repeat((arm.fk(q) @ tool)[None], 3, axis=0)
    T[0, :3, 3] += [5.0, 0, 0]
    corners = Corners(
        np.repeat(q[None, None], 3, axis=1),
        T[None],
        np.ones((1, 2), bool),
        tool,
        np.zeros((1, 3, 0)),
    )
    assert pieces_of(arm, corners).lost.all()
