"""What joints do between the samples of a straight motion, against samples taken densely."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from postproc.planning.checks.feasible import Checker, Lines, Reason, Verdict
from postproc.planning.job import problem_of
from postproc.planning.states.settings import (
    settle,
)
from postproc.units import DEG

COUNT, DENSE = 1500, 200


def lines_near_limits(problem, rng):
    """Short motions whose ends are near the margin of A2, and whose wrist turns much."""
    kinematics, margin = problem.kinematics, problem.cell.limits.joint_margin
    q = rng.uniform(np.deg2rad([-90, 0, 60, -150, 6, -150]), np.deg2rad([90, 0, 130, 150, 30, 150]))
    q = np.tile(q, (COUNT, 1))
    q[:, [0, 2, 3, 4, 5]] += rng.uniform(-0.4, 0.4, (COUNT, 5)) * [1, 1, 5, 0.2, 5]
    q[:, 1] = kinematics.q_min[1] + margin + rng.uniform(0.0, 0.3, COUNT) * DEG
    T_flange_tcp = problem.cell.tool.T_flange_tcp
    T = kinematics.fk(q) @ T_flange_tcp
    T_to = T.copy()
    T_to[:, :3, 3] += rng.uniform(-0.01, 0.01, (COUNT, 3))
    turn = Rotation.from_rotvec(rng.uniform(-0.15, 0.15, (COUNT, 3))).as_matrix()
    T_to[:, :3, :3] = turn @ T[:, :3, :3]
    branch, nothing = kinematics.slot(q).astype(np.int64), np.zeros((COUNT, 0))
    q_to, reached = problem.solve(T_to, nothing, branch, q)
    ends = (q, q_to)
    kept = reached & np.all([problem.within(e) & problem.regular(e) for e in ends], axis=0)
    no = np.zeros(kept.sum(), dtype=bool)
    T, T_to, branch = T[kept], T_to[kept], branch[kept]
    return Lines(T, T_to, q[kept], q_to[kept], branch, no, (nothing[kept], nothing[kept]))


def densely(problem, lines, row):
    """Joints (DENSE, 6) along one motion."""
    share = np.linspace(0.0, 1.0, DENSE)
    T = np.tile(np.eye(4), (DENSE, 1, 1))
    start, end = lines.T_from[row], lines.T_to[row]
    T[:, :3, 3] = start[:3, 3] + share[:, None] * (end - start)[:3, 3]
    turns = Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3]]))
    T[:, :3, :3] = Slerp([0.0, 1.0], turns)(share).as_matrix()
    near = np.tile(lines.q_from[row], (DENSE, 1))
    branch = np.full(DENSE, lines.branch[row])
    return problem.solve(T, np.zeros((DENSE, 0)), branch, near)[0]


def test_joints_that_turn_back_between_samples_keep_the_margin(make_cell, make_path):
    cell, settings = settle(make_cell())
    problem = problem_of(make_path([[1.9, 0.0, 0.9]], [-1.0, 0.0, 0.0]), cell, settings)
    kinematics, rng = problem.kinematics, np.random.default_rng(4)
    missed = turning = needless = 0
    for _ in range(4):
        lines = lines_near_limits(problem, rng)
        verdict = Verdict.clean(len(lines))
        track = Checker(problem, None).track(lines, verdict)
        for row in range(len(lines)):
            q = densely(problem, lines, row)
            apart = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min()
            beyond = (cell.limits.joint_margin - apart) / DEG
            seen = problem.within(track.q[track.row == row]).all()
            turning += bool(seen and beyond > 0.005)
            missed += bool(verdict.good[row] and beyond > 0.003)
            needless += bool(verdict.reason[row] == Reason.JOINT_LIMIT and beyond < -0.01)
    assert turning > 8
    assert not missed
    assert not needless
