"""Golden programs against a grammar of KRL that others wrote, read from a checkout."""

import random
import re

import pytest

from tests.krl.antlr import read_grammar
from tests.places import FIXTURES, snapshot

REPOSITORY = "liukegeek/KrlParser"
PROGRAMS = sorted(path for path in FIXTURES.glob("*/expected/*") if path.suffix in (".src", ".dat"))
LINES = 150
"""What follows in a longer program is more of the same."""
NAMES_ONLY = re.compile(r"^\s*(SPLINE( WITH .*)?|ENDSPLINE( C_SPL)?)\s*$", re.MULTILINE)
"""What the grammar does not know: to it SPLINE and ENDSPLINE are names that stand alone."""
SPLINES = """\
&ACCESS RVP
DEF WAY( )
SPTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}
SPTP XHOME WITH $VEL_AXIS[1]=SVEL_JOINT(50.0),$TOOL=STOOL2(FHOME),$BASE=SBASE(FHOME.BASE_NO)
SLIN {X 0,Y 0,Z 10,A 0,B 90,C 0} C_SPL ; CAM line 3
SLIN {X 1.5,Y 0,Z 10,A 0,B 90,C 0} WITH $VEL.CP=0.025000 ; CAM line 4
SCIRC {X 2,Y 2,Z 10},{X 4,Y 0,Z 10,A 0,B 90,C 0} C_SPL
END
"""


@pytest.fixture(scope="module")
def grammar():
    path = snapshot(REPOSITORY) / "krl-core/src/main/resources/krl.g4"
    return read_grammar(path.read_text(encoding="utf-8"), "start")


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: "-".join(path.parts[-3::2]))
def test_golden_programs_belong_to_the_grammar(path, grammar):
    lines = path.read_bytes().decode("ascii").splitlines(keepends=True)
    text = "".join(lines if len(lines) <= LINES else [*lines[:LINES], lines[-1]])
    assert not grammar.fault(text)
    assert not grammar.fault(NAMES_ONLY.sub("", text))


def test_splines_are_known_one_by_one_and_blocks_are_not(grammar):
    assert not grammar.fault(SPLINES)
    assert grammar.fault(SPLINES.replace("SLIN {X 0", "SLINE {X 0")) == 5
    assert grammar.fault(SPLINES.replace("C_SPL", "C_SPLINE", 1)) == 5
    assert not grammar.fault(SPLINES.replace("SPTP {", "SPLINE\nSPTP {", 1))  # a name, no block
    assert grammar.fault(SPLINES.replace("END\n", "ENDSPLINE C_SPL\nEND\n"))


def test_a_damaged_program_does_not_belong(grammar):
    """The grammar is read right: it refuses texts that are not KRL, and says where."""
    text = (FIXTURES / "trim_5axis/expected/trim.src").read_bytes().decode("ascii")
    lines = text.splitlines()
    code = [i for i, line in enumerate(lines) if re.match(r"(LIN|PTP|CIRC|\$)", line)]
    random.seed(5)
    for at in random.sample(code, 3):
        bare = lines[at].partition(";")[0].rstrip()
        for wrong in (
            bare.replace("}", "", 1),
            bare.replace("{", "{,", 1),
            bare + " }",
            bare + " (",
        ):
            if wrong != bare:
                damaged = [*lines[:at], wrong, *lines[at + 1 :]]
                assert grammar.fault("\r\n".join(damaged) + "\r\n") == at + 1
