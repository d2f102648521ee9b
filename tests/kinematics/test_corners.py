"""The outer bound of approximated corners, against polynomials that keep to KUKA's rules.

A model of approximation, made independently of the bound: Bezier curves of random degree that leave
the path on it, no earlier than the distance before the corner, join it likewise behind it, tangent
at both ends, with all control points between path and corner.
"""

from math import comb

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from postproc.geometry import inverse, rotation_from_vector, transform
from postproc.kinematics import Corners, bound_of, build, corner_miss, joint_share
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


def off_hulls(q, bound):
    """How far (n,) [rad] configurations lie beside the nearest hulls and their slack."""
    hulls = [one.reshape(-1, 6) for part in bound.pieces for one in part.q]
    slack = [one for part in bound.pieces for one in part.slack]
    middle = np.array([hull.mean(axis=0) for hull in hulls])
    off = []
    for row in q:
        least = np.inf
        for i in np.linalg.norm(middle - row, axis=1).argsort():
            reach = np.abs(row - np.clip(row, hulls[i].min(axis=0), hulls[i].max(axis=0)))
            if (reach <= slack[i] + 1e-9).all():
                least = min(least, off_hull(row, hulls[i], slack[i]))
            if least <= 1e-9:
                break
        off.append(least)
    return np.array(off)


def off_hull(q, hull, slack):
    """How much larger the slack would have to be: the smallest t of a linear program."""
    count = len(hull)
    cost = np.r_[np.zeros(count), 1.0]
    sides = [np.c_[sign * hull.T, -np.ones(6)] for sign in (1.0, -1.0)]
    limits = [slack + q, slack - q]
    found = linprog(
        cost,
        A_ub=np.vstack(sides),
        b_ub=np.concatenate(limits),
        A_eq=np.r_[np.ones(count), 0.0][None],
        b_eq=[1.0],
        bounds=[(0.0, 1.0)] * count + [(0.0, None)],
    )
    return found.fun


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
        bound = bound_of(arm, corners)
        assert not bound.lost.any()
        for _ in range(4):
            assert off_hulls(polynomial(rng, *q), bound).max() < 1e-9


def turned_along(rng, T, count):
    """Rotations along a random polynomial of its own between three, by the same rules."""
    pull = polynomial(rng, *np.eye(3), count)
    turns = [Rotation.from_matrix(T[1, :3, :3].T @ T[end, :3, :3]).as_rotvec() for end in (0, 2)]
    mixed = pull[:, :1] * turns[0] + pull[:, 2:] * turns[1]
    return T[1, :3, :3] @ Rotation.from_rotvec(mixed).as_matrix()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("distance", "posture"),
    [
        (0.0005, (5, -85, 105, 10, 50, 20)),
        (0.01, (-40, -60, 90, 100, -6, -80)),
        (0.06, (-40, -60, 90, 100, -6, -80)),
        (0.25, (30, -50, 70, 60, 70, 150)),
    ],
)
def test_path_corners_hold_every_polynomial(arm_and_tool, distance, posture):
    """Point and orientation go along polynomials of their own; nothing is outside of the bound."""
    arm, tool = arm_and_tool
    rng = np.random.default_rng([int(distance * 1e4), posture[0] + 90])
    q_corner = np.array(posture) * DEG
    T_corner = arm.fk(q_corner) @ tool
    for _ in range(3):
        ways = rng.normal(size=(2, 3))
        ways *= distance / np.linalg.norm(ways, axis=1)[:, None]
        turns = rng.uniform(-0.15, 0.15, (2, 3)) * min(1.0, distance / 0.05)
        turns *= rng.uniform() < 0.7
        ends = [
            transform(T_corner[:3, :3] @ rotation_from_vector(turn), T_corner[:3, 3] + way)
            for way, turn in zip(ways, turns, strict=True)
        ]
        T = np.array([ends[0], T_corner, ends[1]])
        q, valid = near(arm, T @ inverse(tool), q_corner)
        assert valid
        corners = Corners(q[None], T[None], np.ones((1, 2), bool), tool, np.zeros((1, 3, 0)))
        bound = bound_of(arm, corners)
        if bound.lost.any():  # the wrist may get straight there
            assert abs(posture[4]) < 10
            continue
        for _ in range(3):
            p = polynomial(rng, *T[:, :3, 3], 15)
            pose = transform(turned_along(rng, T, len(p)), p)
            way, valid = near(arm, pose @ inverse(tool), q_corner)
            assert valid
            # below a millimetre the joints count as straight
            assert off_hulls(way, bound).max() < (1e-9 if distance > 1e-3 else 2e-5)
            miss = np.linalg.norm(p - T_corner[:3, 3], axis=1).min()
            assert miss <= corner_miss(*T[:, None, :3, 3])[0] + 1e-9


