"""Stiffness curves over the spin need joint stiffness."""

from dataclasses import replace

import pytest

from postproc.errors import CellError
from postproc.planning import spin_curves


def test_without_stiffness_there_are_no_curves(make_cell, make_path, robot):
    toolpath = make_path([[1.9, 0.0, 0.9], [1.9, 0.1, 0.9]], [-1.0, 0.0, 0.0])
    with pytest.raises(CellError, match="PLN208: no joint stiffness"):
        spin_curves(toolpath, make_cell(robot=replace(robot, joint_stiffness=None)))
