"""The table of findings in real programs: every error is judged, false ones are few."""

import json

import pytest

from postproc.verification.coverage import Coverage, Unknown
from tests.places import SHARED, snapshot
from tests.samples import AT_PART, HEAD, START, at, cell_in
from tools.controllers import verify_table
from tools.controllers.lint_table import lines_of, table_of

CONTROLLERS = {
    "HugoDanielson/ChinaMilling": 152, "Aleynikovich/errekaSmartPal": 54,
    "Aleynikovich/Zinkerreka": 75, "Naqiu06/KUKA-Robotics": 37, "rawpython/kukaKRLmagic": 28,
    "khrzysio/KRC4_test": 154, "luciagumbau228/TFG": 72,
}  # fmt: skip
"""Repository to the number of its .src, .dat and .sub files that lint reads."""


@pytest.mark.parametrize("repository", CONTROLLERS)
def test_real_programs_have_no_false_error(repository):
    table = table_of([snapshot(repository)])
    assert table.files == CONTROLLERS[repository]
    assert [str(finding) for finding in table.false] == []


def test_what_nobody_judged_counts_as_false(tmp_path):
    (tmp_path / "JOB.src").write_bytes(b"DEF JOB( )\r\nprint('1')\r\nEND\r\n")
    (tmp_path / "GOOD.src").write_bytes(b"DEF GOOD( )\r\nEND\r\n")
    table = table_of([tmp_path])
    assert (table.files, table.share) == (2, 0.5)
    text = "\n".join(lines_of(table))
    assert "| KRL101 | error | 1 | 1 | nobody judged it yet |" in text
    assert "50.0 % of the files have no false error" in text


def test_archives_made_for_tests_have_no_error():
    made = SHARED / "real" / "krc" / "made"
    if not made.is_dir():
        pytest.skip("the archives are not beside the checkout")
    names = json.loads((made / "TRUTH.json").read_text())
    table = table_of([made / name for name in names])
    assert table.files == 10
    assert table.errors == []


PROGRAMS = {
    "good": [*HEAD, START, at(0, 0, 0)],
    "refused": [*HEAD, START.replace("A1 -5.14", "A1 -184.5"), START],
    "not known": [*HEAD, START, "IF $IN[3] THEN", at(0, 0, 0), "ELSE", at(0, 9, 0), "ENDIF"],
    "not read": [*HEAD, "LIN {X 1,"],
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_answer_of_verify_has_one_of_four_names(tmp_path, name):
    cell = cell_in(tmp_path, **AT_PART)
    path = tmp_path / "T.src"
    path.write_text("\r\n".join(["DEF T( )", *PROGRAMS[name], "END", ""]))
    answer = verify_table.answer(path, cell)
    assert answer.name == name
    assert bool(answer.reasons) == (name != "good")
    assert all("T.src:" in words for _, words in answer.reasons)


def test_the_table_of_verify_counts_programs_not_findings():
    table = verify_table.Table()
    reasons = [("speed", "first"), ("speed", "second"), ("load", "other")]
    unknown = (Unknown("T.src", 9, "not reached"),)
    table.add("one", verify_table.Answer("refused", reasons, Coverage(5, 3, 1, 1, unknown)))
    table.add("two", verify_table.Answer("good", [], Coverage(5, 5, 0, 0, ())))
    text = "\n".join(verify_table.lines_of(table))
    assert "| good | 1 | 50% |" in text
    assert "| refused | `speed` | 1 |" in text
    assert "| judged | 8 | 80% |" in text
    assert "| not known | 1 | 10% |" in text
    assert "| one | refused | 3 | 1 | 1 | 1 | other |" in text
