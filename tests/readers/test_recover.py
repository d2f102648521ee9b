"""``--recover`` fixes what has one possible meaning and lists it; strict reading refuses it."""

import pytest

from postproc.errors import ReadError

CASES = {
    "APT009": "UNITS/MM\nGOTO/1,2,3\n",
    "APT020": "UNITS/MM\nGOTO/1,2,3,\nFINI\n",
    "APT021": "UNITS/MM\nGOTO/1,2 3\nFINI\n",
    "APT027": "UNITS/MM\nGOTO/1,2,3,0,0,2\nFINI\n",
}


@pytest.mark.parametrize("code", list(CASES))
def test_strict_refuses_and_recover_reads_the_one_meaning(code, read_text):
    with pytest.raises(ReadError) as caught:
        read_text(CASES[code])
    assert caught.value.code == code
    assert "--recover" in caught.value.hint
    toolpath = read_text(CASES[code], recover=True)
    assert (toolpath.points * 1e3).round(9).tolist() == [[1, 2, 3]]
    assert toolpath.axes.tolist() == [[0, 0, 1]]
    assert [finding.code for finding in toolpath.recovered] == [code]


def test_fixes_are_counted(read_text):
    text = "UNITS/MM\n" + "GOTO/1,2,3,\n" * 7 + "FINI\n"
    (fix,) = read_text(text, recover=True).recovered
    assert fix.count == 7
    assert fix.source.line == 2
    assert "left out" in fix.message


def test_what_has_no_single_meaning_is_an_error_even_then(read_text):
    for text in ("UNITS/MM\nGOTO/1,2\nFINI\n", "FEDRAT/100\nGOTO/1,2,3\nFINI\n",
                 "UNITS/MM\nGOTO/1,2,3,0,0,0\nFINI\n"):  # fmt: skip
        with pytest.raises(ReadError):
            read_text(text, recover=True)
