from importlib.metadata import EntryPoint

import pytest

from postproc import registry as registry_module
from postproc.errors import PluginError
from postproc.registry import Registry


def test_a_second_part_of_one_name_is_refused():
    parts = Registry("readers", "postproc.model")
    parts.register("x")(1)
    with pytest.raises(PluginError, match="registered twice"):
        parts.register("x")(2)


def test_an_unknown_name_lists_those_known():
    parts = Registry("readers", "postproc.model")
    parts._loaded = True
    parts.register("apt")(1)
    with pytest.raises(PluginError, match="known are apt"):
        parts.get("atp")


def test_a_broken_plug_in_is_named_and_left_out(monkeypatch):
    broken = EntryPoint("mine", "no_such_package.part:THING", "postproc.readers")
    good = EntryPoint("other", "math:pi", "postproc.readers")
    monkeypatch.setattr(registry_module, "entry_points", lambda group: [broken, good])
    monkeypatch.setattr(registry_module.pkgutil, "iter_modules", lambda path: [])
    parts = Registry("readers", "postproc.model")
    infos = {info.name: info for info in parts.infos()}
    assert "ModuleNotFoundError" in infos["mine"].problem
    assert infos["other"].problem == ""
    assert [name for name, _ in parts] == ["other"]