@pytest.mark.parametrize("distance", [0.0005, 0.01])
def test_little_turns_need_not_be_in_step_either(arm_and_tool, distance):
    """A turn of 0.04 deg moves what is half a metre off the tool point by a third of a mm."""
    arm, tool = arm_and_tool
    rng = np.random.default_rng(int(distance * 1e4))
    q_corner = np.array([5, -85, 105, 10, 50, 20]) * DEG
    T = np.repeat((arm.fk(q_corner) @ tool)[None], 3, axis=0)
    for end in (0, 2):
        way, turn = rng.normal(size=(2, 3))
        T[end, :3, 3] += distance * way / np.linalg.norm(way)
        turn *= 0.04 * DEG / np.linalg.norm(turn)
        T[end, :3, :3] = T[1, :3, :3] @ rotation_from_vector(turn)
    q, _ = near(arm, T @ inverse(tool), q_corner)
    bound = bound_of(
        arm, Corners(q[None], T[None], np.ones((1, 2), bool), tool, np.zeros((1, 3, 0)))
    )
    for _ in range(3):
        p = polynomial(rng, *T[:, :3, 3], 15)
        way, _ = near(arm, transform(turned_along(rng, T, 15), p) @ inverse(tool), q_corner)
        assert off_hulls(way, bound).max() < 1e-9


def near(arm, flange, q):
    """The joints in the posture of others, and whether all poses are within reach."""
    found, valid = arm.ik_in(flange, np.full(len(flange), int(arm.slot(q))))
    return found + 2 * np.pi * np.round((q - found) / (2 * np.pi)), valid.all()


def test_the_bound_of_a_path_corner_is_not_wasteful(arm_and_tool):
    """What the joints may be off the hulls is little: the hulls are what counts."""
    arm, tool = arm_and_tool
    q_corner = np.array([5, -85, 105, 10, 50, 20]) * DEG
    T = np.repeat((arm.fk(q_corner) @ tool)[None], 3, axis=0)
    T[0, :3, 3] += [0.05, 0.0, 0.0]
    T[2, :3, 3] += [0.0, 0.05, 0.0]
    T[2, :3, :3] = T[1, :3, :3] @ rotation_from_vector(np.array([0.1, 0.0, 0.1]))
    q, _ = near(arm, T @ inverse(tool), q_corner)
    corners = Corners(q[None], T[None], np.ones((1, 2), bool), tool, np.zeros((1, 3, 0)))
    bound = bound_of(arm, corners)
    assert not bound.lost.any()
    assert 0.0 < max(part.slack.max() for part in bound.pieces) < 2e-3


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
    assert bound_of(arm, corners).lost.all()


def random_corner(rng, arm, tool, q_corner, distance, turn):
    """A corner between two straight motions, and its three poses; None out of reach."""
    T_corner = arm.fk(q_corner) @ tool
    ways, turns = rng.normal(size=(2, 2, 3))
    ways *= distance / np.linalg.norm(ways, axis=1)[:, None]
    turns *= turn / np.linalg.norm(turns, axis=1)[:, None]
    ends = [
        transform(T_corner[:3, :3] @ rotation_from_vector(turn), T_corner[:3, 3] + way)
        for way, turn in zip(ways, turns, strict=True)
    ]
    T = np.array([ends[0], T_corner, ends[1]])
    q, valid = near(arm, T @ inverse(tool), q_corner)
    corners = Corners(q[None], T[None], np.ones((1, 2), bool), tool, np.zeros((1, 3, 0)))
    return (T, corners) if valid else None


