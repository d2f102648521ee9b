"""Where no cut leads on, the finding says what stops it, and the change it names lets it pass."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.kinematics import build
from postproc.planning.planner import plan
from postproc.units import DEG
from tools.bench.contours import random_case


def broken_at(seed, margin=None):
    toolpath, cell = random_case(seed)
    if margin is not None:
        cell = replace(cell, limits=replace(cell.limits, joint_margin=margin))
    errors = plan(toolpath, cell).errors
    return [error for error in errors if "serves the cut from" in error.message]


def test_a_joint_limit_is_named_with_what_it_lacks():
    (error,) = broken_at(55)
    assert error.code == "PLN102"
    assert "8 joint limit" in error.message
    lacking = float(error.hint.partition("gain ")[2].partition(" deg at A3")[0])
    margin = random_case(55)[1].limits.joint_margin
    assert 0.0 < lacking * DEG < margin
    # less would not do, so much lets the cut pass there
    (still,) = broken_at(55, margin - (lacking - 0.2) * DEG)
    assert still.tag_index == error.tag_index
    assert all(e.tag_index != error.tag_index for e in broken_at(55, margin - lacking * DEG))


@pytest.mark.parametrize(("seed", "pair"), [(52, "link 3 hits obstacle table")])
def test_what_is_hit_is_named(seed, pair):
    (error,) = broken_at(seed)
    assert error.code == "PLN104"
    assert pair in error.message


def test_a_cut_ends_where_the_tool_can_back_off():
    """Only between the spins of a grid of 5 degrees does a way lead to where it can."""
    toolpath, cell = random_case(684)
    found = plan(toolpath, cell)
    assert not found.errors
    arm = build(cell.robot)
    out = -(cell.bases[0].T_robroot_base[:3, :3] @ toolpath.axes[-1])
    q = found.q[np.flatnonzero(found.tag == len(toolpath) - 1)[0]]
    T, branch = arm.fk(q[None]), arm.branches.slot(q)
    for _ in range(50):
        T[:, :3, 3] -= out * cell.motion.approach / 50
        up, reached = arm.ik_in(T, np.array([branch]))
        q = up[0] - 2.0 * np.pi * np.round((up[0] - q) / (2.0 * np.pi))
        assert reached[0]
        assert arm.within_limits(q[None], cell.limits.joint_margin)[0]
