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


def test_no_part_ends_where_there_is_no_border():
    quality = [0] * 10
    quality[4:9] = [-1] * 5
    assert split(quality, 6) == (Part(0, 3), Part(3, 9), Part(9, 10))


def test_moves_without_a_border_need_a_file_that_holds_them():
    quality = [3, -1, -1, -1, 3, -1, -1]
    assert split(quality, 4) == (Part(0, 4), Part(4, 7))
    with pytest.raises(EmitError, match="is 3, but the 4 motions of a hole") as caught:
        split(quality, 3)
    assert caught.value.code == "EMT302"
