"""Which motions of a text were judged: each with its line, and why one was not."""

import pytest

from postproc.verification.verify import verify
from tests.samples import AT_PART, HEAD, START, at, cell_in, modules

ELSEWHERE = "what happens right before it is not known, so neither is its path"


@pytest.fixture
def covered(tmp_path):
    """What is judged of the motions of a program of these lines."""

    def of(*lines, **others):
        cell = cell_in(tmp_path, **AT_PART)
        read = modules(*lines, **others)
        return verify(read, read[0].name, cell, collisions=False).coverage

    return of


def test_all_motions_of_a_plain_program_are_judged(covered):
    found = covered(*HEAD, START, at(0, 0, 0), at(0, 9, 0))
    assert (found.in_text, found.judged, found.refused, found.never_run) == (3, 3, 0, 0)
    assert found.unknown == ()


def test_a_violation_counts_where_it_stands(covered):
    found = covered(*HEAD, START, at(0, 0, 9000), START)
    assert (found.in_text, found.refused) == (3, 1)


def test_both_branches_of_an_unknown_condition_are_not_known(covered):
    found = covered(
        *HEAD, START, "IF $IN[3] THEN", at(0, 0, 0), "ELSE", at(0, 9, 0), "ENDIF", START, START
    )
    whys = [one.why for one in found.unknown]
    assert "not reached: $IN[3] is not known" in whys[0]
    assert whys[1:] == [ELSEWHERE, ELSEWHERE]  # the other branch, and what follows both
    lines = [one.line for one in found.unknown]
    assert [line - lines[0] for line in lines] == [0, 2, 4]
    assert found.judged == 2


def test_the_motion_behind_a_routine_that_is_not_there_comes_from_anywhere(covered):
    found = covered(*HEAD, START, "ELSEWHERE()", at(0, 0, 0), at(0, 9, 0))
    assert [one.why for one in found.unknown] == [ELSEWHERE]
    assert found.judged == 2


def test_a_goal_that_is_not_known_is_named_with_its_line(covered):
    found = covered(*HEAD, START, "LIN WHERE_IS_IT", at(0, 9, 0))
    lines = [one.line for one in found.unknown]
    assert [line - lines[0] for line in lines] == [0, 1]
    assert "goes is not known" in found.unknown[0].why


def test_a_branch_that_is_known_not_to_run_is_no_doubt(covered):
    found = covered(*HEAD, START, "IF FALSE THEN", at(0, 0, 0), "ENDIF", at(0, 9, 0))
    assert (found.judged, found.never_run, found.unknown) == (2, 1, ())
