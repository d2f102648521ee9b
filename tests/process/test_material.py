"""Which rapids stand in what was cut: those on the way by which the tool came in."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.process import feeds_out, in_the_cut
from tests.samples import path_of


@pytest.mark.parametrize(
    ("points", "found"),
    [
        ([(0, 0, 3), (0, 0, -5), (0, 0, -4)], True),  # back into the hole just drilled
        ([(0, 0, 3), (0, 0, -5), (0, 0, 3)], True),  # out of it
        ([(0, 0, 3), (0, 0, -5), (0, 0, 30)], False),  # above where it came from: air or not
        ([(0, 0, 3), (0, 0, -5), (0, 0, -6)], False),  # deeper
        ([(0, 0, 3), (0, 0, -5), (1, 0, -4)], False),  # beside it
        ([(-50, 0, -5), (0, 0, -5), (0, 0, 3)], False),  # came in from the side, under material
    ],
)
def test_a_rapid_behind_a_cut(points, found):
    up = (0.0, 0.0, 1.0)
    path = path_of(points, kind="RLR", axes=up)
    assert in_the_cut(path).tolist() == [False, False, found]
    assert np.allclose(path.axes, up)


def test_a_rapid_back_behind_a_way_out_at_feed():
    """The drill was fed out of its hole; the hole is there all the same."""
    points = [(0, 0, 3), (0, 0, -5), (0, 0, 3), (0, 0, -4), (0, 0, -6)]
    path = path_of(points, kind="RLLRR", axes=(0.0, 0.0, 1.0))
    assert feeds_out(path).tolist() == [False, False, True, False, False]
    assert in_the_cut(path).tolist() == [False, False, False, True, False]
