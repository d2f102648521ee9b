"""Cuts that fail between key tags: taken out, or given key tags."""

import numpy as np
import pytest

from postproc.planning.checks import Reason
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import Judged, Spans
from postproc.planning.search.failing import FailingCuts

SPACING = 1e-3


@pytest.fixture
def failing():
    n = 400
    way = np.arange(n) * SPACING
    return FailingCuts(
        Interpolation(way, np.zeros(n), np.zeros(n, bool), np.ones(n, bool), np.zeros(n, int))
    )


def spans_of(between, ends, bad):
    """Return spans [first, last] with what stands against them at tags ``bad``."""
    first, last = np.array(ends).T
    nothing = np.zeros((len(ends), 3)), np.zeros((len(ends), 6))
    spans = Spans(
        first, last, nothing[0], nothing[0], nothing[1], nothing[1], np.zeros(len(ends), int)
    )
    rows = between.rows(first, last)
    reason = np.where(np.isin(rows.tag, bad), int(Reason.COLLISION), int(Reason.NONE))
    k = len(rows.tag)
    return spans, Judged(rows, np.zeros((k, 3)), np.zeros((k, 6)), reason, np.full(k, -1))


def test_a_short_cut_is_taken_out_and_a_good_one_is_not(failing):
    judged = spans_of(failing.between, [(0, 20), (20, 40)], [33])
    assert failing.taken_out(*judged).tolist() == [False, True]
    assert not failing.wanted


def test_a_long_cut_stays_and_wants_key_tags_where_it_fails(failing):
    judged = spans_of(failing.between, [(0, 100)], [60, 61])
    assert not failing.taken_out(*judged).any()
    assert failing.wanted == {59, 60, 61}


def test_where_key_tags_are_to_stay_as_they_are_none_is_taken_out(failing):
    named = FailingCuts(failing.between, longest=0.0)
    assert not named.taken_out(*spans_of(failing.between, [(0, 20)], [10])).any()
    assert named.wanted


def test_a_step_from_tag_to_tag_is_always_taken_out(failing):
    for tag in range(1, 40):
        assert failing.taken_out(*spans_of(failing.between, [(tag - 1, tag)], [tag])).all()
    assert not failing.wanted


def test_where_cuts_fail_over_and_over_tags_inside_become_key_tags(failing):
    out = [
        bool(failing.taken_out(*spans_of(failing.between, [(20 + i, 40 + i)], [30 + i]))[0])
        for i in range(20)
    ]
    assert out[0]
    assert out == sorted(out, reverse=True)
    assert not out[-1]
    assert failing.wanted
    assert failing.taken_out(*spans_of(failing.between, [(300, 320)], [310])).all()
