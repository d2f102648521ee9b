"""The one table of system variables is whole, and a variable is found by any of its names."""

import pytest

from postproc.krl import Effect, initial_values, system_variable, system_variables

SOURCES = {"D", "SV", "BAS", "form"}


def test_every_variable_says_what_it_does_and_where_from():
    table = system_variables()
    lacks = [name for name, v in table.items() if not v.does or v.source not in SOURCES]
    assert (len(table) > 1000, lacks) == (True, [])
    assert all(variable.expected or variable.least is None for variable in table.values())


def test_few_are_harmless():
    harmless = [v for v in system_variables().values() if v.effect.is_still]
    assert 0 < len(harmless) <= 40


@pytest.mark.parametrize(
    ("key", "name", "effect"),
    [
        ("$VEL.CP", "$VEL.CP", Effect.MOTION),
        ("$VEL", "$VEL.CP", Effect.MOTION),
        ("$VEL_AXIS[7]", "$VEL_AXIS", Effect.MOTION),
        ("$TOOL.Z", "$TOOL", Effect.FRAMES),
        ("$LOAD.CM.X", "$LOAD", Effect.LOAD),
        ("$WORKSPACE[2].MODE", "$WORKSPACE", Effect.SUPERVISION),
        ("$OUT[3]", "$OUT", Effect.OUTPUT),
        ("$IN[3]", "$IN", Effect.READ_ONLY),
    ],
)
def test_a_variable_is_found_by_index_and_component(key, name, effect):
    found = system_variable(key)
    assert (found.name, found.effect) == (name, effect)


def test_what_the_table_does_not_list_is_not_known():
    assert system_variable("$NO_SUCH") is system_variable("$VELOCITY") is None


def test_what_is_followed_has_a_value_that_it_takes():
    for key, value in initial_values().items():
        variable = system_variable(key)
        ok = value in variable.constants if variable.constants else variable.takes(value)
        assert ok, key


def test_bounds():
    table = system_variables()
    assert [table["$OV_PRO"].takes(v) for v in (-1, 0, 100, 101)] == [False, True, True, False]
    assert [table["$ADVANCE"].takes(v) for v in (0, 2.5, 5, 6)] == [True, False, True, False]
    assert [table["$VEL.CP"].takes(v) for v in (0.0, 1e-6)] == [False, True]
    assert table["$ANOUT"].expected == "at least -1 and at most 1"
