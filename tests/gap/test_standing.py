"""The record of where each effect stands."""

import pytest

from postproc.gap.choice import Choice, Standing
from postproc.gap.choice.evidence import Evidence


@pytest.fixture
def choice():
    standing = {
        "small": Standing.UNNAMED,
        "b": Standing.ADOPTED,
        "a": Standing.ADOPTED,
        "like": Standing.RESEMBLED,
    }
    unique = {"small": 1e-6, "b": 2e-5, "a": 5e-5, "like": 1e-5}
    evidence = {key: Evidence(10.0, size) for key, size in unique.items()}
    return Choice(standing, evidence, {}, {"gone": "not clear enough"})


def test_adopted_blocks_come_by_what_only_they_explain(choice):
    assert choice.adopted == ("a", "b")
    assert choice.model == ("a", "b", "like", "small")


def test_a_block_has_one_standing(choice):
    moved = choice.moved(["a", "b"], Standing.REJECTED, {"a": "a placebo does as well"})
    assert moved.adopted == ()
    assert moved.having(Standing.REJECTED) == ("a", "b")
    assert moved.model == ("like", "small")
    assert moved.reasons == {"gone": "not clear enough", "a": "a placebo does as well"}
    assert choice.adopted == ("a", "b")


def test_what_joins_the_unnamed_comes_last(choice):
    assert choice.moved(["a"], Standing.UNNAMED, {}).unnamed == ("small", "a")


def test_alternatives_can_be_called_later(choice):
    assert choice.moved(["alike"], Standing.RESEMBLED, {}).resembled == ("alike", "like")