def test_what_is_out_of_reach_out_of_step_ends_the_bound_at_its_edge(arm_and_tool):
    """Near the stretched arm: the bound holds every polynomial that the arm can follow."""
    arm, tool = arm_and_tool
    rng = np.random.default_rng(7)
    q_corner = np.array([30, -50, 1.5, 80, -55, -35]) * DEG
    followed = 0
    for _ in range(150):
        made = random_corner(rng, arm, tool, q_corner, 0.012, 1.5 * DEG)
        if made is None:
            continue
        T, corners = made
        every = [transform(R[:3, :3], p[:3, 3]) for R in T for p in T]
        if near(arm, np.array(every) @ inverse(tool), q_corner)[1]:
            continue
        bound = bound_of(arm, corners)
        for _ in range(2):
            p = polynomial(rng, *T[:, :3, 3], 9)
            pose = transform(turned_along(rng, T, len(p)), p)
            q, valid = arm.ik_in(pose @ inverse(tool), np.full(9, int(arm.slot(q_corner))))
            q = q + 2 * np.pi * np.round((q_corner - q) / (2 * np.pi))
            if not bound.lost[0]:
                followed += 1
                assert off_hulls(q[valid], bound).max() < 1e-9
        if followed >= 10:
            return
    raise AssertionError(f"only {followed} polynomials were followed")


def test_a_wrist_that_turns_far_is_cut_into_pieces_and_not_given_up(arm_and_tool):
    """Seven degrees off the straight wrist A4 turns by half a turn over little ways."""
    arm, tool = arm_and_tool
    rng = np.random.default_rng(8)
    q_corner = np.array([-26, -59, 80, -70, 7.5, 44]) * DEG
    found = 0
    for _ in range(40):
        made = random_corner(rng, arm, tool, q_corner, 0.05, 3.0 * DEG)
        if made is None or np.ptp(made[1].q[0], axis=0).max() < 25 * DEG:
            continue
        T, corners = made
        if np.abs(corners.q[0, :, 4]).min() < 6.5 * DEG or (corners.q[0, :, 4] < 0).any():
            continue
        bound = bound_of(arm, corners)
        assert not bound.lost[0]
        found += 1
        p = polynomial(rng, *T[:, :3, 3], 9)
        way, valid = near(arm, transform(turned_along(rng, T, 9), p) @ inverse(tool), q_corner)
        if valid:
            assert off_hulls(way, bound).max() < 1e-9
        if found == 2:
            break
    assert found


@pytest.mark.parametrize("a5", [6.0, -8.0, 40.0])
def test_the_wrist_is_no_straighter_anywhere_than_the_bound_says(arm_and_tool, a5):
    """Least |A5| of many polynomials: the bound is below it, and not by much."""
    arm, tool = arm_and_tool
    rng = np.random.default_rng(int(a5) + 100)
    q_corner = np.array([10, -80, 100, 15, a5, 20]) * DEG
    T_corner = arm.fk(q_corner) @ tool
    q, valid = q_corner[None], False
    while not valid:
        ways = rng.normal(size=(2, 3))
        ways *= 0.02 / np.linalg.norm(ways, axis=1)[:, None]
        ends = [transform(T_corner[:3, :3], T_corner[:3, 3] + way) for way in ways]
        T = np.array([ends[0], T_corner, ends[1]])
        q, valid = near(arm, T @ inverse(tool), q_corner)
        valid &= bool((np.sign(q[:, 4]) == np.sign(a5)).all())
    rows = [np.ones((1, 2), bool), np.array([[False, True]]), np.zeros((1, 2), bool)]
    both, mixed, joint = (
        bound_of(arm, Corners(q[None], T[None], is_path, tool, np.zeros((1, 3, 0))))
        for is_path in rows
    )
    least = np.inf
    for _ in range(200):
        p = polynomial(rng, *T[:, :3, 3], 15)
        pose = transform(np.repeat(T_corner[None, :3, :3], len(p), axis=0), p)
        way, _ = near(arm, pose @ inverse(tool), q_corner)
        least = min(least, np.abs(way[:, 4]).min())
    for bound in (both, mixed):
        assert not bound.lost.any()
        assert least - 0.3 * DEG < bound.wrist[0] <= least
    assert np.isinf(joint.wrist[0])
