"""Runs of states, however long."""

import numpy as np
import pytest

from postproc.planning.search.bridges import _labels


@pytest.mark.parametrize("count", [1, 2, 3, 1024, 1500, 5000])
@pytest.mark.parametrize("closed", [False, True])
def test_states_that_follow_each_other_are_one_run(count, closed):
    order = np.random.default_rng(count).permutation(2 * count)
    after = np.empty(2 * count, dtype=np.int64)
    for run in (order[:count], order[count:]):
        after[run] = np.append(run[1:], run[0] if closed else run[-1])
    label = _labels(after, count)
    assert len(np.unique(label[order[:count]])) == len(np.unique(label[order[count:]])) == 1
    assert label[order[0]] != label[order[-1]]
