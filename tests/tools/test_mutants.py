"""Mutants of emitted programs, by rule: all that do harm are noticed by lint or verify."""

import re

import pytest

from tools.mutants import HARMLESS, MUST_CATCH, judge, mutants

STYLES = [
    ("dense", "inline", "8.6", 1000),
    ("spline", "dat", "8.5", 15),
    ("forms", "dat", "8.5", 15),
]


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES, ids=lambda s: "-".join(map(str, s)))
def test_whatever_does_harm_is_noticed(emitted, style):
    cell, toolpath, files = emitted(*style)
    result = judge(files, cell, toolpath, every=23)
    assert [f"{m.rule}: {m.file}:{m.line}" for m in result.missed] == []
    assert result.caught.total() > 0.6 * result.total


@pytest.mark.parametrize("rule", MUST_CATCH)
def test_each_of_these_is_noticed_wherever_it_stands(emitted, rule):
    from tools.mutants.judge import noticed

    cell, toolpath, files = emitted()
    every = [mutant for mutant in mutants(files) if mutant.rule == rule]
    assert len(every) > 20
    for mutant in every[:: len(every) // 3]:
        assert noticed(mutant.files, cell, toolpath, collisions=False), mutant.line


def test_no_rule_that_must_be_caught_has_an_excuse():
    for rule in MUST_CATCH:
        assert not any(re.match(pattern, rule) for pattern, _ in HARMLESS), rule
