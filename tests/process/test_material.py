"""Which rapids stand in what was cut: those on the way by which the tool came in."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.process import in_the_cut
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
