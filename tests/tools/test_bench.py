"""The benches still run: each names its options, the one of KRL does its work on few points."""

import re
from importlib import import_module

import pytest

from tools.bench.__main__ import NAMES


@pytest.mark.parametrize("name", NAMES)
def test_each_names_its_options(name, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        import_module(f"tools.bench.{name}").main()
    assert ended.value.code == 0
    assert "usage: " in capsys.readouterr().out


def test_writing_and_reading_krl(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["krl", "--points", "60"])
    import_module("tools.bench.krl").main()
    told = capsys.readouterr().out
    assert len(re.findall(r"^ +\d+\.\d\d s  ", told, re.MULTILINE)) == 11
    assert "60 of 60 matched" in told
    assert "{'moved': 1, 'removed': 1}" in told
