"""Cutting long programs: everything once, no part too long, the best borders."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.errors import EmitError
from postproc.krl.text.split import Part, split, suffixes

qualities = st.lists(st.integers(0, 4), min_size=1, max_size=200)


@given(qualities, st.integers(2, 50), st.lists(st.integers(-5, 250), max_size=5))
def test_parts_cover_everything_once(quality, most, forced):
    parts = split(quality, most, forced)
    assert [i for part in parts for i in range(part.first, part.stop)] == list(range(len(quality)))
    assert all(0 < len(part) <= most for part in parts)
    borders = {part.first for part in parts}
    assert borders >= {i for i in forced if 0 < i < len(quality)}


@given(qualities, st.integers(2, 50))
def test_a_border_is_the_best_in_reach(quality, most):
    for part in split(quality, most)[:-1]:
        reach = quality[part.first + max(1, most // 2) : part.first + most + 1]
        assert quality[part.stop] == max(reach)


def test_a_short_program_is_one_part():
    assert split([0] * 10, 10) == (Part(0, 10),)


def test_the_last_of_equal_borders_is_taken():
    assert split([0] * 25, 10) == (Part(0, 10), Part(10, 20), Part(20, 25))


def test_a_reentry_is_preferred_to_the_middle_of_a_cut():
    quality = [0] * 30
    quality[7] = 3
    assert split(quality, 10)[0] == Part(0, 7)


def test_suffixes_have_equal_width():
    assert suffixes(2) == ("_001", "_002")
    assert suffixes(1000)[0] == "_0001"
    assert suffixes(1000)[-1] == "_1000"


def test_too_small_limit():
    with pytest.raises(EmitError, match="expected at least 2"):
        split([0] * 5, 1)
